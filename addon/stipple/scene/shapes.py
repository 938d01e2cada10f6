# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that cut splats: boxes and closed meshes."""

import numpy as np

from .. import version
from ..binding.errors import invalid
from ..binding.mesh import Mesh
from . import meshes
from .source import placement, splat_data


def cutters(context):
    """Selected objects that are no splats."""
    return [obj for obj in context.view_layer.objects.selected if not splat_data.is_splat_object(obj)]


def box_matrix(obj):
    """[4,4] from the cube -1..1 to the world: an empty as it is drawn, else the object's own bounding box.

    Errors: StippleError for a box that is flat.
    """
    if obj.type == 'EMPTY':
        half, centre = np.full(3, obj.empty_display_size), np.zeros(3)
    else:
        corners = np.array([corner[:] for corner in obj.bound_box], np.float64)
        low, high = corners.min(axis=0), corners.max(axis=0)
        half, centre = (high - low) / 2, (high + low) / 2
    local = np.diag([*half, 1.0])
    local[:3, 3] = centre
    matrix = np.array(obj.matrix_world, np.float64) @ local
    if placement.is_flat(matrix):
        raise invalid(f"The box of '{obj.name}' is flat; one with some extent along each axis is needed.")
    return matrix


def bare_mesh(context, objects, depsgraph, may_be_empty=False):
    """Triangles of objects and of what they instance, as one native mesh in the world, without colours.

    Errors: StippleError for objects without faces; with may_be_empty, None.
    """
    wanted, mesh, count = set(objects), Mesh.create(context), 0
    for entry in depsgraph.object_instances:
        owner = entry.parent.original if entry.is_instance else entry.object.original
        if owner not in wanted or entry.object.type not in meshes.MESH_LIKE:
            continue
        matrix = version.copy_of_evaluated_matrix(entry.matrix_world)
        temporary = entry.object.to_mesh()
        try:
            if temporary is None:
                continue
            positions, triangles = mesh_arrays(temporary)
        finally:
            entry.object.to_mesh_clear()
        if len(triangles):
            mesh.add_part(positions, triangles, matrix)
            count += len(triangles)
    if count == 0 and may_be_empty:
        return None
    if count == 0:
        raise invalid('No mesh with faces is selected; select one along with the splats.')
    return mesh


def mesh_arrays(mesh):
    """(positions [V,3], triangles [T,3]) of a mesh of Blender."""
    mesh.calc_loop_triangles()
    triangles = np.empty(len(mesh.loop_triangles) * 3, np.int32)
    mesh.loop_triangles.foreach_get('vertices', triangles)
    positions = np.empty(len(mesh.vertices) * 3, np.float32)
    mesh.vertices.foreach_get('co', positions)
    return positions.reshape(-1, 3), triangles.reshape(-1, 3)
