# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles of all that a scene renders, as modifiers leave it in renders, at one size; and points on them."""

from dataclasses import dataclass

import bpy
import numpy as np

from ... import version
from ...binding.mesh import Mesh
from .. import geometry, meshes, shown
from ..source import sources, splat_data
from .assets import LeftOutError

_ENGINE = 'STIPPLE_SHAPES'
_MAX_TRIANGLES = 10_000_000
# Of an asset's size and its distance from the origin: single floats place its pixels worse than this.
_LEAST_SIZE = 1e-4
# 1 / golden ratio: with even steps along one side it makes an even lattice of a square.
_GOLDEN = 0.6180339887498949


@dataclass
class Surface:
    """Triangles in a cube of side 1 around the origin."""

    corners: np.ndarray    # [T,3,3] places
    normals: np.ndarray    # [T,3,3] unit, as shading has them
    faces: np.ndarray      # [T,3] unit normals of the triangles themselves
    areas: np.ndarray      # [T]
    centre: np.ndarray     # [3] of the cube in the scene
    size: float            # its side there

    def mesh(self):
        """As a native mesh."""
        mesh = Mesh.create(sources.context())
        mesh.add_part(self.corners.reshape(-1, 3), np.arange(3 * len(self.corners)).reshape(-1, 3), np.eye(4))
        return mesh

    def points(self, count, seed):
        """(places [N,3], shading normals [N,3], triangles [N]), as many for each piece of area as for another.

        Even steps of area are the first coordinate in a triangle and multiples of the golden ratio the second: a
        lattice in each triangle that has many.
        """
        dice = np.random.default_rng(seed)
        ends = np.cumsum(self.areas)
        at = (np.arange(count) + dice.random()) * (ends[-1] / count)
        chosen = np.minimum(np.searchsorted(ends, at, side='right'), len(ends) - 1)
        along = np.clip(1 - (ends[chosen] - at) / np.maximum(self.areas[chosen], 1e-300), 0, 1)
        across = (np.arange(count) * _GOLDEN + dice.random()) % 1
        root = np.sqrt(along)
        weights = np.stack([1 - root, root * (1 - across), root * across], 1)[:, None]
        places = (weights @ self.corners[chosen])[:, 0]
        return places, _unit((weights @ self.normals[chosen])[:, 0], self.faces[chosen]), chosen


def read(scene):
    """The Surface of a scene that has a camera. Errors: LeftOutError where it has none."""
    found, problems = [], []

    class STIPPLE_RE_shapes(bpy.types.RenderEngine):
        bl_idname = _ENGINE
        bl_label = "Stipple Shapes"

        def render(self, depsgraph):
            try:
                found.extend(_parts(depsgraph))
            except LeftOutError as problem:  # Blender would print it
                problems.append(problem)

    engine = scene.render.engine
    bpy.utils.register_class(STIPPLE_RE_shapes)
    try:
        scene.render.engine = _ENGINE
        with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
            bpy.ops.render.render(scene=scene.name)
    finally:
        scene.render.engine = engine
        bpy.utils.unregister_class(STIPPLE_RE_shapes)
    if problems:
        raise problems[0]
    if not found:
        raise LeftOutError('it has no faces')
    return _normalised(*(np.concatenate(arrays) for arrays in zip(*found)))


def _parts(depsgraph):
    """[(corners [T,3,3], normals [T,3,3], faces [T,3])] in the scene."""
    parts, read_meshes, count = [], {}, 0
    for entry in depsgraph.object_instances:
        evaluated = entry.object
        if (evaluated.type not in meshes.MESH_LIKE or not shown.is_shown(entry) or splat_data.is_splat_object(evaluated)
                or geometry.carries_splats(evaluated.data) or not shown.seen_by_camera(entry, depsgraph)):
            continue
        matrix = version.copy_of_evaluated_matrix(entry.matrix_world)
        key = evaluated.data.as_pointer()
        if key not in read_meshes:
            read_meshes[key] = _arrays(evaluated)
        corners, normals = read_meshes[key]
        count += len(corners)
        if count > _MAX_TRIANGLES:
            raise LeftOutError(f'it has more than {_MAX_TRIANGLES:,} triangles')
        if len(corners):
            parts.append(_placed(corners, normals, matrix))
    return parts


def _arrays(evaluated):
    """(corners [T,3,3], normals [T,3,3] or None for flat faces) in object space."""
    mesh = evaluated.to_mesh()
    try:
        if mesh is None:
            return np.zeros((0, 3, 3)), None
        mesh.calc_loop_triangles()
        loops, vertices = (np.empty(len(mesh.loop_triangles) * 3, np.int32) for _ in range(2))
        mesh.loop_triangles.foreach_get('loops', loops)
        mesh.loop_triangles.foreach_get('vertices', vertices)
        loops, vertices = loops.reshape(-1, 3), vertices.reshape(-1, 3)
        places = np.empty(len(mesh.vertices) * 3, np.float32)
        mesh.vertices.foreach_get('co', places)
        return places.reshape(-1, 3).astype(np.float64)[vertices], version.corner_normals(mesh, loops, vertices)
    finally:
        evaluated.to_mesh_clear()


def _placed(corners, normals, matrix):
    corners = corners @ matrix[:3, :3].T + matrix[:3, 3]
    if not np.isfinite(corners).all():
        raise LeftOutError('it has vertices at places that are not finite')
    # Normals go by the cofactors; a matrix that mirrors turns a face's corners round, and not its front.
    x, y, z = matrix[:3, :3].T
    cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], 1)
    side = -1.0 if np.linalg.det(matrix[:3, :3]) < 0 else 1.0
    faces = side * _unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), 0.0)
    flat = np.repeat(faces[:, None], 3, 1)
    return corners, flat if normals is None else _unit(side * normals @ cofactors.T, flat), faces


def _normalised(corners, normals, faces):
    lowest, highest = corners.min((0, 1)), corners.max((0, 1))
    size, centre = float((highest - lowest).max()), (lowest + highest) / 2
    if size <= 0:
        raise LeftOutError('it has no extent')
    if size < _LEAST_SIZE * np.linalg.norm(centre):
        raise LeftOutError(f'it is {size:.3g} large and {np.linalg.norm(centre):.3g} away from the origin, which is '
                           'too far for its size')
    corners = (corners - centre) / size
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    if areas.sum() <= 0:
        raise LeftOutError('its faces have no area')
    return Surface(corners, normals, faces, areas, centre, size)


def _unit(vectors, otherwise):
    """Vectors of length 1; where they have none, others."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(lengths > 1e-300, vectors / np.maximum(lengths, 1e-300), otherwise)
