# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that stand in for splats: shadows, collisions, snapping."""

import bpy
import numpy as np
from mathutils import Matrix

# What a mesh of splats is for.
PURPOSES = (('PLAIN', "Mesh", "An ordinary mesh"),
            ('CATCHER', "Shadow Catcher", "Cycles shows only the shadows and reflections that fall on it"),
            ('CASTER', "Shadow Caster", "It casts shadows on other objects, and the camera does not see it"),
            ('HIDDEN', "Collision", "For physics and snapping: hidden in renders, and so from exports of what renders"))


def relative_to(origin, matrix):
    """A 4x4 matrix to the world moved so that a point [3] of the world becomes the origin."""
    moved = np.array(matrix, np.float64)
    moved[:3, 3] -= origin
    return moved


def new_object(name, positions, triangles, matrix, collection, purpose):
    """A mesh object. positions [V,3]: in the world, from the origin of the 4x4 matrix of the new object."""
    matrix = np.array(matrix, np.float64)
    local = positions.astype(np.float64) @ np.linalg.inv(matrix[:3, :3]).T
    if np.linalg.det(matrix[:3, :3]) < 0:
        triangles = triangles[:, ::-1]  # a mirrored frame turns faces around
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(local.tolist(), [], triangles.tolist())
    mesh.update()
    obj = bpy.data.objects.new(name, mesh)
    collection.objects.link(obj)
    obj.matrix_world = Matrix(matrix.tolist())
    if purpose != 'PLAIN':
        obj.display_type = 'WIRE'
    obj.is_shadow_catcher = purpose == 'CATCHER'
    obj.visible_camera = purpose != 'CASTER'
    obj.hide_render = purpose == 'HIDDEN'
    return obj
