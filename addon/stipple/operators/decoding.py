# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats that are being decoded beside Blender: cancel it, begin again."""

import bpy

from ..scene.source import decode_progress, decoded, splat_data, sync


class STIPPLE_OT_decoding_cancel(bpy.types.Operator):
    """Stop making the splats of the budget that was chosen. The splats that are shown stay"""

    bl_idname = 'stipple.decoding_cancel'
    bl_label = "Cancel Decoding"
    bl_options = {'REGISTER'}

    @classmethod
    def poll(cls, _context):
        return bool(decoded.names())

    def execute(self, _context):
        _say(self, decoded.decline())
        return {'FINISHED'}


class STIPPLE_OT_decoding_resume(bpy.types.Operator):
    """Make the splats of the budget that is chosen"""

    bl_idname = 'stipple.decoding_resume'
    bl_label = "Decode"
    bl_options = {'REGISTER'}

    @classmethod
    def poll(cls, context):
        return splat_data.is_splat_object(context.object) and decoded.is_declined(context.object.data)

    def execute(self, context):
        decoded.allow(context.object.data)
        sync.follow_later()
        return {'FINISHED'}


class STIPPLE_OT_decoding_watch(bpy.types.Operator):
    """Listen to Esc while splats are decoded"""

    bl_idname = 'stipple.decoding_watch'
    bl_label = "Watch Decoding"
    bl_options = {'INTERNAL'}

    def invoke(self, context, _event):
        context.window_manager.modal_handler_add(self)
        return {'RUNNING_MODAL'}

    def modal(self, context, event):
        if not decode_progress.is_watching():
            decode_progress.ignore(context.window)
            return {'FINISHED', 'PASS_THROUGH'}
        if event.type != 'ESC' or event.value != 'PRESS':
            return {'PASS_THROUGH'}
        _say(self, decode_progress.escape())
        decode_progress.ignore(context.window)
        # A render hears of it, too.
        return {'FINISHED', 'PASS_THROUGH'}

    def cancel(self, context):
        """Blender itself ends it, for instance when the window closes."""
        if context.window is not None:
            decode_progress.ignore(context.window)


def _say(operator, names):
    what = ' and '.join(f"'{name}'" for name in names) or 'splats'
    operator.report({'INFO'}, f'Decoding {what} was cancelled; what was shown before stays')


classes = (STIPPLE_OT_decoding_cancel, STIPPLE_OT_decoding_resume, STIPPLE_OT_decoding_watch)
