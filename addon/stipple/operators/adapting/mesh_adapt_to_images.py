# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh takes the shape that images of a data set show and keeps its faces."""

import os
from dataclasses import replace

import bpy
import numpy as np
from bpy.props import EnumProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from ... import binding
from ...scene.sequence import frames
from ...scene.source import sources
from ...scene.view import photo_cameras
from .adapting_to_views import AdaptToViewsOperator


class STIPPLE_OT_mesh_adapt_to_images(AdaptToViewsOperator, bpy.types.Operator, ImportHelper):
    """Give the active mesh the shape of an object in images by moving its vertices. The images need cameras, and
    transparency or masks around the object. Faces, UV maps, weights and materials stay. Esc keeps the shape so far"""

    bl_idname = 'stipple.mesh_adapt_to_images'
    bl_label = "Adapt Mesh to Images"
    bl_options = {'REGISTER', 'UNDO', 'PRESET'}

    filename_ext = '.json'
    filter_glob: StringProperty(default='*.json;cameras.bin;cameras.txt;images.bin;images.txt', options={'HIDDEN'})
    up_axis: EnumProperty(name="Up Axis", description="The up direction of the data set; choose the same for its "
                                                      "cameras", items=photo_cameras.UP_AXES)

    def invoke(self, context, event):
        self._asked = True
        return ImportHelper.invoke(self, context, event)

    def start(self, context):
        path = bpy.path.abspath(self.filepath)
        views = binding.views.Views.open(sources.context(), path)
        self._images_name = os.path.basename(os.path.normpath(path if os.path.isdir(path) else os.path.dirname(path)))
        self._begin(context.view_layer.objects.active, f'Adapted to {self._images_name}')
        to_images = np.linalg.inv(frames.to_world(photo_cameras.chosen_frame(path, self.up_axis)))
        self._template = replace(self._template, matrix=to_images @ self._template.matrix)
        return self._start_by_views(views)

    def draw(self, _context):
        self._draw(('result', 'density', 'strength', 'smoothness', 'steps', 'image_size', 'drawing', 'alignment',
                    'up_axis', 'preview'))

    def _tell(self, _context, report):
        self._say_difference(f"the images of '{self._images_name}'", report)


classes = (STIPPLE_OT_mesh_adapt_to_images,)
