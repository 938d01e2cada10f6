# SPDX-License-Identifier: GPL-3.0-or-later
"""Throws edits by hand away and decodes the source again."""

import bpy

from ..jobs import JobOperator
from ..scene.source import decoded, sources, splat_data, sync


class STIPPLE_OT_revert_to_source(JobOperator, bpy.types.Operator):
    """Drop the edits and make the splats again from their source file"""

    bl_idname = 'stipple.revert_to_source'
    bl_label = "Revert to Source"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context):
        obj = context.object
        return splat_data.is_splat_object(obj) and obj.data.stipple.source != '' and context.mode == 'OBJECT'

    def start(self, context):
        data = context.object.data
        if data.stipple.is_sequence:
            self._splats = None
            return None
        self._splats = decoded.decode_data(data, sources.decode_settings(data.stipple)).columns()
        return None

    def finish(self, context, _job):
        data = context.object.data
        data.stipple.edited = False
        if data.stipple.is_sequence:
            sync.write_shown(data)
        else:
            sync.write_decoded(data, self._splats)
        self.report({'INFO'}, f"{splat_data.count(data):,} splats from their source")


classes = (STIPPLE_OT_revert_to_source,)
