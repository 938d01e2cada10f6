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


def plane_over(levelling, lowest, highest, extend):
    """(positions [4,3], triangles [2,3]) of the rectangle at height 0 of the frame that the rigid 4x4 matrix leads to,
    back in the frame that it comes from. lowest, highest [3]: of what it is to lie under, metres; extend: how much
    larger than that it is, as a share."""
    (x0, y0), (x1, y1) = lowest[:2], highest[:2]
    grown_x, grown_y = 0.5 * extend * (x1 - x0), 0.5 * extend * (y1 - y0)
    corners = np.array([(x, y, 0.0, 1.0) for x, y in ((x0 - grown_x, y0 - grown_y), (x1 + grown_x, y0 - grown_y),
                                                      (x1 + grown_x, y1 + grown_y), (x0 - grown_x, y1 + grown_y))])
    return (corners @ np.linalg.inv(levelling).T)[:, :3], np.array([(0, 1, 2), (0, 2, 3)])


def smooth_and_shrink(obj, depth):
    """Shades a mesh of voxels as what it stands for, and moves its surface inwards by so many metres of the world."""
    obj.data.polygons.foreach_set('use_smooth', [True] * len(obj.data.polygons))
    if depth > 0:
        shrink = obj.modifiers.new("Inset", 'DISPLACE')
        shrink.mid_level = 0.0
        shrink.strength = -depth / float(np.mean(np.abs(obj.matrix_world.to_scale())))


def keep_with(obj, parent):
    """Makes an object move along with another, from where it is."""
    obj.parent = parent
    obj.matrix_parent_inverse = parent.matrix_world.inverted()
