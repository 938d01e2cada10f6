# SPDX-License-Identifier: GPL-3.0-or-later
"""The splats that are selected become objects of their own."""

import bpy

from ... import binding
from ...jobs import JobOperator, Task
from ...scene.source import edits, selecting, source_paths, source_settings, sources
from .stroke import redraw


class STIPPLE_OT_separate_selected(JobOperator, bpy.types.Operator):
    """Move the selected splats into a new object with a source of its own, and erase them from the old one"""

    bl_idname = 'stipple.separate_selected'
    bl_label = "Separate Splats"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context):
        return context.mode == 'OBJECT' and selecting.is_any(edits.selected_splats(context))

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, context):
        self._targets = selecting.with_selection(context, edits.selected_splats(context))
        for target in self._targets:
            target.check_erase()
        native = sources.context()
        wanted = [(target.selected_cloud(), self._moving(target),
                   source_settings.of(target.obj.data.stipple).counts_splats, source_paths.place_for(target.obj.name))
                  for target in self._targets]

        def work(task):
            made = []
            for i, (cloud, moving, has_budget, path) in enumerate(wanted):
                task.advance(i / len(wanted), 'Separating splats')
                tree = settings = None
                if moving is not None:
                    part = moving()
                    tree, settings = sources.save_model(part, path), part.settings()
                elif has_budget:
                    job = task.run(binding.model.Model.from_cloud_start(native, cloud), (i + 0.1) / len(wanted),
                                   (i + 1) / len(wanted))
                    tree = sources.save_model(binding.model.Model.of_job(job), path)
                made.append((cloud, tree, settings))
            return made
        return Task(work)

    @staticmethod
    def _moving(target):
        """A function that makes the model of what is selected, of splats that move; None of others."""
        data = target.obj.data
        if not source_settings.of(data.stipple).has_time:
            return None
        whole = sources.model(source_paths.file_of(data))
        return lambda: whole.masked(target.selected)

    def finish(self, context, job):
        count = 0
        for target, (cloud, tree, settings) in zip(self._targets, job.result):
            new = self._new_object(context, target.obj, cloud, tree, settings)
            target.erase()
            target.obj.select_set(False)
            new.select_set(True)
            if context.view_layer.objects.active == target.obj:
                context.view_layer.objects.active = new
            count += cloud.info().count
        redraw(context)
        self.report({'INFO'}, f'{count:,} splats separated into {len(self._targets)} new objects')

    @staticmethod
    def _new_object(context, old, cloud, tree, settings):
        path = sources.save_cloud(cloud, old.name) if tree is None else tree
        # The old one's place, settings and grade.
        new, data = old.copy(), old.data.copy()
        new.data = data
        for collection in old.users_collection or (context.collection,):
            collection.objects.link(new)
        edits.attach(data, path, cloud.info().count, tree is not None, settings=settings)
        edits.show(data, cloud)
        return new


classes = (STIPPLE_OT_separate_selected,)
