# SPDX-License-Identifier: GPL-3.0-or-later
"""Hides the splats that are selected, or all others."""

import bpy

from ...jobs import JobOperator
from ...scene.source import edits, selecting
from .stroke import redraw


class _EraseOperator(JobOperator):
    """Mix-in for both sides."""

    keeps = False

    @classmethod
    def poll(cls, context):
        return context.mode == 'OBJECT' and selecting.is_any(edits.selected_splats(context))

    def start(self, context):
        self._targets = selecting.with_selection(context, edits.selected_splats(context))
        return None

    def finish(self, context, _job):
        outcome = edits.Outcome()
        for target in self._targets:
            target.check_erase(self.keeps)
        for target in self._targets:
            outcome.add(target.erase(self.keeps))
        redraw(context)
        self.report({'INFO'}, str(outcome))


class STIPPLE_OT_erase_selected(_EraseOperator, bpy.types.Operator):
    """Hide the selected splats, at every budget. Clear Mask brings them back"""

    bl_idname = 'stipple.erase_selected'
    bl_label = "Erase Splats"
    bl_options = {'REGISTER', 'UNDO'}


class STIPPLE_OT_keep_selected(_EraseOperator, bpy.types.Operator):
    """Hide all splats but the selected ones, at every budget. Clear Mask brings them back"""

    bl_idname = 'stipple.keep_selected'
    bl_label = "Keep Only Selected Splats"
    bl_options = {'REGISTER', 'UNDO'}

    keeps = True


classes = (STIPPLE_OT_erase_selected, STIPPLE_OT_keep_selected)
