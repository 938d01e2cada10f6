# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras of photo data sets as Blender cameras, with their images behind them."""

import os

import bpy
import numpy as np
from mathutils import Matrix

from ... import binding
from ...binding import structs
from ...binding.errors import StippleError
from ..sequence import frames

UP_AXES = (('AUTO', "From Format", "Z of transforms.json, -Y of COLMAP"), ('Z', "Z Up", "As in Blender"),
           ('-Y', "-Y Up", "As most captured scenes: the frame of their first camera"),
           ('Y', "Y Up", "As in glTF and most game engines"))
SENSOR_WIDTH = 36.0  # mm, Blender's own
_TRANSFORMS = ('transforms.json', 'transforms_train.json')
_OPENCV_TO_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
# Pixels that are less square than this cannot be shown: a Blender camera has square ones.
SQUARE_TOLERANCE = 0.01


def frame_of(path):
    """Which way the axes of a data set's world point, by custom: that of transforms.json is Blender's, COLMAP's that of
    its first camera."""
    is_transforms = path.lower().endswith('.json') or any(os.path.isfile(os.path.join(path, n)) for n in _TRANSFORMS)
    return frames.WORLD if is_transforms else structs.Frame.RDF


def chosen_frame(path, up_axis):
    """The same, or what an item of UP_AXES says."""
    return frame_of(path) if up_axis == 'AUTO' else frames.UP_AXES[up_axis]


def open_views(context, path):
    """(views, None), or, where images are missing, (cameras alone, the error)."""
    try:
        return binding.views.Views.open(context, path), None
    except StippleError as error:
        try:
            return binding.views.Views.load(context, path), error
        except StippleError:
            raise error from None


def add(views, collection, to_world, with_backgrounds):
    """Links an object for each view to a collection. Returns the objects."""
    cameras = [views.camera(i) for i in range(len(views))]
    matrices = [to_world @ np.linalg.inv(np.array(camera.world_to_camera).reshape(4, 4)) @ _OPENCV_TO_OPENGL
                for camera in cameras]
    size = _display_size(matrices)
    objects = []
    for i, (camera, matrix) in enumerate(zip(cameras, matrices)):
        info = views.view_info(i)
        data = bpy.data.cameras.new(os.path.basename(info.name.decode()))
        set_optics(data, camera)
        data.display_size = size
        if with_backgrounds and info.image_path:
            _add_background(data, info.image_path.decode())
        obj = bpy.data.objects.new(data.name, data)
        obj.matrix_world = Matrix(matrix.tolist())
        collection.objects.link(obj)
        objects.append(obj)
    return objects


def set_optics(data, camera):
    """The inverse of cameras.from_parts() for an image of the camera's proportions with square pixels. Sizes of 0, of
    cameras whose images are not known, count as those of a square."""
    width, height = camera.width or 1, camera.height or 1
    cx, cy = (camera.cx, camera.cy) if camera.width else (0.5, 0.5)
    data.sensor_fit = 'HORIZONTAL'
    data.sensor_width = SENSOR_WIDTH
    if camera.model == structs.CameraModel.ORTHOGRAPHIC:
        data.type = 'ORTHO'
        data.ortho_scale = width / camera.fx
    else:
        data.lens = camera.fx / width * SENSOR_WIDTH
    data.shift_x = (0.5 * width - cx) / width
    data.shift_y = (cy - 0.5 * height) / width


def are_square(camera):
    return abs(camera.fx / camera.fy - 1) <= SQUARE_TOLERANCE


def _add_background(data, path):
    data.show_background_images = True
    background = data.background_images.new()
    background.image = bpy.data.images.load(path, check_existing=True)
    background.frame_method = 'FIT'
    background.alpha = 1.0


def _display_size(matrices):
    """A fraction of the room that the cameras take up; Blender's own where there is one."""
    places = np.array([matrix[:3, 3] for matrix in matrices])
    extent = float(np.linalg.norm(places.max(0) - places.min(0)))
    return extent / 30 if extent > 0 else 1.0
