# SPDX-License-Identifier: GPL-3.0-or-later
"""Shows how a fit went."""

import bpy

from ..scene.fit import fit_proposal, fit_reports


class STIPPLE_OT_show_report(bpy.types.Operator):
    """Show the curves of the fit in an Image Editor: loss, quality on held-out views, splats, time"""

    bl_idname = 'stipple.show_report'
    bl_label = "Show Report"

    @classmethod
    def poll(cls, context):
        if bpy.app.background:
            cls.poll_message_set('There is no window to show it in')
            return False
        if reported(context) is None:
            cls.poll_message_set('The active object has no splats that were fitted')
            return False
        return True

    def execute(self, context):
        fit_reports.show(context, reported(context))
        return {'FINISHED'}


def reported(context):
    """The report of the fit that waits for a decision, else of the active object."""
    return fit_reports.of(fit_proposal.find(context)) or fit_reports.of(context.object)


classes = (STIPPLE_OT_show_report,)
