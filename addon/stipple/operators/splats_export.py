# SPDX-License-Identifier: GPL-3.0-or-later
"""Splat objects become a file, or one for each frame."""

import os

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from ..binding.errors import invalid
from ..jobs import JobOperator, Task
from ..preferences import UP_AXES
from ..scene.sequence import frames, frames_out, numbered
from ..scene.source import exporting, formats, sources

class STIPPLE_OT_splats_export(JobOperator, bpy.types.Operator, ExportHelper):
    """Export splats to a file"""

    bl_idname = 'stipple.splats_export'
    bl_label = "Export Splats"
    bl_options = {'REGISTER', 'PRESET'}

    filename_ext = formats.USUAL_EXTENSION
    check_extension = None  # several extensions are right
    filter_glob: StringProperty(options={'HIDDEN', 'SKIP_SAVE'})
    collection: StringProperty(name="Collection", description="Export the splats of this collection", default="",
                               options={'HIDDEN'})
    use_selection: BoolProperty(name="Selected Only",
                                description="Export selected splats only, instead of all that are "
                                            "visible", default=True)
    budget: EnumProperty(name="Budget", description="How many splats are written", items=exporting.BUDGETS)
    apply_transform: BoolProperty(name="Apply Transform", description="Write the splats where their objects put them,"
                                                                      " with their harmonics rotated; otherwise in "
                                                                      "the active object's own space", default=True)
    apply_grade: BoolProperty(name="Apply Grade", description="Write colors and opacities with the Color Grade of each "
                              "object, which the file then has for good; otherwise as they were before it",
                              default=True)
    up_axis: EnumProperty(name="Up Axis", description="The up direction of the file, where the transform is applied",
                          items=(('AUTO', "By Format", "The frame that files of this format usually have"),)
                          + UP_AXES[1:])
    max_degree: IntProperty(name="Harmonics",
                            description="Highest degree of the colors' harmonics that is written, 0 for "
                                        "colors that do not change with the view", default=4, min=0, max=4)
    frames: EnumProperty(name="Frames", description="Which frames are written, each to a file of its own",
                         items=frames_out.FRAMES, options={'SKIP_SAVE'})
    ascii: BoolProperty(name="Text", description="Write numbers as text, several times larger (.ply)", default=False)

    @classmethod
    def poll(cls, context):
        return exporting.any_splats(context)

    def invoke(self, context, event):
        if not self.filepath:
            self.filepath = exporting.default_name(context) + self.filename_ext
        self.filter_glob = formats.glob(formats.write_extensions())
        return ExportHelper.invoke(self, context, event)

    def execute(self, context):
        return JobOperator.execute(self, context) if bpy.app.background else self.run_in_window(context)

    def check(self, _context):
        return False

    def start(self, context):
        path = bpy.path.abspath(self.filepath)
        form = formats.of_path(path)
        if form is None or not form.can_write:
            raise invalid(f"'{path}' has an extension that is no splat format to write; allowed are "
                          f"{', '.join(formats.write_extensions())}.")
        objects = exporting.chosen(context, self.collection, self.use_selection)
        options = {'ascii': self.ascii, 'sh_degree_limit': self.max_degree}
        if self.apply_transform and self.up_axis != 'AUTO':
            options['frame'] = frames.UP_AXES[self.up_axis]
        if self.frames != 'CURRENT':
            return self._start_series(context, objects, path, options)
        clouds = exporting.placed_clouds(context, objects, self.budget, self.apply_transform,
                                         self.apply_grade)

        def work(task):
            task.advance(0.0, 'Joining splats')
            cloud = exporting.joined(clouds)
            task.advance(0.3, 'Writing splats')
            cloud.save(path, **options)
            return cloud.info().count
        return Task(work)

    def _start_series(self, context, objects, path, options):
        found = frames_out.gather(context, objects, self.frames, self.budget, self.apply_grade)
        native, apply_transform = sources.context(), self.apply_transform

        def work(task):
            total = 0
            for i, frame in enumerate(found):
                task.advance(i / len(found), f'Frame {i + 1} of {len(found)}')
                clouds = frame.clouds(native)
                if not clouds:
                    continue
                cloud = exporting.joined(exporting.in_frame(clouds, apply_transform))
                to = numbered.frame_path(path, frame.number)
                if os.path.dirname(to) != os.path.dirname(path):
                    exporting.make_folder(to)
                cloud.save(to, **options)
                total += cloud.info().count
            if total == 0:
                raise invalid('No frame shows a splat; there is nothing to write.')
            return total
        return Task(work)

    def finish(self, _context, job):
        self.report({'INFO'}, f"{job.result:,} splats written to '{self.filepath}'")

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        if not self.collection:
            layout.prop(self, 'use_selection')
        layout.prop(self, 'budget')
        layout.prop(self, 'frames')
        layout.prop(self, 'apply_transform')
        row = layout.row()
        row.enabled = self.apply_transform
        row.prop(self, 'up_axis')
        layout.prop(self, 'apply_grade')
        layout.prop(self, 'max_degree')
        if self.filepath.lower().endswith('.ply'):
            layout.prop(self, 'ascii')
        layout.label(text=exporting.size_label(context, self))


classes = (STIPPLE_OT_splats_export,)
