# SPDX-License-Identifier: GPL-3.0-or-later
"""Add Shadow Catcher: where the plane and the mesh lie, what is set, and shadows in a render right after it."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

import scenes
from shots import prepare, splat_wall


def ground(stipple, tilt=0.2, side=4.0):
    """A floor of splats that is tilted and somewhere else."""
    floor = splat_wall(stipple, 'floor', 0.0, side=side, colour=(0.5, 0.5, 0.5), count=80)
    floor.matrix_world = Matrix.Translation((10.0, 20.0, 3.0)) @ Matrix.Rotation(tilt, 4, 'X')
    bpy.context.view_layer.update()
    scenes.select(floor)
    return floor


def add(*objects, **settings):
    if objects:
        scenes.select(*objects)
    assert bpy.ops.stipple.add_shadow_catcher(**settings) == {'FINISHED'}
    return bpy.context.object


def corners(obj):
    bpy.context.view_layer.update()
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    points = np.array([vertex.co for vertex in evaluated.data.vertices])
    matrix = np.array(evaluated.matrix_world)
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def test_the_plane_lies_in_the_ground_and_is_as_large(stipple):
    floor = ground(stipple)
    plane = add(extend=0.1)
    local = (np.column_stack([corners(plane), np.ones(4)]) @ np.linalg.inv(np.array(floor.matrix_world)).T)[:, :3]
    np.testing.assert_allclose(local[:, 2], 0.0, atol=2e-3)
    # The middle 98 % of 4 m, and a tenth more.
    np.testing.assert_allclose(np.abs(local[:, :2]), 0.98 * 2.2, atol=0.06)
    normal = np.cross(local[1] - local[0], local[2] - local[0])
    assert normal[2] > 0


@pytest.mark.parametrize('kind', ['PLANE', 'MESH'])
def test_what_is_made_is_a_catcher_that_moves_along(stipple, kind):
    floor = ground(stipple)
    catcher = add(kind=kind, resolution=32)
    assert catcher.name == 'floor Shadow Catcher' and catcher.type == 'MESH'
    assert catcher.is_shadow_catcher and catcher.visible_camera and not catcher.hide_render
    assert catcher.display_type == 'WIRE' and catcher.parent == floor
    assert catcher.select_get() and not floor.select_get()
    before = corners(catcher)
    floor.location.x += 5.0
    np.testing.assert_allclose(corners(catcher), before + (5.0, 0.0, 0.0), atol=1e-4)


@pytest.mark.parametrize('scale', [(1.0, 1.0, 1.0), (2.0, 2.0, 2.0), (-1.0, 1.0, 1.0)])
def test_the_mesh_lies_below_the_surface(stipple, scale):
    ball = scenes.sphere()
    splats = scenes.make_splats(ball, anchors=3000)
    splats.scale = scale
    bpy.context.view_layer.update()
    on_it, below = (add(splats, kind='MESH', resolution=48, inset=inset) for inset in (0.0, 2.0))
    voxel = 2.3 * abs(scale[0]) / 48
    radii = [np.linalg.norm(corners(obj), axis=1).mean() for obj in (on_it, below)]
    assert abs(radii[0] - abs(scale[0])) < 2 * voxel
    assert abs(radii[0] - radii[1] - 2 * voxel) < 0.3 * voxel
    assert all(polygon.use_smooth for polygon in below.data.polygons)


def test_several_objects_have_one_plane(stipple):
    floor = ground(stipple, tilt=0.0)
    other = scenes.link(bpy.data.objects.new('other', floor.data))
    other.location = (16.0, 20.0, 3.0)
    bpy.context.view_layer.update()
    points = corners(add(floor, other))
    np.testing.assert_allclose(points[:, 2], 3.0, atol=2e-3)
    assert points[:, 0].min() < 8.1 and points[:, 0].max() > 17.9


def test_floaters_do_not_make_it_larger(stipple):
    floor = ground(stipple, tilt=0.0)
    arrays = stipple.scene.source.splat_data.read(floor.data)
    arrays.positions[::200, 0] = 1000.0
    stipple.scene.source.splat_data.write(floor.data, arrays)
    assert np.ptp(corners(add(floor))[:, 0]) < 5.0


def test_the_margin_is_no_less_than_the_catcher_needs(stipple):
    floor = ground(stipple, side=400.0)
    scene = bpy.context.scene
    scene.stipple.shadow_margin = 0.5
    add(floor, kind='MESH', resolution=32, inset=1.0)
    assert 4 * 400 / 34 < scene.stipple.shadow_margin < 4 * 400 / 28
    kept = scene.stipple.shadow_margin
    add(floor, kind='MESH', resolution=128)
    assert scene.stipple.shadow_margin == kept


@pytest.mark.parametrize('kind', ['PLANE', 'MESH'])
def test_a_character_casts_its_shadow_at_once(stipple, tmp_path, kind):
    """One click, 24 samples, and no pixel that the shadow does not reach is another than before."""
    floor = splat_wall(stipple, 'floor', 0.0, side=4.0, colour=(0.5, 0.5, 0.5), count=80)
    ball = scenes.sphere(radius=0.4)
    ball.location.z = 0.9
    sun = scenes.link(bpy.data.objects.new('sun', bpy.data.lights.new('sun', 'SUN')))
    sun.data.energy, sun.data.angle, sun.rotation_euler = 3.0, 0.0, (0.0, 0.7, 0.0)
    scenes.camera((0, 0, 6), width=60, height=60, type='ORTHO', ortho_scale=5.0)
    prepare('STIPPLE_CYCLES', True, 24)
    before = scenes.render_pixels(tmp_path, 'before')
    add(floor, kind=kind, resolution=64)
    after = scenes.render_pixels(tmp_path, 'after')
    shadow = np.s_[28:32, 30 - round(0.9 * np.tan(0.7) * 12) - 2:30 - round(0.9 * np.tan(0.7) * 12) + 2]
    assert after[shadow][..., :3].max() < 0.15 * before[shadow][..., :3].min()
    # Beyond it, the ball's light alone falls on the floor: some hundredths.
    assert np.abs(after - before)[:, 45:].max() < 0.1 and np.abs(after - before)[:8].max() < 0.1
    np.testing.assert_allclose(after[..., 3], before[..., 3], atol=0.02)


def test_what_cannot_be_made_says_why_and_leaves_everything(stipple):
    floor = ground(stipple)
    count = len(bpy.data.objects)
    floor.scale = (0.0, 1.0, 1.0)
    bpy.context.view_layer.update()
    scenes.refuses(bpy.ops.stipple.add_shadow_catcher, 'scaled to zero')
    floor.scale, floor.rotation_euler = (1.0, 1.0, 1.0), (1.5708, 0.0, 0.0)  # a wall and no ground
    bpy.context.view_layer.update()
    scenes.refuses(bpy.ops.stipple.add_shadow_catcher, 'no plane within 45')
    assert len(bpy.data.objects) == count and bpy.context.object == floor


def test_nothing_selected_is_no_operator(stipple):
    scenes.select(scenes.quad())
    assert not bpy.ops.stipple.add_shadow_catcher.poll()
