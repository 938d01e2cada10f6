"""docs/guides/add_a_backend.md, followed literally: an image and a fit come out of the backend, near those of the
processor's own and not the same."""
import json

import conversion_table as conversions
import numpy as np
from fit_dataset import dataset  # noqa: F401
from guide import Guide


def losses(path):
    return np.array(json.loads(path.read_text())['by_iteration']['loss'], dtype=float)


def test_the_guide_adds_a_backend(dataset, tmp_path):  # noqa: F811
    guide = Guide('add_a_backend', tmp_path / 'tree').follow()
    guide.build_library()
    assert guide.count() == 2

    for name in ('truth.ply', 'transforms.json'):
        (guide.folder / name).symlink_to(dataset / name)
    (guide.folder / 'photos').symlink_to(dataset)
    guide.run_commands()
    for command in guide.commands:  # the same without it
        own = command.replace('STIPPLE_BACKEND=double ', '').replace('double.', 'cpu.')
        guide.run_command(own)

    compared = json.loads(guide.run('compare', 'double.exr', 'cpu.exr', '--json'))
    # Colours of about 1 are rounded to 24 bits in every sum of single precision.
    assert 0 < compared['max_error'] < 1e-4
    theirs, ours = losses(guide.folder / 'double.json'), losses(guide.folder / 'cpu.json')
    assert len(theirs) == 40 and not np.array_equal(theirs, ours)
    # 40 steps of Adam; render_seam_test.cpp says how far roundings go in 50.
    np.testing.assert_allclose(theirs, ours, rtol=1e-4)
    fitted, own = (conversions.read_ply(guide.folder / name, 3) for name in ('double.ply', 'cpu.ply'))
    assert fitted.shape == own.shape and not np.array_equal(fitted, own)

    refused = guide.run('fit', 'photos', 'no.ply', *'--start 60 --iterations 600 --strategy revised'.split(), status=1,
                        environment={'STIPPLE_BACKEND': 'double'})
    assert 'the backend double gathers no errors of pixels' in refused
    unknown = guide.run('info', 'truth.ply', status=1, environment={'STIPPLE_BACKEND': 'abacus'})
    assert 'STIPPLE_BACKEND is "abacus"; this library has cpu, double' in unknown
