# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats that a mesh carries along as it deforms."""

from ctypes import byref

import numpy as np

from .cloud import Cloud
from .errors import check, invalid
from .handle import Handle, contiguous, new_handle, path_bytes, pointer_to
from .job import Job
from .structs import BindingReach, StippleBindingInfo, StippleRestInfo


class SurfaceBinding(Handle):
    """How the splats of a cloud follow a mesh."""

    free_function = 'stipple_binding_free'
    job_function = 'stipple_job_binding'

    @staticmethod
    def start(cloud, rest, triangles, reach=BindingReach.SURFACE):
        """A job that binds splats to a mesh at rest. In: rest [V,3] in the frame of the cloud, triangles [T,3]."""
        rest, triangles = _places(rest), contiguous(triangles, np.uint32).reshape(-1, 3)
        return Job(cloud.library,
                   new_handle(cloud.library, 'stipple_cloud_bind_start', cloud.pointer, pointer_to(rest), len(rest),
                              pointer_to(triangles), len(triangles), int(reach)))

    def info(self):
        info = StippleBindingInfo()
        self._check(self.library.stipple_binding_info(self.pointer, byref(info)))
        return info

    def carry(self, cloud, deformed):
        """The splats as the mesh carries them at another shape. In: the cloud that was bound, or one of the same
        splats; deformed [V,3]. Errors: StippleError for other numbers of splats or vertices."""
        deformed = _places(deformed)
        return Cloud(self.library, new_handle(self.library, 'stipple_cloud_carry', cloud.pointer, self.pointer,
                                              pointer_to(deformed), len(deformed)))


def bind_asset(context, path, rest, triangles, reach, out):
    """Writes an asset file once more with a mesh at rest that its splats follow: rest [V,3] in their frame, triangles
    [T,3]."""
    rest, triangles = _places(rest), contiguous(triangles, np.uint32).reshape(-1, 3)
    check(context.library,
          context.library.stipple_asset_bind(context.pointer, path_bytes(path), pointer_to(rest), len(rest),
                                             pointer_to(triangles), len(triangles), int(reach), path_bytes(out)))


def asset_rest(context, path):
    """(rest [V,3], triangles [T,3], BindingReach) of the mesh that an asset file brings, None where it brings none."""
    library, info = context.library, StippleRestInfo()
    check(library, library.stipple_asset_rest_info(context.pointer, path_bytes(path), byref(info)))
    if info.vertex_count == 0:
        return None
    rest = np.empty((info.vertex_count, 3), np.float32)
    triangles = np.empty((info.triangle_count, 3), np.uint32)
    check(library, library.stipple_asset_read_rest(context.pointer, path_bytes(path), len(rest), pointer_to(rest),
                                                   len(triangles), pointer_to(triangles)))
    return rest, triangles, BindingReach(info.reach)


def _places(values):
    values = contiguous(values)
    if values.ndim != 2 or values.shape[1] != 3:
        raise invalid(f'The vertices of a mesh have the shape {values.shape}; [V,3] is needed.')
    return values
