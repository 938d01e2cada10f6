# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that hide the splats behind them and are not in the picture themselves."""

import numpy as np

from .. import version
from ..binding import mesh as native
from ..binding.errors import StippleError
from ..binding.renderer import EMPTY_DEPTH, Surface
from . import cameras, geometry, meshes, placement, shown, sources, splat_data

# Samples of a pixel along each side, and of a picture that are held at a time (64 MB).
SIDE = 4
MOST_SAMPLES = 16_000_000
LONGEST_SIDE = 65536  # of a native picture, pixels


def gather(depsgraph, only_holdouts=False):
    """[(native mesh, 4x4 object to world)] of all that has faces and that the camera sees.

    Each mesh is read once, however many instances it has. Left out, unless they are holdouts: shadow catchers, which
    stand where splats are, and what the splats that show were made from. Errors: StippleError that names the object.
    """
    made_from = _sources_of_splats(depsgraph)
    read, placed = {}, []
    for entry in depsgraph.object_instances:
        evaluated = entry.object
        owner = entry.parent.original if entry.is_instance else evaluated.original
        if evaluated.type not in meshes.MESH_LIKE or not shown.is_shown(entry):
            continue
        if splat_data.is_splat_object(evaluated) or geometry.carries_splats(evaluated.data):
            continue
        is_holdout = shown.holds_out(entry, depsgraph)
        hides = is_holdout or not (only_holdouts or evaluated.is_shadow_catcher or owner in made_from)
        if not hides or not shown.seen_by_camera(entry, depsgraph):
            continue
        matrix = version.copy_of_evaluated_matrix(entry.matrix_world)
        if placement.is_flat(matrix):
            continue
        key = evaluated.data.as_pointer()
        if key not in read:
            read[key] = _read(evaluated)
        if read[key] is not None:
            placed.append((read[key], matrix))
    return placed


def surface(placed, camera, wait):
    """What they hide as this camera sees them: a Surface.

    Edges are smooth: a pixel is hidden as far as its SIDE x SIDE samples are. wait: called with each job on the way.
    """
    height, width = camera.height, camera.width
    depth, opacity = np.empty((height, width), np.float32), np.empty((height, width), np.float32)
    side = SIDE if max(width, height) * SIDE <= LONGEST_SIDE else 1
    rows = max(1, MOST_SAMPLES // (width * side * side))
    for first in range(0, height, rows):
        count = min(rows, height - first)
        task = native.start_depth(sources.context(), placed, cameras.finer_rows(camera, first, count, side))
        wait(task.job)
        samples = task.depth.reshape(count, side, width, side)
        depth[first:first + count] = _along_last(np.minimum, samples.min(axis=1))
        hits = _along_last(np.add, (samples < EMPTY_DEPTH).sum(axis=1, dtype=np.uint8))
        opacity[first:first + count] = hits / np.float32(side * side)
    return Surface(depth, opacity=opacity)


def _along_last(function, samples):
    """function of all values along the last, short axis: ten times as quick as numpy's reduce, which takes them one by one."""
    result = samples[..., 0]
    for i in range(1, samples.shape[-1]):
        result = function(result, samples[..., i])
    return result


def _sources_of_splats(depsgraph):
    found, splats = set(), shown.SplatObjects(depsgraph)
    for entry in depsgraph.object_instances:
        obj = splats.of(entry)
        if obj is not None:
            data = obj.original.data
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
