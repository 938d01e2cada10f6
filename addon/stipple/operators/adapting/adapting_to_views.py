# SPDX-License-Identifier: GPL-3.0-or-later
"""What the operators have in common that give a mesh the shape that images show."""

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty

from ...binding import structs
from .mesh_adapt import DENSITIES, TargetedOperator

_ALIGNMENTS = (('NONE', "None", "The mesh lies where the images show the object"),
               ('SIZE', "Location and Size", "The mesh gets the middle and the size of what the images show first"))
_DRAWINGS = (('TRIANGLES', "Triangles", "The mesh is drawn as it is, with sharp outlines"),
             ('SPLATS', "Splats", "The mesh is drawn as splats that follow its faces"))


class AdaptToViewsOperator(TargetedOperator):
    """Mix-in. The operator gives invoke(), which sets _asked and asks for settings."""

    density: EnumProperty(name="Density", description="Where vertices go along the surface", items=DENSITIES,
                          default='OFF')
    strength: FloatProperty(name="Strength", description="How strongly edges are shortened and evened out against what "
                            "the images say, which is weaker than what a surface says", default=0.3, min=0.0,
                            soft_max=10.0)
    alignment: EnumProperty(name="Alignment", description="What is done to the whole mesh first", items=_ALIGNMENTS)
    image_size: IntProperty(name="Image Size", description="Pixels of the longer side of the images that are compared. "
                            "Larger ones show finer detail, and take longer by the square", default=256, min=16,
                            max=4096, subtype='PIXEL')
    drawing: EnumProperty(name="Drawn As", description="What the mesh is drawn as to be compared with the images",
                          items=_DRAWINGS)

    _asked = False

    def execute(self, context):
        if bpy.app.background or not self._asked:
            return super().execute(context)
        return self.run_in_window(context)

    def _start_by_views(self, views):
        return self._start(views, density=structs.MeshDensity[self.density],
                           alignment=structs.MeshAlignment[self.alignment],
                           picture_side=self.image_size, picture_drawing=structs.PictureDrawing[self.drawing])

    def _say_difference(self, images, report):
        """images: what the mesh was compared with, in words."""
        self.report({'INFO'}, f"'{self._template.name}' differed from {images} by {report.picture_before:.2%} on "
                    f'average, and differs by {report.picture_after:.2%} now')
