# SPDX-License-Identifier: GPL-3.0-or-later
"""Selects splats in a ball whose centre is clicked on their surface."""

import bpy
import numpy as np
from bpy.props import FloatProperty, FloatVectorProperty
from bpy_extras.view3d_utils import region_2d_to_location_3d
from mathutils import Vector

from ...binding.errors import invalid
from ...scene.view import drawn_regions, picking
from .stroke import DrawnOperator


class STIPPLE_OT_select_sphere(DrawnOperator, bpy.types.Operator):
    """Select the splats of the selected objects inside a sphere: press the mouse on the splats and drag its radius"""

    bl_idname = 'stipple.select_sphere'
    bl_label = "Select Splats by Sphere"
    bl_options = {'REGISTER', 'UNDO'}

    shape = 'SPHERE'
    center: FloatVectorProperty(name="Center", description="Center of the sphere in the world", size=3,
                                subtype='TRANSLATION', unit='LENGTH')
    radius: FloatProperty(name="Radius", description="Radius of the sphere in the world", default=0.0, min=0.0,
                          subtype='DISTANCE', unit='LENGTH')

    def press(self, context, place):
        x, y = int(place[0]), int(place[1])
        self.center = picking.point_at(context.evaluated_depsgraph_get(), self._region, self._region_data, x, y)
        self.radius = 0.0

    def drag(self, _context, place):
        at = region_2d_to_location_3d(self._region, self._region_data, place, Vector(self.center))
        self.radius = float(np.linalg.norm(np.array(at) - np.array(self.center)))

    def can_preview(self):
        return self.radius > 0

    def release(self, _context):
        return self.radius > 0

    def help_text(self):
        return f'{self.bl_label}: press on the splats and drag. Shift adds, Ctrl subtracts, both intersect, Esc cancels'

    def regions_of(self, obj):
        if self.radius <= 0:
            raise invalid('The radius of the sphere is 0; give it a larger one.')
        return [drawn_regions.sphere(obj, self.center, self.radius, self.chosen_operation())]


classes = (STIPPLE_OT_select_sphere,)
