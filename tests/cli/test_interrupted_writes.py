"""Writes that end in the middle, for every kind of file and folder: what was there before is there after.

The size that the system lets a file have ends them: as an error ('File too large', as a full disk would) where the
signal is ignored, as a killed program where it is not."""
import json
import resource
import signal
import subprocess

import conversion_table as conversions
import pytest
from conversion_table import tool

SIDE = 12
# Nothing; between the pictures of a scene, and inside the largest of them.
LIMITS = [0, 1500, 6000, 20000]


def files(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob('*') if path.is_file()}


def limited(arguments, limit, is_killed):
    """Runs the tool where no file may grow beyond the limit."""
    def prepare():
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
        signal.signal(signal.SIGXFSZ, signal.SIG_DFL if is_killed else signal.SIG_IGN)
    return subprocess.run([conversions.program(), *map(str, arguments)], capture_output=True, text=True, timeout=120,
                          preexec_fn=prepare, restore_signals=False)


@pytest.fixture(scope='module')
def sources(tmp_path_factory):
    """Two clouds, and a camera that sees them."""
    folder = tmp_path_factory.mktemp('sources')
    cloud = conversions.make_cloud(SIDE)
    conversions.write_ply(folder / 'old.ply', cloud[:700], conversions.DEGREE)
    conversions.write_ply(folder / 'new.ply', cloud, conversions.DEGREE)
    (folder / 'transforms.json').write_text(json.dumps({'camera_angle_x': 1, 'w': 160, 'h': 120, 'frames': [
        {'transform_matrix': [[1, 0, 0, 0.6], [0, 1, 0, 0.6], [0, 0, 1, 4], [0, 0, 0, 1]]}]}))
    return folder


def writers():
    """(name of what is written, arguments of the tool before and after it)."""
    ways = [(f'cloud{extension}' if extension.startswith('.') else extension, ('convert',), options)
            for _, extension, _, options in conversions.written_formats()]
    ways += [('meta.json', ('convert',), ()), ('cloud.gltf', ('convert',), ()),
             ('text.ply', ('convert',), ('--ascii',)), ('tree.stipple.safetensors', ('decode',), ()),
             ('volume.vdb', ('voxelize',), ('--resolution', 32)), ('a.png', ('render',), ()),
             ('a.exr', ('render',), ()), ('film.usda', ('series',), ())]
    return ways


def call(way, folder, sources, which):
    name, before, after = way
    if before == ('render',):
        return ['render', sources / f'{which}.ply', '--camera', sources / 'transforms.json', '-o', folder / name]
    return [*before, sources / f'{which}.ply', folder / name, *after]


@pytest.mark.parametrize('way', writers(), ids=lambda way: way[0] + ''.join(map(str, way[2])))
def test_what_was_there_before_is_there_after(sources, tmp_path, way):
    tool(*call(way, tmp_path, sources, 'old'))
    (tmp_path / 'mine.txt').write_text('something else')
    before = files(tmp_path)
    interrupted = 0
    for limit in LIMITS:
        for is_killed in (False, True):
            result = limited(call(way, tmp_path, sources, 'new'), limit, is_killed)
            if result.returncode == 0:
                # Only where the limit is beyond all that is written.
                assert limit >= max(path.stat().st_size for path in tmp_path.rglob('*') if path.is_file())
                continue
            interrupted += 1
            if is_killed:
                assert result.returncode == -signal.SIGXFSZ, result.stderr
                # What a killed program left is not under any name that counts.
                assert {name: data for name, data in files(tmp_path).items() if name in before} == before
                for path in [path for path in tmp_path.rglob('*') if path.is_file()]:
                    if path.relative_to(tmp_path) not in before:
                        path.unlink()
            else:
                assert result.returncode == 1, result.stderr
                lines = result.stderr.strip().splitlines()
                assert 'File too large' in lines[-1] and str(tmp_path) in lines[-1], lines
                assert files(tmp_path) == before
    assert interrupted >= 6, 'the limits must fall into the file'
