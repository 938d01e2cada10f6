# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground that was removed is covered by copies of the splats around it."""

import bpy
import numpy as np
from bpy.props import FloatProperty, IntProperty

from ... import binding
from ...binding import cloud_edit, regions
from ...binding.errors import invalid
from ...jobs import JobOperator, Task
from ...scene.source import edits, selecting, source_paths, source_settings, sources
from .stroke import redraw


class STIPPLE_OT_fill_erased(JobOperator, bpy.types.Operator):
    """Erase the selected splats and cover the ground that they leave by copies of the splats around it. Without a
    selection, cover what was erased before. The result is a source of its own"""

    bl_idname = 'stipple.fill_erased'
    bl_label = "Fill Splats"
    bl_options = {'REGISTER', 'UNDO'}

    radius: FloatProperty(name="Gap", description="Removed splats within this distance are one hole, in the object's "
                                                  "units; 0 derives it from their distances",
                          default=0.0, min=0.0)
    ring_width: FloatProperty(name="Ring", description="How far from a hole splats are copied, in the object's units; 0 "
                                                       "derives it from the size of the hole", default=0.0, min=0.0)
    patch_size: FloatProperty(name="Patch", description="Side of what is copied at once, in the object's units; 0 "
                                                        "derives it from the size of the hole", default=0.0, min=0.0)
    seed: IntProperty(name="Seed", description="Another seed copies other splats of equal fit", default=0, min=0)

    @classmethod
    def poll(cls, context):
        objects = edits.selected_splats(context)
        return context.mode == 'OBJECT' and (selecting.is_any(objects) or edits.is_any_hidden(objects))

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, context):
        objects = edits.selected_splats(context)
        for obj in objects:
            edits.refuse_moving(obj)
        self._grounds = selecting.grounds(context, objects)
        settings = regions.FillSettings(self.radius, self.ring_width, self.patch_size, self.seed)
        native, count = sources.context(), len(self._grounds)
        paths = [source_paths.place_for(ground.obj.name) for ground in self._grounds]
        trees = [source_settings.of(ground.obj.data.stipple).counts_splats for ground in self._grounds]

        def work(task):
            made = []
            for i, (ground, has_budget, path) in enumerate(zip(self._grounds, trees, paths)):
                task.advance(i / count, 'Filling')
                middle = (i + (0.3 if has_budget else 1)) / count
                fill = regions.fill_start(ground.cloud, ground.hole, settings)
                task.run(fill.job, i / count, middle)
                made.append(self._filled(task, native, ground, fill, path if has_budget else None, middle,
                                         (i + 1) / count))
            return made
        return Task(work)

    @staticmethod
    def _filled(task, native, ground, fill, tree_path, start, end):
        """(report, new cloud, path of its tree or None, mask of the new cloud); the cloud is None where nothing was
        filled."""
        new, tree = fill.cloud(), None
        if new.info().count == 0:
            return fill.report, None, None, None
        # Rows that were hidden elsewhere stay, hidden.
        whole = cloud_edit.merge([(cloud_edit.keep(ground.whole, ground.rest), np.eye(4)), (new, np.eye(4))],
                                 ground.whole.info().frame)
        mask = np.concatenate([ground.stays[ground.rest != 0], np.ones(new.info().count, np.uint8)])
        if tree_path is not None:
            made = task.run(binding.model.Model.from_cloud_start(native, whole), start, end)
            tree = sources.save_model(binding.model.Model.of_job(made), tree_path)
        return fill.report, whole, tree, mask

    def finish(self, context, job):
        if all(cloud is None for _, cloud, _, _ in job.result):
            raise invalid(_why_not(job.result[0][0]))
        removed = added = holes = filled = 0
        for ground, (report, cloud, tree, mask) in zip(self._grounds, job.result):
            holes, filled = holes + report.hole_count, filled + report.filled_count
            if cloud is None:
                continue
            data = ground.obj.data
            path = sources.save_cloud(cloud, ground.obj.name) if tree is None else tree
            edits.attach(data, path, cloud.info().count, tree is not None, mask)
            edits.show(data, cloud)
            removed += int(np.count_nonzero(ground.hole))
            added += report.splat_count
        redraw(context)
        self.report({'INFO'}, f'{added:,} splats cover the ground of {removed:,}: {filled:,} of {holes:,} holes are '
                              'filled')


def _why_not(report):
    if report.covered_count:
        return 'The ground under what was removed is all there, so nothing was filled; Erase is enough.'
    if report.no_plane_count:
        return 'What is left around the hole spans no plane, so nothing was filled; select less, or fill by hand.'
    return ('Fewer splats than a patch needs are left around the hole, so nothing was filled; select less, or make '
            'Gap smaller.')


classes = (STIPPLE_OT_fill_erased,)
