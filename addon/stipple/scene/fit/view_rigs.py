# SPDX-License-Identifier: GPL-3.0-or-later
"""Where cameras stand that see a scene from everywhere: the library says where, Blender what its rays meet."""

import math
from dataclasses import dataclass

import numpy as np
from mathutils import Matrix, Vector

from ...binding.errors import invalid
from ...binding.rig_search import RigSearch
from ...binding.structs import ViewRig
from ..source import sources

RIGS = {'AUTO': ViewRig.AUTOMATIC, 'AROUND': ViewRig.AROUND, 'INSIDE': ViewRig.INSIDE}
_OPENCV_TO_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Pose:
    """A perspective camera in Blender's frame (looks along -z, y up)."""

    matrix: Matrix  # camera to world
    angle: float    # field of view of both sides, radians
    near: float     # metres
    far: float      # metres


@dataclass(frozen=True)
class Bounds:
    lowest: Vector
    highest: Vector

    @property
    def centre(self):
        return (self.lowest + self.highest) / 2

    @property
    def radius(self):
        return max((self.highest - self.lowest).length / 2, 1e-6)


def bounds_of(objects, depsgraph):
    """World bounds of objects as they render, instances included. Errors: StippleError where nothing has a size."""
    wanted, lowest, highest = set(objects), np.full(3, np.inf), np.full(3, -np.inf)
    for entry in depsgraph.object_instances:
        owner = entry.parent.original if entry.is_instance else entry.object.original
        if owner not in wanted or entry.object.type in {'CAMERA', 'LIGHT', 'EMPTY', 'SPEAKER'}:
            continue
        matrix = np.array(entry.matrix_world, np.float64)
        corners = np.array([tuple(c) for c in entry.object.bound_box], np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        if np.isfinite(corners).all():
            lowest, highest = np.minimum(lowest, corners.min(0)), np.maximum(highest, corners.max(0))
    if not np.isfinite(lowest).all():
        raise invalid('There is nothing to look at; at least one visible object with faces is needed.')
    return Bounds(Vector(lowest), Vector(highest))


def poses(rig, scene, depsgraph, bounds, count, seed=0, angle=0.0, cast=None):
    """Poses that see all of the bounds. rig: a key of RIGS; AUTO: inside where the scene's camera stands between walls,
    else around. angle: field of view, radians; 0: as the rig has it. cast: what rays meet, as RigSearch.cameras() asks
    for it; None: in the scene of the depsgraph. Errors: StippleError where no place is left for a camera."""
    viewer = None if scene.camera is None else scene.camera.matrix_world.translation
    search = RigSearch.create(sources.context().library, bounds.lowest, bounds.highest, count, RIGS[rig], seed, angle,
                              viewer)
    return [_pose(camera) for camera in search.cameras(cast or Caster(scene, depsgraph, Numbers()))]


def _pose(camera):
    matrix = np.linalg.inv(np.array(camera.world_to_camera).reshape(4, 4)) @ _OPENCV_TO_OPENGL
    return Pose(Matrix(matrix.tolist()), 2 * math.atan(0.5 * camera.width / camera.fx), camera.near_plane,
                camera.far_plane)


def meets_nothing(rays):
    """A cast of poses() where nothing but the bounds is in the images, so that nothing is in a camera's way."""
    return np.full(len(rays), np.inf), np.zeros((len(rays), 3)), np.zeros(len(rays), np.uint32), np.zeros((0, 3))


class Numbers:
    """Numbers objects as they are met, with the sides of their boxes then."""

    def __init__(self):
        self._numbers, self._sizes = {}, []

    def of(self, obj):
        name = obj.name_full
        if name not in self._numbers:
            self._numbers[name] = len(self._sizes)
            corners = np.array([obj.matrix_world @ Vector(corner) for corner in obj.bound_box])
            self._sizes.append(np.ptp(corners, axis=0))
        return self._numbers[name]

    def sizes(self):
        return np.array(self._sizes).reshape(-1, 3)


class Caster:
    """Casts rays into a scene."""

    def __init__(self, scene, depsgraph, numbers):
        self._scene, self._depsgraph, self._numbers = scene, depsgraph, numbers

    def __call__(self, rays):
        distances, normals = np.full(len(rays), np.inf), np.zeros((len(rays), 3))
        objects = np.zeros(len(rays), np.uint32)
        for i, ray in enumerate(rays):
            limit = {} if math.isinf(ray[6]) else {'distance': ray[6]}
            hit, location, normal, _, obj, _ = self._scene.ray_cast(self._depsgraph, ray[:3], ray[3:6], **limit)
            if hit:
                distances[i] = np.linalg.norm(np.array(location) - ray[:3])
                normals[i], objects[i] = normal, self._numbers.of(obj)
        return distances, normals, objects, self._numbers.sizes()
