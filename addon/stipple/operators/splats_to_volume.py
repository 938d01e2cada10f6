# SPDX-License-Identifier: GPL-3.0-or-later
"""Selected splat objects become one OpenVDB file, or one for each frame, and a Volume object that shows it."""

import os

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from .. import binding, choices
from ..binding.errors import invalid
from ..jobs import JobOperator, Task
from ..scene import volumes
from ..scene.sequence import frames_out, numbered
from ..scene.source import placement, sources, splat_data


class STIPPLE_OT_splats_to_volume(JobOperator, bpy.types.Operator, ExportHelper):
    """Make a volume of density and color from the selected splats"""

    bl_idname = 'stipple.splats_to_volume'
    bl_label = "Splats to Volume"
    bl_options = {'REGISTER', 'UNDO', 'PRESET'}

    filename_ext = '.vdb'
    filter_glob: StringProperty(default='*.vdb', options={'HIDDEN'})
    resolution: IntProperty(name="Resolution", description="Number of voxels along the longest side, where Voxel Size"
                                                           " is 0; for a sequence, along the longest side of its "
                                                           "largest frame", default=256, soft_min=8, soft_max=2048)
    voxel_size: FloatProperty(name="Voxel Size", description="Side of a voxel, 0 to take the resolution", default=0.0,
                              soft_min=0.0, subtype='DISTANCE', unit='LENGTH', precision=4)
    frames: EnumProperty(name="Frames", description="Which frames become volumes, each in a file of its own",
                         items=choices.FRAMES_OUT, options={'SKIP_SAVE'})

    @classmethod
    def poll(cls, context):
        return any(splat_data.is_splat_object(obj) for obj in context.view_layer.objects.selected)

    def invoke(self, context, event):
        if not self.properties.is_property_set('frames') and frames_out.chosen_series(context) is not None:
            self.frames = 'SERIES'
        return ExportHelper.invoke(self, context, event)

    def start(self, context):
        self._path = bpy.path.abspath(self.filepath)
        if not self._path.lower().endswith('.vdb'):
            raise invalid(f"'{self._path}' does not end in .vdb, which a volume file must.")
        active = context.view_layer.objects.active
        selected = [o for o in context.view_layer.objects.selected if splat_data.is_splat_object(o)]
        if self.frames != 'CURRENT':
            return self._start_series(context, sorted(selected, key=lambda obj: obj != active))
        depsgraph = context.evaluated_depsgraph_get()
        objects = [obj.evaluated_get(depsgraph) for obj in selected]
        instances = [(sources.cloud_from_object(obj), placement.matrix_of(obj)) for obj in objects]
        return binding.volume.Volume.voxelize_start(sources.context(), instances, self.resolution, self.voxel_size)

    def _start_series(self, context, objects):
        frames = frames_out.gather(context, objects, self.frames, 'VIEWPORT')
        native, path, resolution, voxel_size = sources.context(), self._path, self.resolution, self.voxel_size
        # Refuses settings out of range before any file is read.
        binding.volume.Volume.check_settings(resolution, voxel_size)
        self._timing = volumes.Timing(frames[0].number, len(frames), frames[0].number - 1, 'CLIP')
        if self.frames == 'SERIES':
            stipple = objects[0].data.stipple
            self._timing = volumes.Timing(stipple.frame_start, len(frames), 0, stipple.sequence_mode)
            if stipple.frame_speed != 1.0:
                self.report({'WARNING'}, 'Volumes have no speed; Scene Range keeps that of the series')

        def work(task):
            size = voxel_size
            if size == 0:
                # One size for all frames: voxels that swell and shrink would flicker.
                extent = frames_out.largest_extent(frames, native,
                                                   lambda share: task.advance(0.1 * share, 'Measuring frames'))
                size = extent / resolution
            written = []
            for i, frame in enumerate(frames):
                part = [0.1 + 0.9 * (i + k) / len(frames) for k in (0, 1)]
                task.advance(part[0], f'Frame {i + 1} of {len(frames)}')
                clouds = frame.clouds(native)
                if not clouds:
                    continue
                voxels = task.run(binding.volume.Volume.voxelize_start(native, clouds, resolution, size), *part)
                volume = binding.volume.Volume.of_job(voxels)
                written.append(numbered.frame_path(path, frame.number))
                volume.save(written[-1])
                size = volume.info().voxel_size
            if not written:
                raise invalid('No frame shows a splat; a volume needs at least one.')
            return written, size
        return Task(work)

    def finish(self, context, job):
        name = os.path.splitext(os.path.basename(self._path))[0]
        if self.frames != 'CURRENT':
            written, size = job.result
            volumes.new_object(name, written[0], context.collection, size, self._timing)
            self.report({'INFO'}, f"{len(written)} volumes of {size:.4g} m voxels from '{written[0]}' on")
            return
        volume = binding.volume.Volume.of_job(job)
        volume.save(self._path)
        info = volume.info()
        volumes.new_object(name, self._path, context.collection, info.voxel_size)
        self.report({'INFO'}, f"{info.active_voxel_count:,} voxels of {info.voxel_size:.4g} m in '{self._path}'")


classes = (STIPPLE_OT_splats_to_volume,)
