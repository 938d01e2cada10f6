# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertices of a mesh slide along its surface to where they are needed."""

import math

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty

from ... import binding
from ...binding import structs
from .mesh_adapt import AdaptOperator, length_text

_DENSITIES = (('UNIFORM', "Uniform", "All edges become about as long as each other"),
              ('ADAPTIVE', "Adaptive", "Vertices are drawn to where the shape is complex"))


class STIPPLE_OT_mesh_even_out(AdaptOperator, bpy.types.Operator):
    """Let the vertices of the active mesh slide along its surface, so that its edges become even or its detail gets
    more of them. The shape stays, and so do faces, UV maps, weights and materials. Esc keeps the shape so far"""

    bl_idname = 'stipple.mesh_even_out'
    bl_label = "Even Out Mesh"
    bl_options = {'REGISTER', 'UNDO', 'PRESET'}

    from_mix = True

    density: EnumProperty(name="Density", description="Where vertices go along the surface", items=_DENSITIES)
    steps: IntProperty(name="Steps", description="More steps make the mesh more even. They end early once nothing "
                       "becomes better", default=48, min=1, soft_max=200, max=1000000)
    sharp_angle: FloatProperty(name="Sharp Edges", description="Edges whose faces differ by more than this stay as they "
                               "are, and vertices on them move along them alone", default=math.radians(45), min=0.0,
                               max=math.pi, subtype='ANGLE')

    def start(self, context):
        self._begin(context.view_layer.objects.active, 'Evened Out')
        mesh = self._template.native()
        return binding.mesh_adapt.start_adapt(mesh, mesh, density=structs.MeshDensity[self.density],
                                              alignment=structs.MeshAlignment.NONE, steps=self.steps, lands_on_target=1,
                                              # float32 rounds 180° up
                                              sharp_angle=min(self.sharp_angle, math.pi))

    def draw(self, _context):
        self._draw(('result', 'density', 'steps', 'sharp_angle', 'preview'))

    def _tell(self, context, report):
        self.report({'INFO'}, f"The vertices of '{self._template.name}' are {self.density.lower()} now; its surface "
                    f'moved by {length_text(context, report.distance_after)} on average')


classes = (STIPPLE_OT_mesh_even_out,)
