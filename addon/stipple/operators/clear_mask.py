# SPDX-License-Identifier: GPL-3.0-or-later
"""Shows all splats of the source again."""

import bpy

from ..jobs import JobOperator
from ..scene.source import edits, masks, source_paths, source_settings, sources, splat_data


class STIPPLE_OT_clear_mask(JobOperator, bpy.types.Operator):
    """Bring back the splats that cropping and deleting floaters hid"""

    bl_idname = 'stipple.clear_mask'
    bl_label = "Clear Mask"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context):
        return (splat_data.is_splat_object(context.object) and context.mode == 'OBJECT'
                and masks.counts(context.object.data) is not None)

    def start(self, context):
        data = context.object.data
        self._cloud = None
        if source_settings.of(data.stipple).as_they_are:
            self._cloud = sources.whole_cloud(data)
        else:
            sources.model(source_paths.file_of(data))  # before anything changes
        return None

    def finish(self, context, _job):
        data = context.object.data
        total, kept = masks.counts(data)
        masks.clear(data)
        edits.show(data, self._cloud)
        self.report({'INFO'}, f'{total - kept:,} splats are back, {total:,} in all')


classes = (STIPPLE_OT_clear_mask,)
