# SPDX-License-Identifier: GPL-3.0-or-later
"""Every file of a series gets its tree of merges, in a folder beside the .blend."""

import os

import bpy

from .. import binding
from ..binding.errors import invalid
from ..jobs import JobOperator, Task
from ..scene.sequence import numbered, sequences, series_folder
from ..scene.source import source_paths, source_settings, sources, splat_data, sync


class STIPPLE_OT_prepare_budgets(JobOperator, bpy.types.Operator):
    """Make a tree of merges for every file of the series and keep them beside the .blend: budgets then show the least
    visible loss, and each frame reads its tree instead of its file"""

    bl_idname = 'stipple.prepare_budgets'
    bl_label = "Prepare Budgets"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context):
        obj = context.object
        return (context.mode == 'OBJECT' and splat_data.is_splat_object(obj) and obj.data.library is None
                and obj.data.stipple.is_sequence and source_settings.of(obj.data.stipple).as_they_are)

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, context):
        self._object = context.object
        data = self._object.data
        first = numbered.parse(source_paths.file_of(data))
        numbers = first.numbers() if first is not None else []
        if first is None or first.number not in numbers:
            raise invalid(f"The series of '{self._object.name}' has no file '{source_paths.of(data)}'; relink it "
                          f"first.")
        native = sources.context()
        self._first = first.number
        stem = source_paths.place_for(self._object.name)[:-len(sources.MODEL_SUFFIX)]
        name = os.path.basename(stem)

        def work(task):
            def fill(folder):
                for i, number in enumerate(numbers):
                    part = (i / len(numbers), (i + 1) / len(numbers))
                    task.advance(part[0], f'File {i + 1} of {len(numbers)}')
                    cloud = binding.cloud.Cloud.load(native, first.path(number))
                    made = task.run(binding.model.Model.from_cloud_start(native, cloud), *part)
                    model = binding.model.Model.of_job(made)
                    model.save(os.path.join(folder, f'{name}_{number:04d}{sources.MODEL_SUFFIX}'))
            return series_folder.write(stem, fill), len(numbers), name
        return Task(work)

    def finish(self, _context, job):
        folder, count, name = job.result
        data = self._object.data
        with sync.paused():
            sequences.attach(data, os.path.join(folder, f'{name}_{self._first:04d}{sources.MODEL_SUFFIX}'),
                             data.stipple.frame_duration, of_models=True)
        sync.write_shown(data)
        self.report({'INFO'}, f"Budgets of {count} files in '{folder}'")


classes = (STIPPLE_OT_prepare_budgets,)
