# SPDX-License-Identifier: GPL-3.0-or-later
"""Shows all splats of the source again."""

import bpy

from ..jobs import JobOperator
from ..scene.source import edits, erased, masks, source_paths, source_settings, sources, splat_data


class STIPPLE_OT_clear_mask(JobOperator, bpy.types.Operator):
    """Bring back the splats that cropping, erasing and deleting floaters hid"""

    bl_idname = 'stipple.clear_mask'
    bl_label = "Clear Mask"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context):
        return (splat_data.is_splat_object(context.object) and context.mode == 'OBJECT'
                and (masks.counts(context.object.data) is not None or erased.any_of(context.object.data)))

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
        before = splat_data.count(data)
        total, kept = masks.counts(data) or (None, before)
        masks.clear(data)
        erased.clear(data)
        edits.show(data, self._cloud)
        total = splat_data.count(data) if total is None else total
        self.report({'INFO'}, f'{total - kept:,} splats are back, {total:,} in all')


classes = (STIPPLE_OT_clear_mask,)
