# SPDX-License-Identifier: GPL-3.0-or-later
"""Selected splat objects become one."""

import bpy
import numpy as np
from bpy.props import EnumProperty

from ..binding import cloud_edit
from ..binding.errors import invalid
from ..jobs import JobOperator, Task
from ..scene.source import bound, edits, exporting, masks, placement, sources, splat_data, sync


class STIPPLE_OT_merge_splats(JobOperator, bpy.types.Operator):
    """Join the selected splats into the active object, and rotate their harmonics with them"""

    bl_idname = 'stipple.merge_splats'
    bl_label = "Merge Splats"
    bl_options = {'REGISTER', 'UNDO'}

    budget: EnumProperty(name="Budget", description="How many splats of each object are joined",
                         items=exporting.BUDGETS)

    @classmethod
    def poll(cls, context):
        return (context.mode == 'OBJECT' and splat_data.is_splat_object(context.object)
                and context.object.select_get())

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, context):
        active = context.object
        others = [obj for obj in context.view_layer.objects.selected
                  if splat_data.is_splat_object(obj) and obj != active]
        if not others:
            raise invalid('One splat object is selected; select at least two.')
        self._objects = [active] + others
        for obj in self._objects:
            edits.refuse_sequence(obj)
            edits.refuse_moving(obj)
        inverse = np.linalg.inv(placement.matrix_of(active))
        depsgraph = context.evaluated_depsgraph_get()
        clouds = [exporting.cloud_at(obj.evaluated_get(depsgraph), self.budget) for obj in self._objects]
        matrices = [np.eye(4)] + [inverse @ placement.matrix_of(obj) for obj in others]
        frame = clouds[0].info().frame

        def work(task):
            task.advance(0.0, 'Merging splats')
            return cloud_edit.merge(list(zip(clouds, matrices)), frame)
        return Task(work)

    def finish(self, _context, job):
        active = self._objects[0]
        path = sources.save_cloud(job.result, active.name)
        # A datablock of its own: the old one may have other users.
        data = splat_data.new_data(active.data.name, like=active.data)
        with sync.paused():
            sources.attach_cloud(data, path)
        splats = job.result.columns()
        sync.write(data, splats, masks.key(data))
        if bound.is_bound(active.data):
            bound.hold(active, None)
            self.report({'WARNING'}, f"'{active.name}' follows no mesh now; bind it again where all of it shall "
                                     'follow.')
        active.data = data
        for obj in self._objects[1:]:
            bpy.data.objects.remove(obj)
        self.report({'INFO'}, f"{splats.count:,} splats of {len(self._objects)} objects in '{active.name}'")


classes = (STIPPLE_OT_merge_splats,)
