# SPDX-License-Identifier: GPL-3.0-or-later
"""Selections take in their neighbours, or lose their edge."""

import bpy
import numpy as np
from bpy.props import FloatProperty

from ...binding import regions
from ...scene.source import placement
from .stroke import SelectOperator


class _Neighbours(SelectOperator):
    """Mix-in for both directions."""

    shrinks = False

    distance: FloatProperty(name="Distance", description="How far away a neighbor may be, in the world; 0 takes the "
                                                         "usual distance of the selected splats to their neighbors",
                            default=0.0, min=0.0, subtype='DISTANCE', unit='LENGTH')

    def regions_of(self, obj):
        # The mean of the object's scales; regions are in its own space.
        scale = abs(np.linalg.det(placement.matrix_of(obj)[:3, :3])) ** (1 / 3)
        return [regions.Region(regions.RegionKind.GROW, distance=self.distance / scale, shrink=self.shrinks)]


class STIPPLE_OT_select_grow(_Neighbours, bpy.types.Operator):
    """Select the neighbors of the selected splats, too"""

    bl_idname = 'stipple.select_grow'
    bl_label = "Grow Selection of Splats"
    bl_options = {'REGISTER', 'UNDO'}


class STIPPLE_OT_select_shrink(_Neighbours, bpy.types.Operator):
    """Deselect the splats at the edge of the selection"""

    bl_idname = 'stipple.select_shrink'
    bl_label = "Shrink Selection of Splats"
    bl_options = {'REGISTER', 'UNDO'}

    shrinks = True


classes = (STIPPLE_OT_select_grow, STIPPLE_OT_select_shrink)
