"""docs/guides/add_a_strategy.md, followed literally: the part and the strategy fit splats from the tool, and the
add-on's list has them."""
import json
import subprocess
import sys

from fit_dataset import dataset  # noqa: F401
from guide import ROOT, Guide

LISTED = """
import sys, types
package = types.ModuleType('stipple')
package.__path__ = [{addon!r}]
sys.modules['stipple'] = package
from stipple.binding import library, strategies
loaded = library.load({library!r})
part = [entry for entry in strategies.strategy_parts(loaded) if entry.name == 'even_growth'][0]
print(part.label, part.bit, part.decides, [(s.name, s.default) for s in part.settings], sep=';')
print([entry.label for entry in strategies.strategies(loaded) if entry.name == 'brisk'][0])
"""


def test_the_guide_adds_a_part_and_a_strategy(dataset, tmp_path):  # noqa: F811
    guide = Guide('add_a_strategy', tmp_path / 'tree').follow()
    library = guide.build_library()
    assert guide.count('part', 'growth', 'table') == 2
    assert guide.count() == 3

    (guide.folder / 'photos').symlink_to(dataset)
    outputs = list(guide.run_commands().values())
    assert 'even_growth' in outputs[0] and 'brisk' in outputs[0]
    for name, limit in (('out.ply', 90), ('other.ply', 70)):
        count = json.loads(guide.run('info', name, '--json'))['count']
        assert 40 < count <= limit, name
    # It is the part that decides: the strategy alone makes more of the same splats.
    guide.run('fit', 'photos', 'alone.ply', *'--start 40 --iterations 450 --strategy'.split(),
              'adaptive(threshold=1e-9)')
    assert json.loads(guide.run('info', 'alone.ply', '--json'))['count'] > 90
    refused = guide.run('fit', 'photos', 'no.ply', '--strategy', 'mcmc+even_growth(splats=-1)', status=1)
    assert 'even_growth.splats is -1' in refused

    script = LISTED.format(addon=str(ROOT / 'addon' / 'stipple'), library=str(library))
    listed = subprocess.run([sys.executable, '-c', script], capture_output=True, text=True, timeout=60)
    assert listed.returncode == 0, listed.stderr
    assert listed.stdout.splitlines() == [
        "Even Growth;11;how many splats there may be;[('splats', 100000.0)]", 'Brisk']
