# SPDX-License-Identifier: GPL-3.0-or-later
"""Where cameras stand that see a scene from everywhere: around things, or inside a room."""

import math
from dataclasses import dataclass

import numpy as np
from mathutils import Matrix, Vector

from ...binding.errors import invalid

# A place counts as inside a mesh where more than half of these directions meet the back of a face first.
_PROBES = [Vector(p).normalized() for p in
           ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1), (1, 1, 1), (1, 1, -1), (1, -1, 1),
            (1, -1, -1), (-1, 1, 1), (-1, 1, -1), (-1, -1, 1), (-1, -1, -1))]
_GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))
AROUND_ANGLE, INSIDE_ANGLE = math.radians(40), math.radians(75)
# In radii: air between the things and a picture's edge; between a camera in a room and what is nearest; no walls
# of a room are smaller than this share of everything.
_AIR, _CLEARANCE, _WALL_SHARE = 1.05, 0.05, 0.9
_TRIES_PER_VIEW = 64


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

    def holds(self, point):
        return all(low <= x <= high for low, x, high in zip(self.lowest, point, self.highest))


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


def choose(scene, bounds, depsgraph):
    """'INSIDE' where the scene's camera stands between walls, else 'AROUND'."""
    if scene.camera is None:
        return 'AROUND'
    place = scene.camera.matrix_world.translation
    if not bounds.holds(place):
        return 'AROUND'
    hits = sum(scene.ray_cast(depsgraph, place, probe)[0] for probe in _PROBES)
    return 'INSIDE' if 2 * hits > len(_PROBES) else 'AROUND'


def around(scene, depsgraph, bounds, count, seed=0, angle=AROUND_ANGLE):
    """Poses on a sphere, nearly evenly spread, that see all of the bounds; nearer where something stands between, and
    elsewhere on the sphere where a camera would be inside a mesh. Errors: StippleError where no place is left."""
    distance = _AIR * bounds.radius / math.sin(angle / 2)
    poses = []
    for offset in range(_TRIES_PER_VIEW):
        for direction in _sphere(count, seed + offset):
            place = _seen_place(scene, depsgraph, bounds, direction, distance)
            edge = bounds.centre + bounds.radius * direction
            # A room holds the things and the camera alike.
            if place is not None and _around(scene, depsgraph, place) <= _around(scene, depsgraph, edge):
                poses.append(_looking(place, -direction, angle, bounds))
            if len(poses) == count:
                return poses
    raise invalid(f'Only {len(poses)} of {count} cameras around the scene find a place outside of every mesh.')


def inside(scene, depsgraph, bounds, count, seed=0, angle=INSIDE_ANGLE):
    """Poses in the free space between walls, looking everywhere. Errors: StippleError where too little is free."""
    directions = _sphere(count, seed)
    poses, size = [], bounds.highest - bounds.lowest
    for i in range(count * _TRIES_PER_VIEW):
        share = [0.1 + 0.8 * _radical_inverse(i + 1 + 7919 * seed, base) for base in (2, 3, 5)]
        place = bounds.lowest + Vector(s * side for s, side in zip(share, size))
        if _is_free(scene, depsgraph, bounds, place):
            poses.append(_looking(place, directions[len(poses)], angle, bounds))
            if len(poses) == count:
                return poses
    raise invalid(f'Only {len(poses)} of {count} cameras find a free place between walls; cameras around the scene, or '
                  'its own, may suit it better.')


def _sphere(count, seed):
    """Directions of a Fibonacci sphere, turned by the seed."""
    turn = 2 * math.pi * _radical_inverse(seed, 2)
    directions = []
    for i in range(count):
        z = 1 - (2 * i + 1) / count
        flat = math.sqrt(max(0.0, 1 - z * z))
        directions.append(Vector((flat * math.cos(turn + i * _GOLDEN_ANGLE), flat * math.sin(turn + i * _GOLDEN_ANGLE), z)))
    return directions


def _radical_inverse(index, base):
    value, share = 0.0, 1.0 / base
    while index:
        index, digit = divmod(index, base)
        value, share = value + digit * share, share / base
    return value


def _looking(place, direction, angle, bounds):
    rotation = direction.to_track_quat('-Z', 'Y').to_matrix().to_4x4()
    reach = (place - bounds.centre).length + bounds.radius
    return Pose(Matrix.Translation(place) @ rotation, angle, 1e-3 * bounds.radius, 2 * reach)


def _seen_place(scene, depsgraph, bounds, direction, distance):
    """Along a direction from the middle, as far as nothing stands between; None where something is too near."""
    edge = 1.001 * bounds.radius
    is_hit, location, *_ = scene.ray_cast(depsgraph, bounds.centre + edge * direction, direction, distance=distance - edge)
    if is_hit:
        distance = 0.9 * (location - bounds.centre).length
    return bounds.centre + distance * direction if distance > _AIR * edge else None


def _around(scene, depsgraph, place):
    """The objects that the place is inside of."""
    backs = {}
    for probe in _PROBES:
        is_hit, _, normal, _, obj, _ = scene.ray_cast(depsgraph, place, probe)
        if is_hit and normal.dot(probe) > 0:
            backs[obj] = backs.get(obj, 0) + 1
    return {obj for obj, count in backs.items() if 2 * count > len(_PROBES)}


def _is_free(scene, depsgraph, bounds, place):
    """Between walls, away from everything, in nothing that is smaller than the room."""
    hits = 0
    for probe in _PROBES:
        is_hit, location, *_ = scene.ray_cast(depsgraph, place, probe)
        if is_hit and (location - place).length < _CLEARANCE * bounds.radius:
            return False
        hits += is_hit
    return 2 * hits > len(_PROBES) and all(_is_walls(obj, bounds) for obj in _around(scene, depsgraph, place))


def _is_walls(obj, bounds):
    corners = [obj.matrix_world @ Vector(c) for c in obj.bound_box]
    size = [max(c[axis] for c in corners) - min(c[axis] for c in corners) for axis in range(3)]
    return max(s / max(whole, 1e-9) for s, whole in zip(size, bounds.highest - bounds.lowest)) > _WALL_SHARE
