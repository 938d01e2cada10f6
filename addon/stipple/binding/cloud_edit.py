# SPDX-License-Identifier: GPL-3.0-or-later
"""Choosing splats by masks, joining clouds, level ground and scale.

A mask is a uint8 array [N]: 1 for a splat that stays. Masks of one cloud compose by `&`.
"""

from ctypes import byref, c_double, c_uint64
from dataclasses import dataclass

import numpy as np

from .cloud import Cloud
from .errors import check, invalid
from .handle import contiguous, matrix16, new_handle, pointer_to
from .job import Job
from .renderer import instance_array
from .structs import (Frame, Side, StippleFloaterOptions, StippleFloaterReport, StippleGroundPlane,
                      StippleGroundPlaneOptions)


@dataclass(frozen=True)
class FloaterSettings:
    by_opacity: bool = True
    by_size: bool = True
    by_connectivity: bool = True
    min_opacity: float = 0.02
    max_size: float = 0.0      # metres; 0: from the cloud's own sizes
    radius: float = 0.0        # metres; 0: from the splats' distances
    min_group_count: int = 0   # 0: from the number of splats


class MaskTask:
    """A mask in the making: wait for `job`, then read `mask` (and `report`)."""

    def __init__(self, job, mask, report=None):
        self.job = job
        self.mask = mask
        self.report = report


def _new_mask(cloud):
    return np.empty(cloud.info().count, np.uint8)


def select_box(cloud, cloud_to_box, side=Side.INSIDE):
    """The mask of splats in the cube -1..1 of the frame that the 4x4 matrix leads to, or of the others."""
    mask = _new_mask(cloud)
    check(cloud.library, cloud.library.stipple_cloud_select_box(cloud.pointer, matrix16(cloud_to_box), int(side),
                                                                pointer_to(mask), len(mask), None))
    return mask


def clipped(cloud, planes):
    """The cloud without splats whose centre lies above 0 of one of the planes [n,4] in its own space."""
    positions = cloud.positions()
    mask = np.ones(len(positions), np.uint8)
    for plane in np.asarray(planes, np.float64):
        mask &= positions @ plane[:3].astype(np.float32) + np.float32(plane[3]) <= 0
    return cloud if mask.all() else keep(cloud, mask)


def select_mesh_start(cloud, cloud_to_mesh, mesh, side=Side.INSIDE):
    """A task for the mask of splats inside a mesh, or of the others."""
    mask, count = _new_mask(cloud), c_uint64()
    job = Job(cloud.library, new_handle(cloud.library, 'stipple_cloud_select_mesh_start', cloud.pointer,
                                        matrix16(cloud_to_mesh), mesh.pointer, int(side), pointer_to(mask), len(mask),
                                        byref(count)), keep=(mask, count))
    return MaskTask(job, mask)


def select_floaters_start(cloud, settings=FloaterSettings()):
    """A task whose mask is 0 for floaters; its report has the counts."""
    if settings.min_group_count < 0:
        raise invalid(f'Smallest group is {settings.min_group_count} splats; allowed are 0 and above.')
    options = StippleFloaterOptions()
    cloud.library.stipple_floater_options_init(byref(options))
    options.by_opacity, options.by_size = int(settings.by_opacity), int(settings.by_size)
    options.by_connectivity = int(settings.by_connectivity)
    options.min_opacity, options.max_size = settings.min_opacity, settings.max_size
    options.radius, options.min_group_count = settings.radius, settings.min_group_count
    mask, report = _new_mask(cloud), StippleFloaterReport()
    job = Job(cloud.library, new_handle(cloud.library, 'stipple_cloud_select_floaters_start', cloud.pointer,
                                        byref(options), pointer_to(mask), len(mask), byref(report)),
              keep=(mask, report))
    return MaskTask(job, mask, report)


def keep(cloud, mask):
    """The cloud of the splats whose mask is not 0."""
    mask = contiguous(mask, np.uint8)
    return Cloud(cloud.library, new_handle(cloud.library, 'stipple_cloud_keep', cloud.pointer, pointer_to(mask),
                                           len(mask)))


def thin(cloud, count, seed=0):
    """Exactly count splats of a cloud, chosen by their index alone and widened to keep the volume of all."""
    if count < 0:
        raise invalid(f'Splats to keep are {count}; allowed are 0 and above.')
    return Cloud(cloud.library, new_handle(cloud.library, 'stipple_cloud_thin', cloud.pointer, count, seed))


def merge(instances, frame=Frame.UNKNOWN):
    """One cloud of [(cloud, 4x4 matrix)]; frame: what the matrices lead to."""
    if not instances:
        raise invalid('There is nothing to merge; at least one cloud is needed.')
    library = instances[0][0].library
    return Cloud(library, new_handle(library, 'stipple_cloud_merge', instance_array(instances), len(instances),
                                     int(frame)))


def ground_plane(cloud, cloud_to_world, up=(0.0, 0.0, 1.0), max_tilt=None, tolerance=0.0, seed=0):
    """The floor as a StippleGroundPlane. max_tilt: radians, None for the library's own; up (0, 0, 0): unknown."""
    options = StippleGroundPlaneOptions()
    cloud.library.stipple_ground_plane_options_init(byref(options))
    options.up = (c_double * 3)(*up)
    if max_tilt is not None:
        options.max_tilt = max_tilt
    options.tolerance, options.seed = tolerance, seed
    plane = StippleGroundPlane()
    check(cloud.library, cloud.library.stipple_cloud_ground_plane(cloud.pointer, matrix16(cloud_to_world),
                                                                  byref(options), byref(plane)))
    return plane


def matrix_of(plane):
    """The 4x4 matrix of a StippleGroundPlane, which levels it."""
    return np.array(plane.matrix).reshape(4, 4)


def level_points(library, points, up=(0.0, 0.0, 1.0)):
    """The rigid 4x4 matrix that brings the plane through three points to z = 0."""
    return _matrix_of(library, library.stipple_level_points, _doubles(points, 9), _doubles(up, 3))


def scale_points(library, points, length):
    """The 4x4 scale about the origin that makes two points this far apart."""
    return _matrix_of(library, library.stipple_scale_points, _doubles(points, 6), length)


def _doubles(values, count):
    flat = np.asarray(values, np.float64).reshape(-1)
    if len(flat) != count:
        raise invalid(f'{len(flat)} coordinates were given; {count} are needed.')
    return (c_double * count)(*flat)


def _matrix_of(library, function, *arguments):
    matrix = (c_double * 16)()
    check(library, function(*arguments, matrix))
    return np.array(matrix).reshape(4, 4)
