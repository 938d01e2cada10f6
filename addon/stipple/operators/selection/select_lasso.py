# SPDX-License-Identifier: GPL-3.0-or-later
"""Selects splats inside an outline."""

import bpy

from ...binding.errors import invalid
from ...scene.view import drawn_regions
from .stroke import PathOperator

_LEAST_CORNERS = 3


class STIPPLE_OT_select_lasso(PathOperator, bpy.types.Operator):
    """Select the splats of the selected objects inside an outline, all of their sources and not just those that are
    shown"""

    bl_idname = 'stipple.select_lasso'
    bl_label = "Select Splats by Lasso"
    bl_options = {'REGISTER', 'UNDO'}

    shape = 'LASSO'
    least_points = _LEAST_CORNERS

    def release(self, _context):
        return len(self.path) >= _LEAST_CORNERS

    def regions_of(self, obj):
        points = self.points()
        if len(points) < _LEAST_CORNERS:
            raise invalid(f'The outline has {len(points)} corners; at least {_LEAST_CORNERS} are needed.')
        return [drawn_regions.lasso(obj, self._camera, points, self.chosen_operation(), self._front)]


classes = (STIPPLE_OT_select_lasso,)
