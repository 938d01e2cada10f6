# SPDX-License-Identifier: GPL-3.0-or-later
"""A .blend and its sources become one folder that can be moved or sent."""

import os

import bpy

from ..binding.errors import StippleError, invalid
from ..jobs import JobOperator, Task
from ..scene.source import source_files, source_paths, source_travel


class STIPPLE_OT_collect_sources(JobOperator, bpy.types.Operator):
    """Copy the files that splats come from into a folder beside the .blend, and use the copies: series and sources of
    several files as a whole, which Pack Resources cannot do. Sources in folders below the .blend stay there"""

    bl_idname = 'stipple.collect_sources'
    bl_label = "Collect Splat Sources"
    bl_options = {'REGISTER', 'UNDO'}

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, _context):
        if not bpy.data.filepath:
            raise invalid('The file has no folder yet; save it first.')
        home, folder = os.path.dirname(bpy.data.filepath), source_paths.folder_beside(bpy.data.filepath)
        chosen, self._missing = [], []
        for file, path, is_sequence in source_travel.collectable(lambda path: not source_paths.is_under(path, home)):
            try:
                chosen.append((file.name, source_files.of(path, is_sequence)))
            except StippleError as error:
                self._missing.append(error)

        def work(task):
            copies = []
            for i, (name, files) in enumerate(chosen):
                task.advance(i / len(chosen), f'Copying {os.path.basename(files.path)}')
                copies.append((name, source_files.copy(files, folder)))
            return copies
        return Task(work)

    def finish(self, _context, job):
        for name, path in job.result:
            source_travel.point_at(bpy.data.images[name, None], path)
        source_travel.follow_texts()
        for error in self._missing:
            self.report({'WARNING'}, str(error))
        count = len(job.result)
        self.report({'INFO'}, f"{count} source{'' if count == 1 else 's'} copied beside the file")


classes = (STIPPLE_OT_collect_sources,)
