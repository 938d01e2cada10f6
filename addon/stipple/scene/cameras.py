# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender cameras as StippleCamera.

Blender: OpenGL frame (y up, looks along -z), lens over sensor, shift in units of the fitted side.
Stipple: OpenCV frame (y down, looks along +z), intrinsics in pixels from the top left corner.
"""

from ctypes import c_double

import numpy as np

from ..binding.errors import StippleError
from ..binding.structs import CameraModel, Status, StippleCamera
from .facts import Border, picture_size

_OPENGL_TO_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])


def camera_of(camera_object, render, border=None):
    """The camera of a render, over the whole picture or a pixel border of it.

    Errors: StippleError for a missing camera and for panoramic or custom ones.
    """
    if camera_object is None or camera_object.type != 'CAMERA':
        raise StippleError('The scene has no camera; a perspective or orthographic camera is needed to render.',
                           Status.ERROR_INVALID_ARGUMENT)
    width, height = picture_size(render)
    return from_parts(camera_object.data, camera_object.matrix_world, width, height, render.pixel_aspect_x,
                      render.pixel_aspect_y, border, camera_object.name)


def from_parts(camera, matrix_world, width, height, aspect_x=1.0, aspect_y=1.0, border=None, name=''):
    """The same from a camera datablock, its matrix and a picture size in pixels."""
    if camera.type not in {'PERSP', 'ORTHO'}:
        raise StippleError(f"Camera '{name or camera.name}' is of type {camera.type}; allowed are perspective and "
                           'orthographic cameras.', Status.ERROR_UNSUPPORTED)
    # Blender measures in units of a pixel's width: a pixel is `pixel_height` of them high.
    pixel_height = aspect_y / aspect_x
    fit = camera.sensor_fit
    if fit == 'AUTO':
        fitted_side = 'HORIZONTAL' if aspect_x * width >= aspect_y * height else 'VERTICAL'
    else:
        fitted_side = fit
    fitted = width if fitted_side == 'HORIZONTAL' else pixel_height * height
    if camera.type == 'PERSP':
        # With the fit AUTO the sensor's width goes along whichever side is longer.
        sensor = camera.sensor_height if fit == 'VERTICAL' else camera.sensor_width
        focal = camera.lens / sensor * fitted
        model = CameraModel.PERSPECTIVE
    else:
        focal = fitted / camera.ortho_scale
        model = CameraModel.ORTHOGRAPHIC
    cx = 0.5 * width - camera.shift_x * fitted
    cy = 0.5 * height + camera.shift_y * fitted / pixel_height
    if border is None:
        border = Border(0, 0, width, height)
    result = StippleCamera(model=int(model), width=border.width, height=border.height, fx=focal, fy=focal / pixel_height,
                           cx=cx - border.x, cy=cy - (height - border.y - border.height),
                           world_to_camera=(c_double * 16)(*world_to_camera(matrix_world).reshape(16)),
                           near_plane=camera.clip_start, far_plane=camera.clip_end)
    return result


def from_view(region_data, width, height):
    """The camera of a 3D view, at a picture size that has the view's proportions."""
    window = np.array(region_data.window_matrix, np.float64)
    view = np.array(region_data.view_matrix, np.float64)
    perspective = window[3, 2] != 0
    fx, fy = window[0, 0] * width / 2, window[1, 1] * height / 2
    if perspective:
        # x/w = (m00 x + m02 z) / -z: the third column moves the centre.
        cx, cy = (1 - window[0, 2]) * width / 2, (1 + window[1, 2]) * height / 2
        near = window[2, 3] / (window[2, 2] - 1)
        far = window[2, 3] / (window[2, 2] + 1)
    else:
        cx, cy = (1 + window[0, 3]) * width / 2, (1 - window[1, 3]) * height / 2
        near = (window[2, 3] + 1) / window[2, 2]
        far = (window[2, 3] - 1) / window[2, 2]
        back = step_back(window)
        view = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -back], [0, 0, 0, 1]]) @ view
        near, far = near + back, far + back
    model = CameraModel.PERSPECTIVE if perspective else CameraModel.ORTHOGRAPHIC
    return StippleCamera(model=int(model), width=width, height=height, fx=fx, fy=fy, cx=cx, cy=cy,
                         world_to_camera=(c_double * 16)(*(_OPENGL_TO_OPENCV @ view).reshape(16)), near_plane=near,
                         far_plane=far)


def step_back(window_matrix):
    """Metres by which from_view() stands behind a view: an orthographic one also sees what is behind its centre."""
    window = np.array(window_matrix, np.float64)
    return 0.0 if window[3, 2] != 0 else max(0.0, 1.0 - (window[2, 3] + 1) / window[2, 2])


def world_to_camera(matrix_world):
    """[4,4] rigid; a camera's scale does not change its picture."""
    matrix = np.array(matrix_world, np.float64)
    axes = matrix[:3, :3]
    matrix[:3, :3] = axes / np.linalg.norm(axes, axis=0)
    return _OPENGL_TO_OPENCV @ np.linalg.inv(matrix)
