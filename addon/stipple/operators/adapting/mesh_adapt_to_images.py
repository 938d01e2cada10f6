# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh takes the shape that images show and keeps its faces."""

import os
from dataclasses import replace

import bpy
import numpy as np
from bpy.props import EnumProperty, IntProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from ...binding.structs import MeshAlignment, MeshDensity, PictureDrawing
from ...binding.views import Views
from ...scene.sequence import frames
from ...scene.source import sources
from ...scene.view import photo_cameras
from .mesh_adapt import DENSITIES, AdaptOperator

_ALIGNMENTS = (('NONE', "None", "The mesh lies where the images show the object"),
               ('SIZE', "Location and Size", "The mesh gets the middle and the size of what the images show first"))
_DRAWINGS = (('TRIANGLES', "Triangles", "The mesh is drawn as it is, with sharp outlines"),
             ('SPLATS', "Splats", "The mesh is drawn as splats that follow its faces"))


class STIPPLE_OT_mesh_adapt_to_images(AdaptOperator, bpy.types.Operator, ImportHelper):
    """Give the active mesh the shape of an object in images by moving its vertices. The images need cameras, and
    transparency or masks around the object. Faces, UV maps, weights and materials stay. Esc keeps the shape so far"""

    bl_idname = 'stipple.mesh_adapt_to_images'
    bl_label = "Adapt Mesh to Images"
    bl_options = {'REGISTER', 'UNDO', 'PRESET'}

    filename_ext = '.json'
    filter_glob: StringProperty(default='*.json;cameras.bin;cameras.txt;images.bin;images.txt', options={'HIDDEN'})
    density: EnumProperty(name="Density", description="Where vertices go along the surface", items=DENSITIES,
                          default='OFF')
    alignment: EnumProperty(name="Alignment", description="What is done to the whole mesh first", items=_ALIGNMENTS)
    image_size: IntProperty(name="Image Size", description="Pixels of the longer side of the images that are compared. "
                            "Larger ones show finer detail, and take longer by the square", default=256, min=16,
                            max=4096, subtype='PIXEL')
    drawing: EnumProperty(name="Drawn As", description="What the mesh is drawn as to be compared with the images",
                          items=_DRAWINGS)
    up_axis: EnumProperty(name="Up Axis", description="The up direction of the data set; choose the same for its "
                                                      "cameras", items=photo_cameras.UP_AXES)

    _asked = False

    def execute(self, context):
        if bpy.app.background or not self._asked:
            return super().execute(context)
        return self.run_in_window(context)

    def invoke(self, context, event):
        self._asked = True
        return ImportHelper.invoke(self, context, event)

    def start(self, context):
        path = bpy.path.abspath(self.filepath)
        views = Views.open(sources.context(), path)
        self._images_name = os.path.basename(os.path.normpath(path if os.path.isdir(path) else os.path.dirname(path)))
        self._begin(context.view_layer.objects.active, f'Adapted to {self._images_name}')
        to_images = np.linalg.inv(frames.to_world(photo_cameras.chosen_frame(path, self.up_axis)))
        self._template = replace(self._template, matrix=to_images @ self._template.matrix)
        return self._start(views, density=MeshDensity[self.density], alignment=MeshAlignment[self.alignment],
                           picture_side=self.image_size, picture_drawing=PictureDrawing[self.drawing])

    def draw(self, _context):
        self._draw(('result', 'density', 'strength', 'smoothness', 'steps', 'image_size', 'drawing', 'alignment',
                    'up_axis', 'preview'))

    def _tell(self, _context, report):
        self.report({'INFO'}, f"'{self._template.name}' differed from the images of '{self._images_name}' by "
                    f'{report.picture_before:.2%} on average, and differs by {report.picture_after:.2%} now')


classes = (STIPPLE_OT_mesh_adapt_to_images,)
