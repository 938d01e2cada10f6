# SPDX-License-Identifier: GPL-3.0-or-later
"""Selects splats whose colour is near the one that is clicked."""

import bpy
from bpy.props import FloatProperty, FloatVectorProperty

from ...scene import selection_settings
from ...scene.source import edits, selecting
from ...scene.view import drawn_regions, picking
from .stroke import DrawnOperator


class STIPPLE_OT_select_color(DrawnOperator, bpy.types.Operator):
    """Select the splats of the selected objects whose color is like the one that is clicked"""

    bl_idname = 'stipple.select_color'
    bl_label = "Select Splats by Color"
    bl_options = {'REGISTER', 'UNDO'}

    shape = 'COLOR'
    color: FloatVectorProperty(name="Color", description="Color that is looked for, without the color grade", size=3,
                               subtype='COLOR', min=0.0, soft_max=1.0)
    tolerance: FloatProperty(name="Tolerance", description="How different a color may be; 0.1 is a family of one hue",
                             default=0.08, min=0.0, soft_max=0.5, subtype='FACTOR', precision=3)
    center: FloatVectorProperty(name="Center", description="Center of the sphere that limits the selection", size=3,
                                subtype='TRANSLATION', unit='LENGTH')
    radius: FloatProperty(name="Within", description="Radius of the sphere around the center in which colors are "
                                                     "looked for, 0 for everywhere",
                          default=0.0, min=0.0, subtype='DISTANCE', unit='LENGTH')

    def take_settings(self, context):
        settings = selection_settings.of(context.scene)
        if not self.properties.is_property_set('tolerance'):
            self.tolerance = settings.tolerance
        if not self.properties.is_property_set('radius'):
            self.radius = settings.within

    def press(self, context, place):
        depsgraph, (x, y) = context.evaluated_depsgraph_get(), map(int, place)
        self.center = picking.point_at(depsgraph, self._region, self._region_data, x, y)
        targets = selecting.targets(context, edits.selected_splats(context))
        self.color = picking.colour_of_pixel(selecting.placed(targets), self.camera(), place[0],
                                             self.region_size[1] - place[1])

    def regions_of(self, obj):
        return [drawn_regions.colour(obj, self.color, self.tolerance, self.chosen_operation(), self.center,
                                     self.radius)]

    def help_text(self):
        return f'{self.bl_label}: click on a color. Shift adds, Ctrl subtracts, both intersect, Esc cancels'


classes = (STIPPLE_OT_select_color,)
