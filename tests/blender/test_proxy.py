# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes of splats: closed, where the splats are, and what the messages say."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

import scenes


@pytest.fixture
def splats(tmp_path):
    """A sphere of radius 1 in 3,000 splats."""
    ball = scenes.sphere()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    obj = scenes.make_splats(ball, anchors=3000)
    bpy.data.objects.remove(ball)
    return obj


def mesh_of(obj, **settings):
    scenes.select(obj)
    settings.setdefault('resolution', 48)
    assert bpy.ops.stipple.splats_to_mesh(**settings) == {'FINISHED'}
    return bpy.context.object


def world(obj):
    points = np.empty(len(obj.data.vertices) * 3, np.float32)
    obj.data.vertices.foreach_get('co', points)
    matrix = np.array(obj.matrix_world)
    return points.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]


def check_closed(mesh):
    """Every edge has two faces that run against each other."""
    seen = {}
    for polygon in mesh.polygons:
        corners = list(polygon.vertices)
        for a, b in zip(corners, corners[1:] + corners[:1]):
            assert (a, b) not in seen
            seen[a, b] = True
    assert all((b, a) in seen for a, b in seen)
    return len(mesh.vertices) - len(seen) // 2 + len(mesh.polygons)


def volume_of(obj):
    """Of the mesh in its own space: Blender turns the faces of mirrored objects itself."""
    points, total = np.array([v.co for v in obj.data.vertices], np.float64), 0.0
    for polygon in obj.data.polygons:
        a, b, c = points[list(polygon.vertices)]
        total += np.dot(a, np.cross(b, c)) / 6
    return total


@pytest.mark.parametrize('scale', [(1.0, 1.0, 1.0), (2.0, 0.5, 1.0), (-1.0, 1.0, 1.0)])
def test_mesh_is_closed_and_lies_where_the_splats_are(splats, scale):
    splats.matrix_world = Matrix.Translation((1000.0, -2000.0, 50.0)) @ Matrix.Rotation(0.7, 4, 'X') @ Matrix.Diagonal(
        (*scale, 1.0))
    proxy = mesh_of(splats)
    assert check_closed(proxy.data) == 2
    np.testing.assert_allclose(np.array(proxy.matrix_world), np.array(splats.matrix_world), atol=1e-6)
    # In its own space the sphere of radius 1, up to two voxels of 2.2 / 48 of the longest side.
    radii = np.linalg.norm([v.co for v in proxy.data.vertices], axis=1)
    voxel = 2.3 * max(map(abs, scale)) / 48
    assert (np.abs(radii - 1) < 2 * voxel / min(map(abs, scale))).all()
    assert volume_of(proxy) > 0


def test_voxel_size_is_in_metres_of_the_world(splats):
    splats.scale = (2.0, 2.0, 2.0)
    fine, coarse = mesh_of(splats, voxel_size=0.1), mesh_of(splats, voxel_size=0.2)
    assert 3 < len(fine.data.polygons) / len(coarse.data.polygons) < 5


def test_purposes(splats):
    plain = mesh_of(splats)
    assert not plain.is_shadow_catcher and plain.visible_camera and not plain.hide_render
    catcher = mesh_of(splats, purpose='CATCHER')
    assert catcher.is_shadow_catcher and catcher.display_type == 'WIRE'
    assert not mesh_of(splats, purpose='CASTER').visible_camera
    assert mesh_of(splats, purpose='HIDDEN').hide_render


def test_tooltip_says_what_it_is_not():
    description = bpy.ops.stipple.splats_to_mesh.get_rna_type().description
    assert 'not a textured reconstruction' in description


def test_largest_piece_leaves_hollows_out(splats):
    whole = mesh_of(splats, largest_only=False)
    assert check_closed(whole.data) == 4
    assert check_closed(mesh_of(splats).data) == 2


def test_several_objects_become_one_mesh_at_the_active_one(splats):
    other = scenes.link(bpy.data.objects.new('other', splats.data))
    other.location = (3.0, 0.0, 0.0)
    bpy.context.view_layer.update()
    scenes.select(splats, other)
    assert bpy.ops.stipple.splats_to_mesh(resolution=64, largest_only=False) == {'FINISHED'}
    points = world(bpy.context.object)
    assert points[:, 0].min() < -0.9 and points[:, 0].max() > 3.9


def test_what_cannot_be_made_says_why_and_leaves_everything(splats):
    count = len(bpy.data.objects)
    splats.scale = (0.0, 1.0, 1.0)
    bpy.context.view_layer.update()
    scenes.select(splats)
    scenes.refuses(bpy.ops.stipple.splats_to_mesh, 'scaled to zero')
    splats.scale = (1.0, 1.0, 1.0)
    splats.data.stipple.grade_opacity = 0.05
    bpy.context.view_layer.update()
    scenes.refuses(lambda: bpy.ops.stipple.splats_to_mesh(threshold=0.99, resolution=32), 'the densest has')
    splats.data.stipple.grade_opacity = 0.0
    scenes.refuses(lambda: bpy.ops.stipple.splats_to_mesh(voxel_size=0.1), 'the volume is empty')
    assert len(bpy.data.objects) == count


def test_shadows_fall_on_a_catcher(splats, tmp_path):
    """Cycles: a card between the sun and the ball darkens the ball's catcher."""
    catcher = mesh_of(splats, purpose='CATCHER')
    splats.hide_render = True
    card = scenes.quad('Card', 0.8, (0.0, 0.0, 2.0))
    sun = scenes.link(bpy.data.objects.new('Sun', bpy.data.lights.new('Sun', 'SUN')))
    sun.data.energy, sun.data.angle = 3.0, 0.0
    camera = scenes.camera((0.0, -6.0, 3.0), (1.1071, 0.0, 0.0), width=48, height=48)
    camera.data.lens = 60
    scene = bpy.context.scene
    scene.render.engine, scene.render.film_transparent = 'CYCLES', True
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.max_bounces = 16, False, 1
    card.visible_camera = False
    alpha = scenes.render_pixels(tmp_path)[..., 3]
    assert alpha.max() > 0.5      # the shadow
    assert np.median(alpha) < 0.05
    catcher.hide_render = True
    assert scenes.render_pixels(tmp_path, 'none')[..., 3].max() == 0
