# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes in which something moves, that make_moving.py films.

A scene is a function that builds it and returns (movers, pose): the objects that move, and a function of a frame
0..59 that puts them where they are then. Nothing else changes.
"""

import math
import random

import bpy
from mathutils import Matrix
from photo_scenes import give, round_walls, stretch, sun

FRAMES = 60


def stage():
    """What stands still: a floor, walls far away, a few things on the floor."""
    mesh = bpy.ops.mesh
    mesh.primitive_plane_add(size=12)
    give('ShaderNodeTexVoronoi', 2.5, (0.05, 0.08, 0.15), (0.6, 0.5, 0.35))
    mesh.primitive_cube_add(size=0.7, location=(-1.3, 0.9, 0.35), rotation=(0, 0, 0.5))
    give('ShaderNodeTexVoronoi', 6, (0.3, 0.1, 0.05), (0.9, 0.7, 0.4))
    mesh.primitive_monkey_add(size=0.9, location=(1.3, 1.0, 0.45), rotation=(-0.5, 0, -0.5))
    bpy.context.object.modifiers.new('Smooth', 'SUBSURF').render_levels = 2
    give('ShaderNodeTexNoise', 4, (0.1, 0.3, 0.1), (0.8, 0.9, 0.3))
    mesh.primitive_cylinder_add(radius=0.25, depth=1.5, location=(0, 1.5, 0.75))
    give('ShaderNodeTexNoise', 5, (0.1, 0.1, 0.35), (0.6, 0.7, 0.95))
    round_walls()
    sun()


def _moves_alone(build):
    """The object that `build` adds."""
    build()
    return bpy.context.object


def _show(obj, shown):
    obj.hide_render = not shown


def crossing():
    """Two things cross quickly, one after the other; most of the time nothing moves."""
    stage()
    mesh = bpy.ops.mesh
    ball = _moves_alone(lambda: mesh.primitive_uv_sphere_add(radius=0.4, segments=48, ring_count=24))
    give('ShaderNodeTexVoronoi', 5, (0.7, 0.05, 0.02), (0.95, 0.85, 0.3))
    ring = _moves_alone(lambda: mesh.primitive_torus_add(major_radius=0.35, minor_radius=0.13))
    give('ShaderNodeTexNoise', 7, (0.02, 0.2, 0.4), (0.3, 0.9, 0.9))

    def pose(frame):
        part = (frame - 14) / 12  # 12 frames on the way
        _show(ball, 0 <= part <= 1)
        ball.location = (-2.4 + 4.8 * part, -0.3, 0.4 + 1.6 * part * (1 - part))
        ball.rotation_euler = (0, 6 * part, 0)
        part = (frame - 36) / 14
        _show(ring, 0 <= part <= 1)
        ring.location = (2.4 - 4.8 * part, -0.9, 0.9)
        ring.rotation_euler = (1.2 + 3 * part, 0, 4 * part)

    return [ball, ring], pose


def walker():
    """A figure walks from one side to the other."""
    stage()
    mesh = bpy.ops.mesh
    parts = {}

    def part(name, size, texture):
        """A box with rounded edges whose upper end is its origin."""
        mesh.primitive_cube_add(size=1)
        obj = bpy.context.object
        stretch(size)
        obj.data.transform(Matrix.Translation((0, 0, -size[2] / 2)))
        bevel = obj.modifiers.new('Round', 'BEVEL')
        bevel.width, bevel.segments = 0.04, 3
        give(*texture)
        parts[name] = obj

    cloth = 'ShaderNodeTexVoronoi', 8, (0.05, 0.1, 0.4), (0.5, 0.6, 0.9)
    trousers = 'ShaderNodeTexNoise', 8, (0.1, 0.07, 0.05), (0.45, 0.35, 0.3)
    skin = 'ShaderNodeTexNoise', 4, (0.6, 0.35, 0.25), (0.9, 0.7, 0.55)
    part('trunk', (0.26, 0.42, 0.6), cloth)
    part('head', (0.24, 0.24, 0.28), skin)
    for side in 'lr':
        part('thigh.' + side, (0.16, 0.16, 0.42), trousers)
        part('shin.' + side, (0.14, 0.14, 0.42), trousers)
        part('upper.' + side, (0.11, 0.11, 0.32), cloth)
        part('lower.' + side, (0.1, 0.1, 0.32), skin)

    def pose(frame):
        stride = 2 * math.pi * frame / 24  # a step with each foot each second
        x, hip = -1.9 + 3.8 * frame / (FRAMES - 1), 0.84 + 0.02 * math.cos(2 * stride)
        parts['trunk'].location = (x, -0.6, hip + 0.6)
        parts['trunk'].rotation_euler = (0, 0.06, 0.08 * math.sin(stride))
        parts['head'].location = (x + 0.03, -0.6, hip + 0.92)
        for side, sign in (('l', 1), ('r', -1)):
            swing = 0.5 * math.sin(stride) * sign
            bend = 0.55 * max(0, math.sin(stride + 1.3 * sign) * sign) + 0.1
            y = -0.6 + 0.12 * sign
            chain = ('thigh.' + side, 'shin.' + side), (x, y, hip), 0.42, (-swing, -swing + bend)
            arm = (('upper.' + side, 'lower.' + side), (x, -0.6 + 0.28 * sign, hip + 0.57), 0.32,
                   (swing * 0.9, swing * 0.9 - 0.35))
            for (upper, lower), place, length, (first, second) in (chain, arm):
                parts[upper].location, parts[upper].rotation_euler = place, (0, first, 0)
                end = (place[0] - length * math.sin(first), place[1], place[2] - length * math.cos(first))
                parts[lower].location, parts[lower].rotation_euler = end, (0, second, 0)

    return list(parts.values()), pose


def appearing():
    """Things appear and vanish; each stays where it is for 6 to 24 frames."""
    stage()
    dice = random.Random(7)
    mesh = bpy.ops.mesh
    kinds = (lambda at: mesh.primitive_cube_add(size=0.4, location=at, rotation=(0.4, 0.3, dice.uniform(0, 3))),
             lambda at: mesh.primitive_uv_sphere_add(radius=0.26, location=at),
             lambda at: mesh.primitive_torus_add(major_radius=0.24, minor_radius=0.09, location=at, rotation=(1, 0, 1)),
             lambda at: mesh.primitive_cone_add(radius1=0.26, depth=0.5, location=at))
    things = []
    for number in range(14):
        at = dice.uniform(-1.6, 1.6), dice.uniform(-1.3, 0.5), dice.uniform(0.3, 1.4)
        thing = _moves_alone(lambda: kinds[number % 4](at))
        dark = [dice.uniform(0, 0.4) for _ in range(3)]
        give('ShaderNodeTexVoronoi' if number % 2 else 'ShaderNodeTexNoise', 7, dark,
             [min(1, value + dice.uniform(0.3, 0.6)) for value in dark])
        first = dice.randrange(0, FRAMES - 6)
        things.append((thing, first, first + dice.randrange(6, 25)))

    def pose(frame):
        for thing, first, end in things:
            _show(thing, first <= frame < end)

    return [thing for thing, _, _ in things], pose


SCENES = {'crossing': crossing, 'walker': walker, 'appearing': appearing}
