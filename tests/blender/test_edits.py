# SPDX-License-Identifier: GPL-3.0-or-later
"""Masks on sources, merging, applying, level ground and scale."""

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

import scenes
from test_files import assert_close, write_ply
from test_splat_data import make_arrays


@pytest.fixture
def imported(stipple, tmp_path):
    return import_arrays(stipple, tmp_path, make_arrays(stipple, count=500, degree=1))


def import_arrays(stipple, tmp_path, arrays, name='in'):
    write_ply(stipple, tmp_path / f'{name}.ply', arrays)
    assert bpy.ops.stipple.splats_import(filepath=str(tmp_path / f'{name}.ply')) == {'FINISHED'}
    obj = bpy.context.object
    obj.matrix_world = Matrix.Identity(4)
    bpy.context.view_layer.update()
    return obj


def read(stipple, obj):
    return stipple.scene.source.splat_data.read(obj.data)


def box(location=(0, 0, 0), rotation=(0, 0, 0), size=1.0):
    empty = scenes.link(bpy.data.objects.new('box', None))
    empty.location, empty.rotation_euler, empty.empty_display_size = location, rotation, size
    return empty


def select(splats, *others):
    scenes.select(splats, *others)


def in_box(positions, empty):
    local = positions @ np.linalg.inv(np.array(empty.matrix_world))[:3, :3].T + np.linalg.inv(
        np.array(empty.matrix_world))[:3, 3]
    return np.abs(local).max(axis=1) <= empty.empty_display_size


def test_crop_by_a_turned_box_and_back(stipple, imported):
    before = read(stipple, imported)
    cube = box((0.3, 0, 0), (0.3, 0.4, 0.5), 0.8)
    select(imported, cube)
    assert bpy.ops.stipple.crop_by_box() == {'FINISHED'}
    inside = in_box(before.positions, cube)
    assert 0 < np.count_nonzero(inside) < 500
    np.testing.assert_array_equal(read(stipple, imported).positions, before.positions[inside])
    assert list(stipple.scene.source.masks.counts(imported.data)) == [500, np.count_nonzero(inside)]
    assert bpy.ops.stipple.clear_mask() == {'FINISHED'}
    np.testing.assert_array_equal(read(stipple, imported).positions, before.positions)
    assert not bpy.ops.stipple.clear_mask.poll()


def test_masks_compose_and_the_outside_can_be_kept(stipple, imported):
    before = read(stipple, imported)
    first, second = box(size=1.2), box((0.5, 0, 0), size=0.5)
    select(imported, first)
    bpy.ops.stipple.crop_by_box()
    select(imported, second)
    bpy.ops.stipple.crop_by_box(keep='OUTSIDE')
    expected = in_box(before.positions, first) & ~in_box(before.positions, second)
    np.testing.assert_array_equal(read(stipple, imported).positions, before.positions[expected])


def test_crop_follows_the_objects_matrix(stipple, imported):
    before = read(stipple, imported)
    imported.matrix_world = Matrix.Translation((5, 0, 0)) @ Matrix.Rotation(0.4, 4, 'Z') @ Matrix.Scale(2, 4)
    cube = box((5, 0.4, 0), size=1.5)
    select(imported, cube)
    bpy.ops.stipple.crop_by_box()
    m = np.array(imported.matrix_world)
    expected = in_box(before.positions @ m[:3, :3].T + m[:3, 3], cube)
    np.testing.assert_array_equal(read(stipple, imported).positions, before.positions[expected])


def test_crop_by_a_mesh_and_its_modifiers(stipple, imported):
    before = read(stipple, imported)
    ball = scenes.sphere(segments=64, rings=48)
    modifier = ball.modifiers.new('shift', 'DISPLACE')
    modifier.strength, modifier.mid_level = 0.2, 0.0  # radius 1.2
    select(imported, ball)
    assert bpy.ops.stipple.crop_by_mesh() == {'FINISHED'}
    radius = np.linalg.norm(before.positions, axis=1)
    clear = np.abs(radius - 1.2) > 0.01  # facets
    kept = {tuple(p) for p in read(stipple, imported).positions}
    for p, r in zip(before.positions[clear], radius[clear]):
        assert (tuple(p) in kept) == (r < 1.2)


def test_floaters_are_hidden_and_reported(stipple, tmp_path):
    arrays = make_arrays(stipple, count=1000, degree=0)
    arrays.scales[:] = 0.05
    arrays.opacities[:] = 0.8
    arrays.opacities[:5] = 0.01
    arrays.scales[5:8] = 60
    arrays.positions[8:10] = (40, 40, 40)
    obj = import_arrays(stipple, tmp_path, arrays)
    assert bpy.ops.stipple.delete_floaters(radius=2.0) == {'FINISHED'}
    left = read(stipple, obj)
    np.testing.assert_array_equal(left.positions, arrays.positions[10:])
    # A second run finds nothing: what is hidden does not count again.
    assert bpy.ops.stipple.delete_floaters(radius=2.0) == {'FINISHED'}
    assert list(stipple.scene.source.masks.counts(obj.data)) == [1000, 990]


def test_a_mask_survives_undo_saving_and_use_elsewhere(stipple, imported, tmp_path):
    bpy.ops.ed.undo_push(message='imported')
    cube = box(size=0.7)
    select(imported, cube)
    bpy.ops.stipple.crop_by_box()
    bpy.ops.ed.undo_push(message='cropped')
    name, kept = imported.name, stipple.scene.source.splat_data.count(imported.data)
    assert kept < 500
    bpy.ops.ed.undo()
    obj = bpy.data.objects[name]
    assert stipple.scene.source.splat_data.count(obj.data) == 500
    assert stipple.scene.source.masks.counts(obj.data) is None
    bpy.ops.ed.redo()
    obj = bpy.data.objects[name]
    assert stipple.scene.source.splat_data.count(obj.data) == kept
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'a.blend'))
    obj = bpy.data.objects[name]
    assert stipple.scene.source.splat_data.count(obj.data) == kept
    scenes.select(obj)
    assert bpy.ops.stipple.revert_to_source() == {'FINISHED'}
    assert stipple.scene.source.splat_data.count(obj.data) == kept
    assert bpy.ops.stipple.clear_mask() == {'FINISHED'}
    assert stipple.scene.source.splat_data.count(obj.data) == 500


def test_splats_without_a_source_get_one(stipple, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    data = stipple.scene.source.splat_data.new_data('made')
    arrays = make_arrays(stipple, count=100, degree=0)
    stipple.scene.source.splat_data.write(data, arrays)
    obj = scenes.link(stipple.scene.source.splat_data.new_object('made', data))
    select(obj, box(size=0.8))
    assert bpy.ops.stipple.crop_by_box() == {'FINISHED'}
    assert data.stipple.source.startswith('//stipple') and (tmp_path / 'stipple' / 'made.ply').is_file()
    bpy.ops.stipple.clear_mask()
    assert_close(read(stipple, obj), arrays)


def test_merge_joins_the_masked_clouds_in_the_active_objects_frame(stipple, tmp_path):
    a, b = make_arrays(stipple, count=60, degree=0), make_arrays(stipple, count=40, degree=2)
    first, second = import_arrays(stipple, tmp_path, a, 'a'), import_arrays(stipple, tmp_path, b, 'b')
    first.matrix_world = Matrix.Rotation(0.7, 4, 'X') @ Matrix.Translation((1, 2, 3))
    second.matrix_world = Matrix.Translation((0, 0, 4)) @ Matrix.Scale(-1, 4, (1, 0, 0))
    select(first, box(first.matrix_world.translation, size=1.5))
    bpy.ops.stipple.crop_by_box()
    kept = stipple.scene.source.splat_data.count(first.data)
    scenes.select(first, second)
    m = np.linalg.inv(np.array(first.matrix_world)) @ np.array(second.matrix_world)
    assert bpy.ops.stipple.merge_splats() == {'FINISHED'}
    both = read(stipple, first)
    assert both.sh.shape == (kept + 40, 9, 3)
    np.testing.assert_allclose(both.positions[kept:], b.positions @ m[:3, :3].T + m[:3, 3], atol=1e-5)
    assert 'b' not in bpy.data.objects
    assert stipple.scene.source.masks.counts(first.data) is None


@pytest.mark.parametrize('budget, count', [('VIEWPORT', 50), ('RENDER', 80), ('FULL', 200)])
def test_merge_takes_the_budget_that_is_asked_for(stipple, tmp_path, budget, count):
    first = import_arrays(stipple, tmp_path, make_arrays(stipple, count=200, degree=0), 'a')
    assert bpy.ops.stipple.add_budget() == {'FINISHED'}
    first.data.stipple.ratio, first.data.stipple.ratio_render = 0.25, 0.4
    second = import_arrays(stipple, tmp_path, make_arrays(stipple, count=40, degree=0), 'b')
    scenes.select(first, second)
    assert bpy.ops.stipple.merge_splats(budget=budget) == {'FINISHED'}
    assert stipple.scene.source.splat_data.count(first.data) == count + 40


def test_splats_of_an_older_file_are_merged_into(stipple, tmp_path):
    """They are meshes there, and so is the datablock that their object gets, in versions with point clouds too."""
    splat_data = stipple.scene.source.splat_data
    mesh = bpy.data.meshes.new('older')
    old = scenes.link(splat_data.new_object('older', splat_data.new_data('older', like=mesh)))
    splat_data.write(old.data, make_arrays(stipple, count=30, degree=0))
    scenes.select(old, import_arrays(stipple, tmp_path, make_arrays(stipple, count=40, degree=0)))
    assert bpy.ops.stipple.merge_splats() == {'FINISHED'}
    assert isinstance(old.data, bpy.types.Mesh) and splat_data.count(old.data) == 70


def test_apply_moves_the_splats_and_keeps_the_mask(stipple, imported):
    before = read(stipple, imported)
    select(imported, box(size=0.9))
    bpy.ops.stipple.crop_by_box()
    kept = read(stipple, imported).positions
    matrix = Matrix.Translation((1, 0, 0)) @ Euler((0.2, 0.3, 0.4)).to_matrix().to_4x4() @ Matrix.Diagonal((1, 2, -1,
                                                                                                            1))
    imported.matrix_world = matrix
    scenes.select(imported)
    assert bpy.ops.stipple.apply_transform() == {'FINISHED'}
    assert imported.matrix_world == Matrix.Identity(4)
    m = np.array(matrix)
    np.testing.assert_allclose(read(stipple, imported).positions, kept @ m[:3, :3].T + m[:3, 3], atol=1e-5)
    assert bpy.ops.stipple.clear_mask() == {'FINISHED'}
    np.testing.assert_allclose(read(stipple, imported).positions, before.positions @ m[:3, :3].T + m[:3, 3], atol=1e-5)


def floor(stipple):
    rng = np.random.default_rng(5)
    arrays = make_arrays(stipple, count=2000, degree=0)
    arrays.scales[:], arrays.opacities[:] = 0.02, 0.9
    arrays.positions[:1500] = rng.uniform(-2, 2, (1500, 3)) * (1, 1, 0)
    arrays.positions[1500:] = rng.uniform(-1, 1, (500, 3)) * (1, 1, 0.5) + (0, 0, 0.6)
    return arrays


def test_level_to_ground_finds_the_floor_and_moves_what_is_selected(stipple, tmp_path):
    obj = import_arrays(stipple, tmp_path, floor(stipple))
    camera, child = scenes.camera((1, 2, 3)), scenes.link(bpy.data.objects.new('child', None))
    child.parent = obj
    tilt = Matrix.Translation((0, 0, 7)) @ Euler((0.3, -0.2, 1.0)).to_matrix().to_4x4()
    for moved in (obj, camera):
        moved.matrix_world = tilt @ moved.matrix_world
    bpy.context.view_layer.update()
    between = camera.matrix_world.inverted() @ obj.matrix_world
    scenes.select(obj, camera, child)
    assert bpy.ops.stipple.level_to_ground() == {'FINISHED'}
    bpy.context.view_layer.update()
    m = np.array(obj.matrix_world)
    # Strangers within 0.5 % of the extent of the floor's height pull it a little.
    np.testing.assert_allclose(m[2, :3], (0, 0, 1), atol=2e-3)
    assert abs(m[2, 3]) < 5e-3
    np.testing.assert_allclose(np.array(camera.matrix_world.inverted() @ obj.matrix_world), np.array(between),
                               atol=1e-5)
    np.testing.assert_allclose(np.array(child.matrix_world), m, atol=1e-6)


def test_level_to_three_points_and_set_scale(stipple, imported):
    scenes.select(imported)
    points = [1, 0, 1, 0, 1, 2, -1, 0, 1]
    assert bpy.ops.stipple.level_to_ground(use_points=True, points=points) == {'FINISHED'}
    m = np.array(imported.matrix_world)
    world = np.array(points).reshape(3, 3) @ m[:3, :3].T + m[:3, 3]
    np.testing.assert_allclose(world[:, 2], 0, atol=1e-6)
    assert bpy.ops.stipple.set_scale(points=world[:2].reshape(-1).tolist(), length=3.0) == {'FINISHED'}
    m = np.array(imported.matrix_world)
    world = np.array(points).reshape(3, 3) @ m[:3, :3].T + m[:3, 3]
    assert np.linalg.norm(world[1] - world[0]) == pytest.approx(3.0, rel=1e-5)


def test_a_click_finds_the_surface(stipple, tmp_path):
    arrays = floor(stipple)
    arrays.positions[1500:] += (0, 0, 100)  # behind the camera
    arrays.scales[:] = 0.1
    obj = import_arrays(stipple, tmp_path, arrays)
    camera = scenes.camera((0.3, 0.2, 5), width=64, height=48)
    bpy.context.view_layer.update()
    render = bpy.context.scene.render
    native = stipple.scene.view.cameras.camera_of(camera, render)
    cloud = stipple.scene.source.sources.cloud_from_object(obj)
    point = stipple.scene.view.picking.point_of_pixel([(cloud, np.eye(4))], native, 32.0, 24.0)
    # Straight down from the camera; the layer of splats is 0.1 thick.
    np.testing.assert_allclose(point, (0.3, 0.2, 0), atol=0.05)
    far = stipple.scene.view.cameras.camera_of(camera, render)
    with pytest.raises(stipple.binding.errors.StippleError, match='no solid splats'):
        stipple.scene.view.picking.point_of_pixel([], far, 0.5, 0.5)


@pytest.mark.parametrize('operator', ['crop_by_box', 'crop_by_mesh', 'delete_floaters', 'merge_splats'])
def test_nothing_else_selected(stipple, imported, operator):
    scenes.select(imported)
    text = {'crop_by_box': 'No box', 'crop_by_mesh': 'No mesh', 'merge_splats': 'at least two'}.get(operator)
    if text is None:
        scenes.refuses(lambda: bpy.ops.stipple.delete_floaters(by_opacity=False, by_size=False, by_connectivity=False),
                       'No kind of floater')
    else:
        scenes.refuses(getattr(bpy.ops.stipple, operator), text)


def test_an_empty_result_is_refused_and_nothing_changes(stipple, imported):
    select(imported, box((50, 0, 0)))
    scenes.refuses(bpy.ops.stipple.crop_by_box, 'at least one has to')
    assert stipple.scene.source.splat_data.count(imported.data) == 500
    flat = scenes.quad()
    select(imported, flat)
    scenes.refuses(bpy.ops.stipple.crop_by_box, "The box of 'Quad' is flat")


def test_splats_of_meshes_and_edited_ones_say_what_to_do(stipple, tmp_path):
    obj = scenes.make_splats(scenes.quad(), anchors=100, source_path=str(tmp_path / 'a.stipple.safetensors'))
    select(obj, box())
    scenes.refuses(bpy.ops.stipple.crop_by_box, 'made from meshes')
    scenes.select(obj)
    bpy.ops.stipple.use_as_new_source()
    select(obj, box((0.5, 0, 0), size=0.5))
    assert bpy.ops.stipple.crop_by_box() == {'FINISHED'}
    collection, field = (obj.data.vertices, 'co') if obj.type == 'MESH' else (obj.data.attributes['position'].data,
                                                                              'vector')
    values = np.empty(len(collection) * 3, np.float32)
    collection.foreach_get(field, values)
    collection.foreach_set(field, values + 1)
    obj.data.update_tag()
    scenes.refuses(bpy.ops.stipple.crop_by_box, 'edited by hand')


def test_a_missing_source_leaves_the_mask_as_it_was(stipple, imported, tmp_path):
    select(imported, box(size=0.9))
    bpy.ops.stipple.crop_by_box()
    kept = stipple.scene.source.splat_data.count(imported.data)
    (tmp_path / 'in.ply').unlink()
    scenes.refuses(bpy.ops.stipple.clear_mask, 'in.ply')
    assert stipple.scene.source.masks.counts(imported.data)[1] == kept
    assert stipple.scene.source.splat_data.count(imported.data) == kept
