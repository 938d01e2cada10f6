# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats that are there already get a budget: a tree of merges, in a file beside the .blend."""

import bpy
from bpy.props import BoolProperty

from .. import binding
from ..jobs import JobOperator, Task
from ..scene import geometry
from ..scene.source import bound, decoded, masks, source_paths, source_settings, sources, splat_data, sync


class STIPPLE_OT_add_budget(JobOperator, bpy.types.Operator):
    """Let a slider set how many of the active object's splats are shown, with the least visible loss"""

    bl_idname = 'stipple.add_budget'
    bl_label = "Add Budget"
    bl_options = {'REGISTER', 'UNDO'}

    hide_source: BoolProperty(name="Hide Source", description="Hide an object whose modifiers make the splats; they go "
                              "into a new object", default=True)

    @classmethod
    def poll(cls, context):
        return context.mode == 'OBJECT' and geometry.may_carry_splats(context.object)

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, context):
        native, obj = sources.context(), context.object
        self._object, self._in_place = obj, geometry.is_plain(obj)
        cloud = geometry.splats_of(obj, context.evaluated_depsgraph_get())
        path = source_paths.place_for(obj.name)

        def work(task):
            model = binding.model.Model.of_job(task.run(binding.model.Model.from_cloud_start(native, cloud), 0.0, 0.9))
            task.advance(0.9, 'Writing the tree')
            return model, sources.save_model(model, path), cloud.info().count
        return Task(work)

    def finish(self, context, job):
        model, path, count = job.result
        sources.remember_model(path, model)
        obj = self._object if self._in_place else self._new_object(context)
        data = obj.data
        if not source_settings.of(data.stipple).has_source:
            masks.clear(data)
        is_carried = bound.follows(data) and data.stipple.edited  # else the tree is of the source, at rest
        with sync.paused():
            sources.attach_tree(data, path, count)
            if is_carried:
                bound.rebind(data)
            visible = sources.visible_count(data.stipple)
            data.stipple.ratio = min(1.0, sources.FIRST_COUNT / visible)
        settings = sources.decode_settings(data.stipple)
        sync.write_decoded(data, decoded.decode_data(data, settings).columns())
        self.report({'INFO'}, f"'{obj.name}' shows {settings.anchors:,} of {visible:,} splats")

    def _new_object(self, context):
        made_by = self._object
        obj = splat_data.new_object(made_by.name + ' Splats', splat_data.new_data(made_by.name + ' Splats'))
        obj.matrix_world = made_by.matrix_world
        context.collection.objects.link(obj)
        made_by.select_set(False)
        if self.hide_source:
            made_by.hide_set(True)
            made_by.hide_render = True
        obj.select_set(True)
        context.view_layer.objects.active = obj
        return obj


classes = (STIPPLE_OT_add_budget,)
