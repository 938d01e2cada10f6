# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that hide the splats behind them and are not in the image themselves."""

import numpy as np

from ... import version
from ...binding import mesh as native
from ...binding.errors import StippleError
from ...binding.renderer import Surface
from .. import geometry, meshes, shown
from ..source import placement, sources, splat_data

# Samples of a pixel along each side.
SIDE = 4
LONGEST_SIDE = 65536  # of a native image, pixels


def gather(depsgraph, wanted='ALL'):
    """[(native mesh, 4x4 object to world)] of all that has faces and that the camera sees.

    Each mesh is read once, however many instances it has. Left out, unless they are holdouts: shadow catchers, which
    stand where splats are, and what the splats that show were made from. wanted: 'ALL'; 'HOLDOUTS', or the shadow
    'CATCHERS', alone. Errors: StippleError that names the object.
    """
    return [placed for _, _, placed in gather_owned(depsgraph, wanted)]


def gather_owned(depsgraph, wanted='ALL', read_mesh=None):
    """[(owner, object, placed)], placed as gather has it, with the original object, and the original one that it is
    hidden with: itself or its instancer. read_mesh: gives the native mesh of an evaluated object, or None."""
    made_from = _sources_of_splats(depsgraph)
    read_mesh = read_mesh or read
    meshes_read, found = {}, []
    for entry in depsgraph.object_instances:
        evaluated = entry.object
        owner = entry.parent.original if entry.is_instance else evaluated.original
        if evaluated.type not in meshes.MESH_LIKE or not shown.is_shown(entry):
            continue
        if splat_data.is_splat_object(evaluated) or geometry.carries_splats(evaluated.data):
            continue
        kind = 'OTHER'
        if shown.holds_out(entry, depsgraph):
            kind = 'HOLDOUTS'
        elif evaluated.is_shadow_catcher or owner.is_shadow_catcher:
            kind = 'CATCHERS'
        elif owner in made_from:
            continue
        is_wanted = kind != 'CATCHERS' if wanted == 'ALL' else kind == wanted
        if not is_wanted or not shown.seen_by_camera(entry, depsgraph):
            continue
        matrix = version.copy_of_evaluated_matrix(entry.matrix_world)
        if placement.is_flat(matrix):
            continue
        key = evaluated.data.as_pointer()
        if key not in meshes_read:
            meshes_read[key] = read_mesh(evaluated)
        if meshes_read[key] is not None:
            found.append((owner, evaluated.original, (meshes_read[key], matrix)))
    return found


def surface(placed, camera, wait):
    """What they hide as this camera sees them: a Surface.

    Edges are smooth: a pixel is hidden as far as its SIDE x SIDE samples are. wait: called with the job.
    """
    task = start_samples(placed, camera, SIDE if max(camera.width, camera.height) * SIDE <= LONGEST_SIDE else 1)
    wait(task.job)
    return surface_of(task)


def start_samples(placed, camera, side):
    """Starts the same with side x side samples for each pixel."""
    return native.start_matte(sources.context(), placed, camera, side)


def surface_of(task):
    """The Surface of finished samples."""
    return Surface(task.depth, opacity=task.opacity)


def _sources_of_splats(depsgraph):
    found, splats = set(), shown.SplatObjects(depsgraph)
    for entry in depsgraph.object_instances:
        obj = splats.of(entry)
        if obj is not None:
            data = obj.original.data
            found.update(source.object for source in data.stipple.source_objects if source.object is not None)
    return found


def read(evaluated):
    """The native mesh of the faces of an evaluated object, or None for none."""
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
