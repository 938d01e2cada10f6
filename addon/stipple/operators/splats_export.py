# SPDX-License-Identifier: GPL-3.0-or-later
"""Splat objects become a file, one for each frame, or one that plays."""

import os
from contextlib import closing

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from .. import binding, choices
from ..binding.errors import invalid
from ..jobs import JobOperator, Task
from ..preferences import UP_AXES
from ..scene.sequence import frames, frames_out, numbered
from ..scene.source import exporting, formats, sources


class FileEach:
    """Frames as files with their numbers."""

    def __init__(self, path, options):
        self._path, self._options = path, options

    def add_nothing(self, _number):
        pass

    def add(self, cloud, number):
        to = numbered.frame_path(self._path, number)
        if os.path.dirname(to) != os.path.dirname(self._path):
            exporting.make_folder(to)
        cloud.save(to, **self._options)

    def finish(self):
        pass

    def close(self):
        pass


class OneFile:
    """Frames as time samples of one file."""

    def __init__(self, context, path, options):
        render = context.scene.render
        self._native = sources.context()
        self._writer = binding.series_file.SeriesWriter.create(self._native, path, render.fps / render.fps_base,
                                                                 **options)

    def add_nothing(self, number):
        nothing = binding.cloud.SplatArrays(*(np.empty((0, width), np.float32) for width in (3, 4, 3)),
                                            np.empty(0, np.float32), np.empty((0, 1, 3), np.float32))
        self._writer.add(binding.cloud.Cloud.create(self._native, nothing), number)

    def add(self, cloud, number):
        self._writer.add(cloud, number)

    def finish(self):
        self._writer.finish()

    def close(self):
        """Leaves nothing of a file that is not finished."""
        self._writer.close()


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
    frames: EnumProperty(name="Frames", description="Which frames are written, each to a file of its own, or all to "
                         "one file of USD", items=choices.FRAMES_OUT, options={'SKIP_SAVE'})
    one_file: BoolProperty(name="One File", description="Write all frames into one file that plays, as time samples, "
                           "and not each to a file of its own (.usda, .usd, .usdz)", default=True)
    ascii: BoolProperty(name="Text", description="Write numbers as text, several times larger (.ply)", default=False)

    keep_objects: BoolProperty(name="Keep Objects", description="Write each object as a prim with its own name and "
                               "transform, and splats that several objects share once; otherwise all splats become one "
                               "prim (.usda, .usd, .usdz)", default=True)
    half: BoolProperty(name="Half Precision", description="Write all but the positions in half precision, about a quarter "
                       "smaller (.usda, .usd, .usdz)", default=False)

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
        options = {'ascii': self.ascii, 'half': self.half, 'sh_degree_limit': self.max_degree}
        if self.apply_transform and self.up_axis != 'AUTO':
            options['frame'] = frames.UP_AXES[self.up_axis]
        if self.frames != 'CURRENT' and form.holds_times and self.one_file:
            return self._start_series(context, objects, OneFile(context, path, options))
        if self.frames != 'CURRENT':
            return self._start_series(context, objects, FileEach(path, options))
        keeps_objects = form.holds_times and self.keep_objects and len(objects) > 1
        clouds = exporting.placed_clouds(context, objects, self.budget, self.apply_transform,
                                         self.apply_grade)
        names = [obj.name for obj in objects]

        def work(task):
            if keeps_objects:
                task.advance(0.0, 'Writing splats')
                placed, frame = clouds
                # What shows nothing now is no prim, as it adds nothing to joined splats.
                shown = [(name, *one) for name, one in zip(names, placed) if one[0].info().count > 0]
                binding.cloud.save_scene(shown, path, frame, **options)
                return sum(cloud.info().count for cloud, _matrix in placed)
            task.advance(0.0, 'Joining splats')
            cloud = exporting.joined(clouds)
            task.advance(0.3, 'Writing splats')
            cloud.save(path, **options)
            return cloud.info().count
        return Task(work)

    def _start_series(self, context, objects, out):
        found = frames_out.gather(context, objects, self.frames, self.budget, self.apply_grade)
        native, apply_transform = sources.context(), self.apply_transform

        def work(task):
            total = 0
            with closing(out):
                for i, frame in enumerate(found):
                    task.advance(i / len(found), f'Frame {i + 1} of {len(found)}')
                    clouds = frame.clouds(native)
                    if not clouds:
                        out.add_nothing(frame.number)
                        continue
                    cloud = exporting.joined(exporting.in_frame(clouds, apply_transform))
                    out.add(cloud, frame.number)
                    total += cloud.info().count
                if total == 0:
                    raise invalid('No frame shows a splat; there is nothing to write.')
                out.finish()
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
        form = formats.of_path(self.filepath)
        is_usd = form is not None and form.holds_times
        if self.frames != 'CURRENT' and is_usd:
            layout.prop(self, 'one_file')
        elif is_usd:
            layout.prop(self, 'keep_objects')
        layout.prop(self, 'apply_transform')
        row = layout.row()
        row.enabled = self.apply_transform
        row.prop(self, 'up_axis')
        layout.prop(self, 'apply_grade')
        layout.prop(self, 'max_degree')
        if self.filepath.lower().endswith('.ply'):
            layout.prop(self, 'ascii')
        if is_usd:
            layout.prop(self, 'half')
        layout.label(text=exporting.size_label(context, self))


classes = (STIPPLE_OT_splats_export,)
