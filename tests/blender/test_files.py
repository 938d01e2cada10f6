# SPDX-License-Identifier: GPL-3.0-or-later
"""Import and export: bits, transforms, formats."""

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

import scenes
from test_splat_data import make_arrays


def write_ply(stipple, path, arrays):
    stipple.binding.cloud.Cloud.create(stipple.scene.sources.context(), arrays).save(str(path))


def assert_close(a, b):
    """PLY stores logarithms and logits of scale and opacity: single precision of those leaves 1e-5."""
    np.testing.assert_array_equal(a.positions, b.positions)
    np.testing.assert_array_equal(a.sh, b.sh)
    np.testing.assert_allclose(a.scales, b.scales, rtol=1e-5)
    np.testing.assert_allclose(a.opacities, b.opacities, atol=1e-5)
    np.testing.assert_allclose(a.rotations, b.rotations, atol=1e-6)


@pytest.mark.parametrize('degree', [0, 3])
@pytest.mark.parametrize('text', [False, True])
def test_round_trip(stipple, tmp_path, degree, text):
    arrays = make_arrays(stipple, degree=degree)
    write_ply(stipple, tmp_path / 'in.ply', arrays)
    assert bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'in.ply')) == {'FINISHED'}
    obj = bpy.context.object
    assert obj.name == 'in' and obj.data.stipple.source_kind == 'CLOUD'
    assert_close(stipple.scene.splat_data.read(obj.data), arrays)
    assert bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'out.ply'), ascii=text) == {'FINISHED'}
    assert bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'out.ply')) == {'FINISHED'}
    assert_close(stipple.scene.splat_data.read(bpy.context.object.data), arrays)


def test_transform_is_applied_on_request(stipple, tmp_path):
    arrays = make_arrays(stipple, degree=1)
    write_ply(stipple, tmp_path / 'in.ply', arrays)
    bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'in.ply'))
    obj = bpy.context.object
    matrix = Matrix.Translation((1, 2, 3)) @ Euler((0.3, 0.4, 0.5)).to_matrix().to_4x4() @ Matrix.Scale(2.0, 4)
    obj.matrix_world = matrix
    bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'own.ply'), apply_transform=False)
    bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'world.ply'), apply_transform=True)
    load = stipple.binding.cloud.Cloud.load
    native = stipple.scene.sources.context()
    assert_close(load(native, str(tmp_path / 'own.ply')).read(), arrays)
    world = load(native, str(tmp_path / 'world.ply')).read()
    m = np.array(matrix)
    # Single precision of positions within 20 m.
    np.testing.assert_allclose(world.positions, arrays.positions @ m[:3, :3].T + m[:3, 3], atol=1e-5)
    np.testing.assert_allclose(world.scales, 2 * arrays.scales, rtol=1e-4)
    # Turning harmonics keeps the constant part and the length of each band.
    np.testing.assert_allclose(world.sh[:, 0], arrays.sh[:, 0], atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(world.sh[:, 1:4], axis=1), np.linalg.norm(arrays.sh[:, 1:4], axis=1),
                               rtol=1e-4)


@pytest.mark.parametrize('scale', [(1, 2, 1), (-1, 1, 1), (-0.5, 2, 3)])
def test_uneven_and_mirrored_objects_are_applied(stipple, tmp_path, scale):
    arrays = make_arrays(stipple, degree=1)
    write_ply(stipple, tmp_path / 'in.ply', arrays)
    bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'in.ply'))
    bpy.context.object.scale = scale
    bpy.context.view_layer.update()
    assert bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'out.ply')) == {'FINISHED'}
    out = stipple.binding.cloud.Cloud.load(stipple.scene.sources.context(), str(tmp_path / 'out.ply')).read()
    m = np.diag(scale).astype(float)
    for i in range(len(arrays.positions)):
        expected = m @ covariance(arrays, i) @ m.T
        # PLY stores logarithms of scales in single precision.
        np.testing.assert_allclose(covariance(out, i), expected, atol=1e-5 * np.linalg.norm(expected))
    np.testing.assert_allclose(out.positions, arrays.positions * np.float32(scale), rtol=1e-6)


def covariance(arrays, i):
    w, x, y, z = (float(v) for v in arrays.rotations[i])
    turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])
    axes = turn * arrays.scales[i].astype(float)
    return axes @ axes.T


def test_a_flattened_object_cannot_be_applied(stipple, tmp_path):
    write_ply(stipple, tmp_path / 'in.ply', make_arrays(stipple, degree=0))
    bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'in.ply'))
    bpy.context.object.scale = (1, 0, 1)
    bpy.context.view_layer.update()
    scenes.refuses(lambda: bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'out.ply')), 'singular')
    assert not (tmp_path / 'out.ply').exists()


@pytest.mark.parametrize('axis,up', [('Z', (0, 0, 1)), ('Y', (0, 1, 0)), ('-Y', (0, -1, 0))])
def test_up_axis_turns_the_object_only(stipple, tmp_path, axis, up):
    arrays = make_arrays(stipple, degree=0)
    write_ply(stipple, tmp_path / 'in.ply', arrays)
    bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'in.ply'), up_axis=axis)
    obj = bpy.context.object
    np.testing.assert_allclose(np.array(obj.matrix_world)[:3, :3] @ up, (0, 0, 1), atol=1e-6)
    np.testing.assert_array_equal(stipple.scene.splat_data.read(obj.data).positions, arrays.positions)
