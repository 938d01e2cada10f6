"""Splats that a mesh carries from one shape to another."""
import struct

import numpy as np
import pytest
from test_tool import error, figures, run, write_cube_glb

CORNERS = np.array([[0.5 if i >> axis & 1 else -0.5 for axis in range(3)] for i in range(8)], np.float32)


def write_cube(path, corners):
    """The cube of the other tests with its corners elsewhere."""
    write_cube_glb(path)
    data = path.read_bytes()
    before = struct.pack('<24f', *CORNERS.reshape(-1))
    assert data.count(before) == 1
    path.write_bytes(data.replace(before, np.asarray(corners, '<f4').tobytes()))


def splats(path):
    """(positions [N,3], logarithms of scales [N,3]) of a PLY file."""
    header, _, body = path.read_bytes().partition(b'end_header\n')
    names = [line.split()[-1].decode() for line in header.splitlines() if line.startswith(b'property float')]
    rows = np.frombuffer(body, '<f4').reshape(-1, len(names))
    return rows[:, [names.index(a) for a in 'xyz']], rows[:, [names.index(f'scale_{i}') for i in range(3)]]


@pytest.fixture
def cube(tmp_path):
    """(splats on a cube, the cube) in files."""
    write_cube(tmp_path / 'rest.glb', CORNERS)
    run('decode', tmp_path / 'rest.glb', tmp_path / 'cube.ply', '--anchors', 500)
    return tmp_path / 'cube.ply', tmp_path / 'rest.glb'


@pytest.mark.parametrize('option', [(), ('--around',)])
def test_a_larger_mesh_elsewhere_takes_its_splats_along(cube, tmp_path, option):
    cloud, rest = cube
    write_cube(tmp_path / 'posed.glb', 2 * CORNERS + np.float32([1, 0, 0]))
    seen = figures('carry', cloud, rest, tmp_path / 'posed.glb', tmp_path / 'out.ply', *option)
    assert (seen['splats'], seen['vertices'], seen['triangles']) == (500, 8, 12)
    assert (seen['triangles_per_splat'] == 1) == (not option)
    before, after = splats(cloud), splats(tmp_path / 'out.ply')
    np.testing.assert_allclose(after[0], 2 * before[0] + np.float32([1, 0, 0]), atol=2e-6)
    # Flat splats stay flat: what is smaller than a millionth of the largest side is rounding.
    large = before[1] > before[1].max(axis=1, keepdims=True) - 10
    np.testing.assert_allclose((after[1] - before[1])[large], np.log(2), atol=1e-3)


def test_another_mesh_is_refused_and_nothing_written(cube, tmp_path):
    cloud, rest = cube
    write_cube(tmp_path / 'posed.glb', CORNERS)
    data = (tmp_path / 'posed.glb').read_bytes()
    turned = data.replace(struct.pack('<3H', 0, 2, 1), struct.pack('<3H', 0, 1, 2), 1)
    assert turned != data
    (tmp_path / 'posed.glb').write_bytes(turned)
    assert 'must be shapes of one mesh' in error('carry', cloud, rest, tmp_path / 'posed.glb', tmp_path / 'out.ply')
    assert 'missing.glb' in error('carry', cloud, rest, tmp_path / 'missing.glb', tmp_path / 'out.ply')
    assert not (tmp_path / 'out.ply').exists()


def test_a_model_brings_the_mesh_that_its_splats_follow_at_any_budget(cube, tmp_path):
    _, rest = cube
    model, bound = tmp_path / 'cube.stipple.safetensors', tmp_path / 'bound.stipple.safetensors'
    run('decode', rest, model)
    assert 'brings no mesh' in error('decode', model, tmp_path / 'out.ply', '--posed', rest)
    seen = figures('bind', model, rest, bound)
    assert (seen['vertices'], seen['triangles'], seen['follows']) == (8, 12, 'surface')
    write_cube(tmp_path / 'posed.glb', 2 * CORNERS + np.float32([1, 0, 0]))
    for budget in (50, 900):
        run('decode', bound, tmp_path / 'before.ply', '--anchors', budget)
        run('decode', bound, tmp_path / 'after.ply', '--anchors', budget, '--posed', tmp_path / 'posed.glb')
        before, after = splats(tmp_path / 'before.ply')[0], splats(tmp_path / 'after.ply')[0]
        assert len(before) == budget
        np.testing.assert_allclose(after, 2 * before + np.float32([1, 0, 0]), atol=2e-6)
    # Another mesh, and what is no model.
    write_cube_glb(tmp_path / 'posed.glb')
    data = (tmp_path / 'posed.glb').read_bytes()
    (tmp_path / 'posed.glb').write_bytes(data.replace(struct.pack('<3H', 0, 2, 1), struct.pack('<3H', 0, 1, 2), 1))
    assert 'must be shapes of one mesh' in error('decode', bound, tmp_path / 'x.ply', '--posed', tmp_path / 'posed.glb')
    assert 'is not a model' in error('bind', cube[0], rest, bound)
    assert 'is none' in error('decode', rest, tmp_path / 'x.ply', '--posed', rest)
    assert not (tmp_path / 'x.ply').exists()
