# SPDX-License-Identifier: GPL-3.0-or-later
"""The weights folder is looked through."""

import bpy

from ... import preferences
from ...jobs import JobOperator
from ...scene.generate import weights_table


class STIPPLE_OT_weights_refresh(JobOperator, bpy.types.Operator):
    """Look through the weights folder again: which files are there, and how large they are"""

    bl_idname = 'stipple.weights_refresh'
    bl_label = "Look Again"
    bl_options = {'INTERNAL'}

    @classmethod
    def poll(cls, _context):
        return _has_folder(cls)

    def start(self, _context):
        weights_table.refresh()

    def finish(self, _context, _job):
        for note in weights_table.notes():
            self.report({'WARNING'}, note)


def _has_folder(cls):
    if preferences.chosen_weights_folder():
        return True
    cls.poll_message_set('No weights folder is chosen')
    return False


classes = (STIPPLE_OT_weights_refresh,)
