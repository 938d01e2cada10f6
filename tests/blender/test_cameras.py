# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras against Blender's own projection."""

import itertools

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Euler, Vector

# Share of the picture's side. Blender projects in single floats; at these distances and lenses that leaves 1e-5.
TOLERANCE = 1e-4
POINTS = np.random.default_rng(7).uniform(-2, 2, (40, 3))


def make_camera(**settings):
    camera = bpy.data.cameras.new('camera')
    for name, value in settings.items():
        setattr(camera, name, value)
    obj = bpy.data.objects.new('camera', camera)
    obj.location = (3.0, -7.0, 4.0)
    obj.rotation_euler = Euler((1.05, 0.2, 0.45))
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.scene.camera = obj
    bpy.context.view_layer.update()
    return obj


def project(camera, points):
    """Shares of the picture from the bottom left, and depths, by the definition in stipple.h."""
    matrix = np.array(camera.world_to_camera).reshape(4, 4)
    local = points @ matrix[:3, :3].T + matrix[:3, 3]
    z = local[:, 2] if camera.model == 0 else np.ones(len(points))
    x = camera.fx * local[:, 0] / z + camera.cx
    y = camera.fy * local[:, 1] / z + camera.cy
    return np.stack([x / camera.width, 1 - y / camera.height, local[:, 2]], 1)


def blender_project(obj, points):
    return np.array([world_to_camera_view(bpy.context.scene, obj, Vector(p)) for p in points])


def set_render(width, height, aspect_x=1.0, aspect_y=1.0):
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    render.pixel_aspect_x, render.pixel_aspect_y = aspect_x, aspect_y
    return render


@pytest.mark.parametrize('kind,fit,size,aspect,shift', list(itertools.product(
    ('PERSP', 'ORTHO'), ('AUTO', 'HORIZONTAL', 'VERTICAL'), ((320, 180), (200, 300)),
    ((1.0, 1.0), (1.0, 1.5), (2.0, 1.0)), ((0.0, 0.0), (0.3, -0.2)))))
def test_projection_equals_blenders(stipple, kind, fit, size, aspect, shift):
    obj = make_camera(type=kind, sensor_fit=fit, sensor_width=36.0, sensor_height=20.0, lens=42.0, ortho_scale=7.0,
                      shift_x=shift[0], shift_y=shift[1])
    render = set_render(*size, *aspect)
    camera = stipple.scene.view.cameras.camera_of(obj, render)
    assert (camera.width, camera.height) == size
    np.testing.assert_allclose(project(camera, POINTS), blender_project(obj, POINTS), atol=TOLERANCE, rtol=0)


def test_a_moved_camera_does_not_pass(stipple):
    """The comparison above can fail."""
    obj = make_camera()
    camera = stipple.scene.view.cameras.camera_of(obj, set_render(320, 180))
    obj.location.x += 0.01
    bpy.context.view_layer.update()
    assert np.abs(project(camera, POINTS) - blender_project(obj, POINTS)).max() > TOLERANCE


def test_scale_of_the_camera_object_changes_nothing(stipple):
    obj = make_camera()
    obj.scale = (2.0, 0.5, 3.0)
    bpy.context.view_layer.update()
    camera = stipple.scene.view.cameras.camera_of(obj, set_render(320, 180))
    obj.scale = (1.0, 1.0, 1.0)
    bpy.context.view_layer.update()
    np.testing.assert_allclose(project(camera, POINTS), blender_project(obj, POINTS), atol=TOLERANCE, rtol=0)


def test_border_is_a_window_of_the_whole_picture(stipple):
    obj = make_camera(shift_x=0.1)
    render = set_render(320, 180)
    whole = stipple.scene.view.cameras.camera_of(obj, render)
    border = stipple.scene.view.facts.Border(40, 30, 100, 60)
    part = stipple.scene.view.cameras.camera_of(obj, render, border)
    a, b = project(whole, POINTS), project(part, POINTS)
    np.testing.assert_allclose(b[:, 0] * 100 + 40, a[:, 0] * 320, atol=1e-9)
    np.testing.assert_allclose(b[:, 1] * 60 + 30, a[:, 1] * 180, atol=1e-9)


def test_resolution_percentage_truncates_as_blender_does(stipple):
    render = set_render(333, 101)
    render.resolution_percentage = 50
    assert stipple.scene.view.facts.picture_size(render) == (166, 50)


def test_an_unknown_panorama_is_one_clear_error(stipple):
    obj = make_camera(type='PANO')
    stipple.version.panorama_settings(obj.data).panorama_type = 'MIRRORBALL'
    with pytest.raises(Exception,
                       match=r"Panoramic camera 'camera' is of type MIRRORBALL; allowed are EQUIRECTANGULAR"):
        stipple.scene.view.cameras.camera_of(obj, set_render(64, 64))


def test_missing_camera_is_one_clear_error(stipple):
    with pytest.raises(Exception, match='has no camera'):
        stipple.scene.view.cameras.camera_of(None, set_render(64, 64))
