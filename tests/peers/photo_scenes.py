# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes that make_photos.py photographs: what is in them, and where somebody stands who takes pictures of it.

A scene is (build, cameras, whether the film is transparent); cameras(count) gives (position, target).
"""

import math
import random

import bpy
from mathutils import Vector

AMBIENT = 0.35


def material(name, kind, scale, dark, bright):
    """A Principled material with a noisy base colour between two colours."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    shader = next(node for node in nodes if node.type == 'BSDF_PRINCIPLED')
    shader.inputs['Roughness'].default_value = 0.6
    texture = nodes.new(kind)
    texture.inputs['Scale'].default_value = scale
    ramp = nodes.new('ShaderNodeValToRGB')
    ramp.color_ramp.elements[0].color = (*dark, 1)
    ramp.color_ramp.elements[1].color = (*bright, 1)
    place = nodes.new('ShaderNodeTexCoord')
    links.new(place.outputs['Object'], texture.inputs['Vector'])
    links.new(texture.outputs['Color'], ramp.inputs['Fac'])
    links.new(ramp.outputs['Color'], shader.inputs['Base Color'])
    # A little light of its own instead of a sky's: with a sun alone pictures have no noise.
    glow = nodes.new('ShaderNodeEmission')
    glow.inputs['Strength'].default_value = AMBIENT
    links.new(ramp.outputs['Color'], glow.inputs['Color'])
    both = nodes.new('ShaderNodeAddShader')
    links.new(shader.outputs[0], both.inputs[0])
    links.new(glow.outputs[0], both.inputs[1])
    links.new(both.outputs[0], next(node for node in nodes if node.type == 'OUTPUT_MATERIAL').inputs['Surface'])
    return made


def give(*args):
    obj = bpy.context.object
    obj.data.materials.append(material(obj.name, *args))


def stretch(size):
    """In the mesh, so that textures keep their scale."""
    bpy.context.object.scale = size
    bpy.ops.object.transform_apply(location=False, rotation=False)


def sun():
    bpy.ops.object.light_add(type='SUN', rotation=(0.5, 0.4, 0))
    bpy.context.object.data.energy = 2.5
    bpy.context.object.data.angle = 0


def round_walls():
    bpy.ops.mesh.primitive_uv_sphere_add(radius=6, segments=64, ring_count=32)
    bpy.context.object.visible_shadow = False  # the sun is outside
    give('ShaderNodeTexNoise', 1.5, (0.3, 0.4, 0.6), (0.9, 0.9, 0.8))


def still_life():
    """A table with coarse things on it, in a round room."""
    mesh = bpy.ops.mesh
    mesh.primitive_plane_add(size=12)
    give('ShaderNodeTexVoronoi', 2.5, (0.05, 0.08, 0.15), (0.6, 0.5, 0.35))
    mesh.primitive_cylinder_add(vertices=64, radius=1.6, depth=0.12, location=(0, 0, 0.6))
    give('ShaderNodeTexNoise', 6, (0.2, 0.08, 0.03), (0.7, 0.4, 0.2))
    mesh.primitive_monkey_add(size=0.8, location=(0, 0, 1.1), rotation=(-0.4, 0, 0.6))
    bpy.context.object.modifiers.new('Smooth', 'SUBSURF').render_levels = 2
    give('ShaderNodeTexNoise', 4, (0.6, 0.1, 0.05), (0.9, 0.8, 0.2))
    mesh.primitive_torus_add(location=(0.9, 0.5, 0.76), major_radius=0.3, minor_radius=0.1)
    give('ShaderNodeTexVoronoi', 9, (0.02, 0.2, 0.3), (0.2, 0.8, 0.7))
    mesh.primitive_uv_sphere_add(location=(-0.8, 0.6, 0.95), radius=0.28, segments=48, ring_count=24)
    give('ShaderNodeTexNoise', 9, (0.1, 0.02, 0.3), (0.9, 0.5, 0.9))
    for i, (x, y, turn) in enumerate(((-0.7, -0.7, 0.3), (0.6, -0.9, 1.1), (1.1, -0.2, 0.7))):
        mesh.primitive_cube_add(size=0.3, location=(x, y, 0.81), rotation=(0, 0, turn))
        give('ShaderNodeTexVoronoi', 7, (0.1, 0.1 + 0.2 * i, 0.1), (0.9, 0.9, 0.4 * i))
    round_walls()
    sun()


def fine_texture():
    """One object alone whose texture is about as fine as the pixels of the views."""
    mesh = bpy.ops.mesh
    mesh.primitive_monkey_add(size=1.4, location=(0, 0, 0.9))
    bpy.context.object.modifiers.new('Smooth', 'SUBSURF').render_levels = 2
    give('ShaderNodeTexVoronoi', 28, (0.02, 0.05, 0.2), (0.95, 0.8, 0.5))
    mesh.primitive_cylinder_add(vertices=96, radius=1.2, depth=0.2, location=(0, 0, 0.1))
    give('ShaderNodeTexChecker', 22, (0.05, 0.05, 0.05), (0.9, 0.9, 0.9))
    sun()


def thin_structures():
    """Wires, bars and rings that are a pixel or two wide, before a round wall."""
    mesh = bpy.ops.mesh
    mesh.primitive_plane_add(size=12)
    give('ShaderNodeTexNoise', 1.5, (0.25, 0.2, 0.15), (0.6, 0.55, 0.5))
    mesh.primitive_ico_sphere_add(subdivisions=3, radius=0.8, location=(0, 0, 1.1))
    bpy.context.object.modifiers.new('Wires', 'WIREFRAME').thickness = 0.02
    give('ShaderNodeTexNoise', 2, (0.7, 0.1, 0.05), (0.9, 0.5, 0.1))
    for turn in range(24):
        angle = 2 * math.pi * turn / 24
        mesh.primitive_cylinder_add(vertices=8, radius=0.012, depth=1.2,
                                    location=(1.5 * math.cos(angle), 1.5 * math.sin(angle), 0.6))
        give('ShaderNodeTexNoise', 3, (0.05, 0.2, 0.1), (0.2, 0.6, 0.3))
    for height in (0.3, 0.8, 1.15):
        mesh.primitive_torus_add(location=(0, 0, height), major_radius=1.5, minor_radius=0.012, major_segments=96)
        give('ShaderNodeTexNoise', 3, (0.05, 0.1, 0.3), (0.3, 0.5, 0.9))
    round_walls()
    sun()


def furnished_room():
    """A box room with boxes in it, seen from inside."""
    mesh = bpy.ops.mesh
    mesh.primitive_cube_add(size=1, location=(0, 0, 1.3))
    stretch((5, 4, 2.6))
    bpy.context.object.visible_shadow = False
    give('ShaderNodeTexVoronoi', 3, (0.45, 0.4, 0.5), (0.9, 0.85, 0.7))
    mesh.primitive_plane_add(size=1, location=(0, 0, 0.01))
    stretch((4.9, 3.9, 1))
    give('ShaderNodeTexChecker', 5, (0.25, 0.12, 0.05), (0.6, 0.4, 0.2))
    dice = random.Random(3)
    for box in range(14):
        side = -1 if box % 2 else 1
        size = [dice.uniform(0.2, 0.7), dice.uniform(0.2, 0.5), dice.uniform(0.3, 1.4)]
        mesh.primitive_cube_add(size=1, location=(dice.uniform(-2, 2), side * dice.uniform(1.3, 1.7), size[2] / 2))
        stretch(size)
        dark = [dice.uniform(0, 0.5) for _ in range(3)]
        give('ShaderNodeTexNoise', 5, dark, [value + 0.4 for value in dark])
    sun()


def around(count):
    """As of somebody who walks around a table."""
    dice = random.Random(5)
    for view in range(count):
        turn = 2 * math.pi * 2.2 * view / count
        height = 1.7 + 0.8 * math.sin(5.3 * turn) + 0.15 * dice.uniform(-1, 1)
        distance = 3.3 + 0.4 * dice.uniform(-1, 1)
        yield (Vector((distance * math.cos(turn), distance * math.sin(turn), height)),
               Vector((0.15 * dice.uniform(-1, 1), 0.15 * dice.uniform(-1, 1), 0.8)))


def inside(count):
    """As of somebody who walks along the walls of a room and looks across it."""
    dice = random.Random(9)
    for view in range(count):
        turn = 2 * math.pi * 3.3 * view / count
        place = Vector((1.5 * math.cos(turn), 0.9 * math.sin(turn), 1.4 + 0.3 * dice.uniform(-1, 1)))
        beyond = turn + math.pi + 0.7 * dice.uniform(-1, 1)
        yield place, Vector((2.5 * math.cos(beyond), 2 * math.sin(beyond), 0.9 + 0.5 * dice.uniform(-1, 1)))


SCENES = {
    'still_life': (still_life, around, False),
    'fine_texture': (fine_texture, around, True),
    'thin_structures': (thin_structures, around, False),
    'furnished_room': (furnished_room, inside, False),
}
