# SPDX-License-Identifier: GPL-3.0-or-later
"""Sparse volumes of extinction and colour."""

from ctypes import byref

from .errors import invalid
from .handle import Handle, new_handle, path_bytes
from .job import Job
from .renderer import instance_array
from .structs import StippleVolumeInfo, StippleVolumeToMeshOptions, StippleVoxelizeOptions


class Volume(Handle):
    free_function = 'stipple_volume_free'
    job_function = 'stipple_job_volume'

    @staticmethod
    def voxelize_start(context, instances, resolution=256, voxel_size=0.0):
        """A job that makes a Volume of instances [(cloud, matrix)]. voxel_size 0: from resolution."""
        Volume.check_settings(resolution, voxel_size)
        options = StippleVoxelizeOptions()
        context.library.stipple_voxelize_options_init(byref(options))
        options.resolution, options.voxel_size = resolution, voxel_size
        array = instance_array(instances)
        return Job(context.library, new_handle(context.library, 'stipple_voxelize_start', context.pointer, array,
                                               len(instances), byref(options)),
                   keep=(array, [cloud for cloud, _ in instances]))

    @staticmethod
    def check_settings(resolution, voxel_size):
        """Refuses what voxelize_start would."""
        if voxel_size < 0:
            raise invalid(f'Voxel size is {voxel_size:g} m; allowed are 0 (from the resolution) and above.')
        if not 1 <= resolution <= 65536:
            raise invalid(f'Resolution is {resolution}; allowed are 1 to 65,536.')

    @classmethod
    def load(cls, context, path):
        return cls(context.library,
                   new_handle(context.library, 'stipple_volume_load', context.pointer, path_bytes(path)))

    def mesh_start(self, opacity=0.5, adaptivity=0.0, largest_only=False):
        """A job that makes a Mesh: the closed surface where a voxel has this opacity, 0..1."""
        options = StippleVolumeToMeshOptions()
        self.library.stipple_volume_to_mesh_options_init(byref(options))
        options.opacity, options.adaptivity, options.largest_only = opacity, adaptivity, int(largest_only)
        return Job(self.library, new_handle(self.library, 'stipple_volume_to_mesh_start', self.pointer, byref(options)))

    def info(self):
        info = StippleVolumeInfo()
        self._check(self.library.stipple_volume_info(self.pointer, byref(info)))
        return info

    def save(self, path):
        self._check(self.library.stipple_volume_save(self.pointer, path_bytes(path)))
