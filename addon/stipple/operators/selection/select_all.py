# SPDX-License-Identifier: GPL-3.0-or-later
"""Selects all splats, none, or those that were not."""

import bpy
from bpy.props import EnumProperty

from ... import binding
from ...scene.source import selecting
from .stroke import SelectOperator

_OPERATIONS = {'SELECT': 'SET', 'DESELECT': 'SUBTRACT', 'INVERT': 'TOGGLE'}


class STIPPLE_OT_select_all(SelectOperator, bpy.types.Operator):
    """Select all splats of the selected objects, none, or those that are not selected now"""

    bl_idname = 'stipple.select_all'
    bl_label = "Select All Splats"
    bl_options = {'REGISTER', 'UNDO'}

    action: EnumProperty(name="Action", description="What is selected then",
                         items=(('SELECT', "All", "Select all splats"), ('DESELECT', "None", "Select no splats"),
                                ('INVERT', "Invert", "Select what is not selected now")))

    def regions_of(self, _obj):
        return selecting.everything(binding.regions.RegionOperation[_OPERATIONS[self.action]])


classes = (STIPPLE_OT_select_all,)
