# SPDX-License-Identifier: GPL-3.0-or-later
"""Selected splat objects become one OpenVDB file and a Volume object that shows it."""

import os

import bpy
from bpy.props import FloatProperty, IntProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from ..binding.errors import invalid
from ..binding.volume import Volume
from ..jobs import JobOperator
from ..scene import sources, splat_data, volumes


class STIPPLE_OT_splats_to_volume(JobOperator, bpy.types.Operator, ExportHelper):
    """Turn the selected splats into a volume of density and color"""

    bl_idname = 'stipple.splats_to_volume'
    bl_label = "Splats to Volume"
    bl_options = {'REGISTER', 'UNDO', 'PRESET'}

    filename_ext = '.vdb'
    filter_glob: StringProperty(default='*.vdb', options={'HIDDEN'})
    resolution: IntProperty(name="Resolution", description="Voxels along the longest side, where Voxel Size is 0",
                            default=256, soft_min=8, soft_max=2048)
    voxel_size: FloatProperty(name="Voxel Size", description="Side of a voxel, 0 to take the resolution", default=0.0,
                              soft_min=0.0, subtype='DISTANCE', unit='LENGTH', precision=4)

    @classmethod
    def poll(cls, context):
        return any(splat_data.is_splat_object(obj) for obj in context.view_layer.objects.selected)

    def start(self, context):
        self._path = bpy.path.abspath(self.filepath)
        if not self._path.lower().endswith('.vdb'):
            raise invalid(f"'{self._path}' does not end in .vdb, which a volume file must.")
        depsgraph = context.evaluated_depsgraph_get()
        objects = [o.evaluated_get(depsgraph) for o in context.view_layer.objects.selected if splat_data.is_splat_object(o)]
        instances = [(sources.cloud_from_object(obj), obj.matrix_world) for obj in objects]
        return Volume.voxelize_start(sources.context(), instances, self.resolution, self.voxel_size)

    def finish(self, context, job):
        volume = job.volume()
        volume.save(self._path)
        name = os.path.splitext(os.path.basename(self._path))[0]
        info = volume.info()
        volumes.new_object(name, self._path, context.collection, info.voxel_size)
        self.report({'INFO'}, f"{info.active_voxel_count:,} voxels of {info.voxel_size:.4g} m in '{self._path}'")


classes = (STIPPLE_OT_splats_to_volume,)
