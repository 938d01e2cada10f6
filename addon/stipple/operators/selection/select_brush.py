# SPDX-License-Identifier: GPL-3.0-or-later
"""Selects splats along a stroke."""

import bpy
from bpy.props import FloatProperty

from ...scene import selection_settings
from ...scene.view import drawn_regions
from .stroke import PathOperator

_MAX_RADIUS = 5000.0


class STIPPLE_OT_select_brush(PathOperator, bpy.types.Operator):
    """Select the splats of the selected objects along a stroke, all of their sources and not just those that are
    shown"""

    bl_idname = 'stipple.select_brush'
    bl_label = "Select Splats by Brush"
    bl_options = {'REGISTER', 'UNDO'}

    shape = 'BRUSH'
    radius: FloatProperty(name="Radius", description="Distance from the stroke up to which splats are selected, pixels",
                          default=40.0, min=1.0, max=_MAX_RADIUS, subtype='PIXEL')

    def take_settings(self, context):
        super().take_settings(context)
        if not self.properties.is_property_set('radius'):
            self.radius = selection_settings.of(context.scene).radius

    def mark_radius(self, _context):
        return self.radius

    def scale_radius(self, context, factor):
        self.radius = min(max(self.radius * factor, 1.0), _MAX_RADIUS)
        selection_settings.of(context.scene).radius = self.radius
        return True

    def regions_of(self, obj):
        return [drawn_regions.brush(obj, self._camera, self.points(), self.radius, self.chosen_operation(),
                                    self._front)]

    def help_text(self):
        return f'{super().help_text()}, the wheel or [ ] changes the radius'


classes = (STIPPLE_OT_select_brush,)
