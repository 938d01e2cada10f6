# SPDX-License-Identifier: GPL-3.0-or-later
"""The object's matrix goes into the splats."""

import bpy
from mathutils import Matrix

from .. import binding
from ..binding import cloud_edit
from ..binding.errors import invalid
from ..jobs import JobOperator, Task
from ..scene.sequence import frames
from ..scene.source import edits, placement, source_paths, source_settings, sources, sync


class STIPPLE_OT_apply_transform(JobOperator, bpy.types.Operator):
    """Move, rotate and scale the splats themselves as their object does, harmonics included"""

    bl_idname = 'stipple.apply_transform'
    bl_label = "Apply Transform to Splats"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context):
        return context.mode == 'OBJECT' and bool(edits.selected_splats(context))

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, context):
        objects = edits.selected_splats(context)
        for obj in objects:
            edits.refuse_moving(obj)
            if obj.data.users > 1:
                raise invalid(f"The splats of '{obj.name}' have {obj.data.users} users; make them single-user first.")
        wanted = [(target, placement.matrix_of(obj), source_settings.of(obj.data.stipple).counts_splats,
                   source_paths.place_for(obj.name)) for target, obj in zip(edits.targets(objects), objects)]
        native = sources.context()

        def work(task):
            moved = []
            for i, (target, matrix, has_budget, path) in enumerate(wanted):
                task.advance(i / len(wanted), 'Moving splats')
                cloud, tree = cloud_edit.merge([(target.cloud, matrix)], frames.WORLD), None
                if has_budget:
                    job = task.run(binding.model.Model.from_cloud_start(native, cloud), (i + 0.1) / len(wanted),
                                   (i + 1) / len(wanted))
                    tree = sources.save_model(binding.model.Model.of_job(job), path)
                moved.append((target, cloud, tree))
            return moved
        return Task(work)

    def finish(self, _context, job):
        for target, cloud, tree in job.result:
            data = target.obj.data
            with sync.paused():
                if tree is not None:
                    sources.attach_tree(data, tree, data.stipple.source_count)
                else:
                    sources.attach_cloud(data, sources.save_cloud(cloud, target.obj.name))
            # Row by row the same splats, so what was hidden stays hidden.
            edits.write([(target.on(cloud), target.mask)])
            target.obj.matrix_world = Matrix.Identity(4)
        self.report({'INFO'}, f'{len(job.result)} objects applied')


classes = (STIPPLE_OT_apply_transform,)
