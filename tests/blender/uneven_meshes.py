# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes of very different triangles, which Even Out Mesh evens out."""

import bpy
from mathutils import Vector

PULL = Vector((0.6, -0.5, 0.62))
SIDE, CUTS = 1.4, 16


def pulled_ball():
    """2,562 vertices, one side of which was pulled out, as by the Grab brush."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=5, radius=0.7)
    for vertex in bpy.context.object.data.vertices:
        towards = vertex.co.normalized().dot(PULL.normalized())
        vertex.co += PULL * max(0.0, (towards - 0.6) / 0.4) ** 2
    return bpy.context.object


def crowded_box():
    """1,538 vertices; loop cuts crowd together at one corner."""
    bpy.ops.mesh.primitive_cube_add(size=SIDE)
    box = bpy.context.object
    modifier = box.modifiers.new('Subdivision', 'SUBSURF')
    modifier.levels, modifier.subdivision_type = 4, 'SIMPLE'
    bpy.ops.object.modifier_apply(modifier=modifier.name)
    for vertex in box.data.vertices:
        vertex.co = [SIDE * (value / SIDE + 0.5) ** 2 - SIDE / 2 for value in vertex.co]
    return box
