# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats that were edited by hand become their own source."""

import bpy

from ..jobs import JobOperator
from ..scene import grades
from ..scene.source import bound, sources, splat_data, sync


class STIPPLE_OT_use_as_new_source(JobOperator, bpy.types.Operator):
    """Keep the edited splats: they are written to a file of their own, and have no budget any more"""

    bl_idname = 'stipple.use_as_new_source'
    bl_label = "Use as New Source"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context):
        return splat_data.is_splat_object(context.object) and context.mode == 'OBJECT'

    def start(self, context):
        obj = context.object
        # Colors that were painted over a grade are kept as they are; otherwise the grade stays a setting.
        self._bakes = grades.colours_are_edited(obj.data)
        self._arrays = (splat_data.read if self._bakes else splat_data.read_ungraded)(obj.data)
        cloud = sources.cloud_from_object(obj) if self._bakes else sources.ungraded_cloud(obj)
        self._path = sources.save_cloud(cloud, obj.name)
        return None

    def finish(self, context, _job):
        data = context.object.data
        with sync.paused():
            sources.attach_cloud(data, self._path)
            if bound.follows(data):
                bound.rebind(data)
            if self._bakes:
                grades.clear(data.stipple)
        sync.write(data, self._arrays, '')
        self.report({'INFO'}, f"{self._arrays.count:,} splats are their own source now, in '{self._path}'")


classes = (STIPPLE_OT_use_as_new_source,)
