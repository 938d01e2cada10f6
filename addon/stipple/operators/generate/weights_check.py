# SPDX-License-Identifier: GPL-3.0-or-later
"""The files of weights are compared with the published ones."""

import bpy

from ...binding import structs
from ...jobs import JobOperator
from ...scene.generate import weights_table


class STIPPLE_OT_weights_check(JobOperator, bpy.types.Operator):
    """Read all files of weights and compare their SHA-256 with those of the published ones. About 4 GB are read"""

    bl_idname = 'stipple.weights_check'
    bl_label = "Check Files"
    bl_options = {'INTERNAL'}

    @classmethod
    def poll(cls, _context):
        if any(row['path'] for row in weights_table.rows()):
            return True
        cls.poll_message_set('No file of weights was found')
        return False

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, _context):
        return weights_table.check_start()

    def finish(self, _context, job):
        weights_table.keep_checked(job)
        found = [row for row in weights_table.rows() if row['path']]
        known = (structs.WeightsState.PUBLISHED, structs.WeightsState.TRAINED, structs.WeightsState.NOT_NEEDED)
        others = [row['label'] for row in found if row['state'] not in known]
        if others:
            self.report({'WARNING'}, f"Not the published files: {', '.join(others)}")
        else:
            self.report({'INFO'}, f'{len(found)} files are as published')


classes = (STIPPLE_OT_weights_check,)
