# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender cameras as StippleCamera.

Blender: OpenGL frame (y up, looks along -z), lens over sensor, shift in units of the fitted side.
Stipple: OpenCV frame (y down, looks along +z), intrinsics in pixels from the top left corner.
"""

from ctypes import c_double

import numpy as np

from ... import version
from ...binding.errors import StippleError
from ...binding.structs import CameraModel, Status, StippleCamera
from .facts import Border, picture_size

_OPENGL_TO_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])


def camera_of(camera_object, render, border=None):
    """The camera of a render, over the whole image or a pixel border of it.

    Errors: StippleError for a missing camera and for those that have no model here.
    """
    required(camera_object)
    width, height = picture_size(render)
    return from_parts(camera_object.data, camera_object.matrix_world, width, height, render.pixel_aspect_x,
                      render.pixel_aspect_y, border, camera_object.name)


def required(camera_object):
    """The object itself. Errors: StippleError where it is none, or no camera."""
    if camera_object is None or camera_object.type != 'CAMERA':
        raise StippleError('The scene has no camera; a perspective or orthographic camera is needed to render.',
                           Status.ERROR_INVALID_ARGUMENT)
    return camera_object


def from_parts(camera, matrix_world, width, height, aspect_x=1.0, aspect_y=1.0, border=None, name=''):
    """The same from a camera datablock, its matrix and an image size in pixels."""
    if camera.type == 'PANO':
        return _panorama(camera, matrix_world, width, height, aspect_x, aspect_y, border, name or camera.name)
    if camera.type not in {'PERSP', 'ORTHO'}:
        raise StippleError(f"Camera '{name or camera.name}' is of type {camera.type}; allowed are perspective, "
                           'orthographic and panoramic cameras.', Status.ERROR_UNSUPPORTED)
    # Blender measures in units of a pixel's width: a pixel is `pixel_height` of them high.
    pixel_height = aspect_y / aspect_x
    fit, fitted_side = camera.sensor_fit, _fitted_side(camera, aspect_x * width, aspect_y * height)
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
    return _within(border, width, height, camera, matrix_world, model=int(model), fx=focal, fy=focal / pixel_height,
                   cx=cx, cy=cy)


def _within(border, width, height, camera, matrix_world, cx, cy, **given):
    """The StippleCamera of a border of an image, or of all of it."""
    if border is None:
        border = Border(0, 0, width, height)
    return StippleCamera(width=border.width, height=border.height, cx=cx - border.x,
                         cy=cy - (height - border.y - border.height),
                         world_to_camera=(c_double * 16)(*world_to_camera(matrix_world).reshape(16)),
                         near_plane=camera.clip_start, far_plane=camera.clip_end, **given)


def _fitted_side(camera, width, height):
    """The side of the image that the sensor's size is of."""
    if camera.sensor_fit == 'AUTO':
        return 'HORIZONTAL' if width >= height else 'VERTICAL'
    return camera.sensor_fit


def _panorama(camera, matrix_world, width, height, aspect_x, aspect_y, border, name):
    """Cycles' panoramas, which fill the image whatever its proportions are."""
    settings = version.panorama_settings(camera)
    kind = getattr(settings, 'panorama_type', None)
    if kind == 'EQUIRECTANGULAR':
        across, up = (settings.longitude_max - settings.longitude_min, settings.latitude_max - settings.latitude_min)
        if across <= 0 or up <= 0:
            raise StippleError(f"Panoramic camera '{name}' sees {np.degrees(across):g} by {np.degrees(up):g} degrees; "
                               'more than 0 is needed.', Status.ERROR_INVALID_ARGUMENT)
        fx, fy = width / across, height / up
        return _within(border, width, height, camera, matrix_world, model=int(CameraModel.EQUIRECTANGULAR), fx=fx,
                       fy=fy, cx=-settings.longitude_min * fx, cy=settings.latitude_max * fy)
    if kind == 'FISHEYE_EQUIDISTANT':
        return _within(border, width, height, camera, matrix_world, model=int(CameraModel.FISHEYE_EQUIDISTANT),
                       fx=width / settings.fisheye_fov, fy=height / settings.fisheye_fov, cx=0.5 * width,
                       cy=0.5 * height, field_of_view=_held_angle(settings.fisheye_fov, name))
    if kind == 'FISHEYE_EQUISOLID':
        # Millimetres of the sensor that the image's sides are of.
        wide, high = aspect_x * width, aspect_y * height
        if _fitted_side(camera, wide, high) == 'HORIZONTAL':
            sensor = camera.sensor_width, camera.sensor_width * high / wide
        else:
            side = camera.sensor_height if camera.sensor_fit == 'VERTICAL' else camera.sensor_width
            sensor = side * wide / high, side
        return _within(border, width, height, camera, matrix_world, model=int(CameraModel.FISHEYE_EQUISOLID),
                       fx=settings.fisheye_lens * width / sensor[0], fy=settings.fisheye_lens * height / sensor[1],
                       cx=0.5 * width, cy=0.5 * height, field_of_view=_held_angle(settings.fisheye_fov, name))
    raise StippleError(f"Panoramic camera '{name}' is of type {kind}; allowed are EQUIRECTANGULAR, FISHEYE_EQUIDISTANT "
                       'and FISHEYE_EQUISOLID.', Status.ERROR_UNSUPPORTED)


def _held_angle(angle, name):
    """A fisheye's field of view, radians. Errors: StippleError above a full circle: nothing is there twice."""
    # Blender keeps single precision.
    if angle > 2 * np.pi * (1 + 1e-6):
        raise StippleError(f"Fisheye camera '{name}' has a field of view of {np.degrees(angle):g} degrees; at most 360 "
                           f"are "
                           'allowed.', Status.ERROR_INVALID_ARGUMENT)
    return min(angle, 2 * np.pi)


def from_view(region_data, width, height):
    """The camera of a 3D view, at an image size that has the view's proportions."""
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


def view_border(context, region):
    """The rectangle of a 3D view's pixels that its render border leaves, from the bottom left corner; the whole region
    without one. The camera's view has the scene's border, others their own (Ctrl+B)."""
    whole = Border(0, 0, region.width, region.height)
    space, render = context.space_data, context.scene.render
    if context.region_data.view_perspective == 'CAMERA':
        if not render.use_border or space.camera is None:
            return whole
        frame = _camera_frame(context, region, space.camera)
        edges = render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y
    else:
        if not space.use_render_border:
            return whole
        frame = (0, region.width, 0, region.height)
        edges = (space.render_border_min_x, space.render_border_max_x, space.render_border_min_y,
                 space.render_border_max_y)
    x0, x1 = (frame[0] + edge * (frame[1] - frame[0]) for edge in edges[:2])
    y0, y1 = (frame[2] + edge * (frame[3] - frame[2]) for edge in edges[2:])
    x0, y0 = min(max(int(x0), 0), region.width - 1), min(max(int(y0), 0), region.height - 1)
    return Border(x0, y0, min(max(int(x1), x0 + 1), region.width) - x0, min(max(int(y1), y0 + 1), region.height) - y0)


def looked_through(context):
    """The original camera that a 3D view looks through, or None."""
    camera_object = context.space_data.camera
    is_camera = context.region_data.view_perspective == 'CAMERA' and camera_object is not None
    return camera_object if is_camera and camera_object.type == 'CAMERA' else None


def shows_panorama(space, region_data, engine):
    """Whether a 3D view shows what a panoramic camera sees: Blender's own shadings show a perspective instead."""
    camera = space.camera
    return (region_data.view_perspective == 'CAMERA' and camera is not None and camera.type == 'CAMERA'
            and camera.data.type == 'PANO' and space.shading.type == 'RENDERED'
            and engine not in {version.EEVEE_ENGINE, 'BLENDER_WORKBENCH'})


def panorama_of_view(context, region, camera_object, depsgraph):
    """(StippleCamera, Border) of a panoramic camera that a view looks through: over the region, as the image in the
    camera's frame goes on, and what of the region the image fills, or None where it lies outside.

    Errors: StippleError for types that have no model here.
    """
    left, right, bottom, top = (round(edge) for edge in _camera_frame(context, region, camera_object))
    # Before 5.0 panoramas are settings of Cycles', of which evaluated cameras are not told.
    camera = from_parts(camera_object.data, camera_object.evaluated_get(depsgraph).matrix_world, max(right - left, 1),
                        max(top - bottom, 1), name=camera_object.name)
    camera.cx += left
    camera.cy += region.height - top
    camera.width, camera.height = region.width, region.height
    border = view_border(context, region)
    x0, x1 = max(border.x, left), min(border.x + border.width, right)
    y0, y1 = max(border.y, bottom), min(border.y + border.height, top)
    return camera, Border(x0, y0, x1 - x0, y1 - y0) if x0 < x1 and y0 < y1 else None


def _camera_frame(context, region, camera_object):
    """(left, right, bottom, top) of the camera's image in the region's pixels."""
    matrix = np.array(camera_object.matrix_world.normalized(), np.float64)
    corners = np.ones((4, 4))
    corners[:, :3] = [tuple(corner) for corner in camera_object.data.view_frame(scene=context.scene)]
    clip = corners @ matrix.T @ np.array(context.region_data.perspective_matrix, np.float64).T
    x, y = (0.5 + 0.5 * clip[:, axis] / clip[:, 3] for axis in (0, 1))
    return (x.min() * region.width, x.max() * region.width, y.min() * region.height, y.max() * region.height)


def part_of(camera, border, coarse=1):
    """The camera of a part of its image, with one pixel for coarse x coarse of its own."""
    part = StippleCamera.from_buffer_copy(camera)
    part.width, part.height = max(border.width // coarse, 1), max(border.height // coarse, 1)
    x, y = part.width / border.width, part.height / border.height
    part.fx, part.fy = camera.fx * x, camera.fy * y
    part.cx = (camera.cx - border.x) * x
    part.cy = (camera.cy - (camera.height - border.y - border.height)) * y
    return part


def step_back(window_matrix):
    """Metres by which from_view() stands behind a view: an orthographic one also sees what is behind its centre."""
    window = np.array(window_matrix, np.float64)
    return 0.0 if window[3, 2] != 0 else max(0.0, 1.0 - (window[2, 3] + 1) / window[2, 2])


def world_to_camera(matrix_world):
    """[4,4] rigid; a camera's scale does not change its image."""
    matrix = np.array(matrix_world, np.float64)
    axes = matrix[:3, :3]
    matrix[:3, :3] = axes / np.linalg.norm(axes, axis=0)
    return _OPENGL_TO_OPENCV @ np.linalg.inv(matrix)
