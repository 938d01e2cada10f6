# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene at several frames, for fits of splats that move: its frame, what its surfaces are, where cameras are free."""

import math

import numpy as np
from mathutils import Vector
from mathutils.kdtree import KDTree

from ...binding.errors import StippleError, invalid
from ...binding.model import DecodeSettings, Model
from .. import meshes
from ..source import sync
from . import view_rigs, view_times

# Times at which surfaces are looked at, at most: their bounds at all of the first number, points of them at the second.
_LOOKED_AT, _POINTED_AT = 9, 5
# Times at which cameras look for free places, at most: each takes an evaluation of the scene for every round of rays.
_CAST_AT = 3
# Points that tell whether something moves.
_TELLING_POINTS = 512


# A point has neighbours in another set on the same surface nearer than this many times the distance within a set: of
# points by chance one in 1,000 has none, and these are spread more evenly.
_NEAR = 3.0


class Frames:
    """Sets the scene's frame, which is as it was after the `with`. Splats of the scene stay as they are shown."""

    def __init__(self, context):
        self._context, self._scene = context, context.scene
        self._paused = sync.paused()

    def __enter__(self):
        scene = self._scene
        self._before = scene.frame_current, scene.frame_subframe, scene.camera
        self._paused.__enter__()
        return self

    def __exit__(self, *error):
        try:
            frame, subframe, camera = self._before
            self._scene.frame_set(frame, subframe=subframe)
            self._scene.camera = camera  # markers choose one with every frame
        finally:
            self._paused.__exit__(*error)

    def set(self, frame):
        """Evaluates the scene at a frame; returns the depsgraph."""
        whole = math.floor(frame)
        self._scene.frame_set(whole, subframe=frame - whole)
        return self._context.evaluated_depsgraph_get()


class Surfaces:
    """What the surfaces of objects are in the course of a plan."""

    def __init__(self, frames, times):
        self._frames = frames
        self.looked_at = view_times.evenly(times, _LOOKED_AT)
        self.pointed_at = view_times.evenly(self.looked_at, _POINTED_AT)
        self.clouds = []    # SplatArrays of points at these times
        self.frames = []    # [N] of each point: when a surface was there, NaN for at all times that were looked at
        self.bounds = None  # view_rigs.Bounds over all of them
        self.moves = False  # what is known so far

    def look(self, native, objects, seed, point_count, wait):
        """Fills it. wait(job): a generator of how far it is, (_, share, stage). Yields (share, stage). Errors:
        StippleError, also where there is no surface at any of the times."""
        told, problem = [], None
        pointed = self.pointed_at
        for i, frame in enumerate(self.looked_at):
            depsgraph = self._frames.set(frame)
            try:
                self._widen(view_rigs.bounds_of(objects, depsgraph))
            except StippleError as error:
                problem = error
            if frame not in pointed:
                continue
            mesh = meshes.native_mesh(native, objects, depsgraph, 'MATERIAL', may_be_empty=True)
            if mesh is None:
                continue
            job = Model.from_mesh_start(native, mesh, 0.0, seed)
            for _, share, stage in wait(job):
                yield (i + share) / len(self.looked_at), stage
            model = Model.of_job(job)
            told.append(model.decode(DecodeSettings(_TELLING_POINTS, 1, seed=seed)).positions())
            # Of other seeds at other times: what stands still gets points at all of them, and none twice.
            count = max(1, point_count // len(pointed))
            self.clouds.append(model.decode(DecodeSettings(count, 1, seed=seed + i)).read())
            self.frames.append(np.full(len(self.clouds[-1].positions), frame))
        if self.bounds is None or not told:
            raise problem or invalid('No selected object has faces at any frame of the range; at least one is needed.')
        self.moves = len(told) < len(pointed) or any(not np.array_equal(told[0], other) for other in told[1:])
        if len(told) == len(pointed):
            for times, still in zip(self.frames, _still([cloud.positions for cloud in self.clouds])):
                times[still] = np.nan

    def _widen(self, bounds):
        known = self.bounds or bounds
        self.bounds = view_rigs.Bounds(Vector(np.minimum(known.lowest, bounds.lowest)),
                                       Vector(np.maximum(known.highest, bounds.highest)))


def _still(clouds):
    """For each of several sets of points [N,3] of surfaces: which of them have a neighbour in all other sets."""
    trees = [_tree(points) for points in clouds]
    # Points of one set are evenly spread: a surface without any nearer than this is no longer there.
    near = [_NEAR * np.median([tree.find_n(point, 2)[-1][2] for point in points[::max(1, len(points) // 200)]])
            for points, tree in zip(clouds, trees)]
    found = []
    for points in clouds:
        still = np.ones(len(points), bool)
        for tree, reach in zip(trees, near):
            distances = np.array([tree.find(point)[2] for point in points])
            still &= distances <= reach
        found.append(still)
    return found


def _tree(points):
    tree = KDTree(len(points))
    for i, point in enumerate(points):
        tree.insert(point, i)
    tree.balance()
    return tree


class Caster:
    """Casts rays into a scene at several of its frames: what is met first at any of them counts."""

    def __init__(self, scene, frames, times):
        self._scene, self._frames = scene, frames
        self._times = view_times.evenly(times, _CAST_AT)
        self._numbers = view_rigs.Numbers()

    def __call__(self, rays):
        found = None
        for frame in self._times:
            met = view_rigs.Caster(self._scene, self._frames.set(frame), self._numbers)(rays)
            if found is None:
                found = met
                continue
            nearer = met[0] < found[0]
            found = (np.where(nearer, met[0], found[0]), np.where(nearer[:, None], met[1], found[1]),
                     np.where(nearer, met[2], found[2]), met[3])
        return found
