# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that hide the splats behind them and are not in the picture themselves."""

import numpy as np

from .. import version
from ..binding import mesh as native
from ..binding.errors import StippleError
from . import geometry, meshes, sources, splat_data


def gather(depsgraph):
    """[(native mesh, 4x4 object to world)] of all that has faces and that the camera sees.

    Each mesh is read once, however many instances it has. Left out: shadow catchers, which stand where splats are, and
    what the splats that show were made from. Errors: StippleError that names the object.
    """
    made_from = _sources_of_splats(depsgraph)
    read, placed = {}, []
    for entry in depsgraph.object_instances:
        evaluated = entry.object
        owner = entry.parent.original if entry.is_instance else evaluated.original
        if evaluated.type not in meshes.MESH_LIKE or not (entry.show_self or entry.is_instance):
            continue
        if splat_data.is_splat_object(evaluated) or geometry.carries_splats(evaluated.data) or owner in made_from:
            continue
        if not evaluated.visible_camera or evaluated.is_shadow_catcher:
            continue
        matrix = version.copy_of_evaluated_matrix(entry.matrix_world)
        if abs(np.linalg.det(matrix[:3, :3])) == 0.0:
            continue  # scaled to nothing
        key = evaluated.data.as_pointer()
        if key not in read:
            read[key] = _read(evaluated)
        if read[key] is not None:
            placed.append((read[key], matrix))
    return placed


def start_depth(placed, camera):
    """Starts drawing their depth: a DepthTask."""
    return native.start_depth(sources.context(), placed, camera)


def _sources_of_splats(depsgraph):
    found = set()
    for entry in depsgraph.object_instances:
        if splat_data.is_splat_object(entry.object):
            data = entry.object.original.data
            found.update(source.object for source in data.stipple.source_objects if source.object is not None)
    return found


def _read(evaluated):
    """The faces of an evaluated object, or None for none."""
    temporary = evaluated.to_mesh()
    try:
        if temporary is None:
            return None
        temporary.calc_loop_triangles()
        count = len(temporary.loop_triangles)
        if count == 0:
            return None
        triangles = np.empty(count * 3, np.int32)
        temporary.loop_triangles.foreach_get('vertices', triangles)
        positions = np.empty(len(temporary.vertices) * 3, np.float32)
        temporary.vertices.foreach_get('co', positions)
    finally:
        evaluated.to_mesh_clear()
    mesh = native.Mesh.create(sources.context())
    try:
        mesh.add_part(positions.reshape(-1, 3), triangles.reshape(-1, 3), np.eye(4))
    except StippleError as error:
        raise StippleError(f"Object '{evaluated.name}': {error}", error.status) from None
    return mesh
