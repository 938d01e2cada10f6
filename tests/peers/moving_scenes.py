# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes in which something moves, that make_moving.py films.

A scene has a function that builds it and returns (movers, pose): the objects that move, and a function of a frame that
puts them where they are then. Nothing else changes. Cameras stand still where `stands` of their number says.
"""

import math
import random
from dataclasses import dataclass
from typing import Callable

import bpy
from mathutils import Matrix, Vector
from photo_scenes import give, round_walls, stretch, sun

FRAMES, LONG = 60, 480
STEPS_ASIDE = [offset / 10 for offset in range(-5, 6)]  # metres


def arc(count):
    """(place, target) of cameras: an arc of 140 degrees at two heights."""
    for camera in range(count):
        turn = math.radians(-90 - 70 + 140 * camera / (count - 1))
        height = 1.1 if camera % 2 else 2.1
        yield Vector((4.2 * math.cos(turn), 4.2 * math.sin(turn), height)), Vector((0, 0, 0.7))


def ring(count):
    """(place, target) of cameras: a ring at two heights, but for a gap of 60 degrees at +y."""
    for camera in range(count):
        turn = math.radians(120 + 300 * camera / (count - 1))
        height = 1.1 if camera % 2 else 2.1
        yield Vector((4.6 * math.cos(turn), 4.6 * math.sin(turn), height)), Vector((0, 0, 0.7))


@dataclass(frozen=True)
class Scene:
    build: Callable
    frames: int = FRAMES
    stands: Callable = arc


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
    obj.hide_render = obj.hide_viewport = not shown  # rays hit what viewports show


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


def figure():
    """(parts, place): a figure of boxes, and a function of (x, y), heading, stride and swing that puts it somewhere.

    Heading 0 looks along x; a stride of 2 pi is a step with each foot, and swing 1 is how far a walker's legs go.
    """
    mesh = bpy.ops.mesh
    bpy.ops.object.empty_add()
    root = bpy.context.object
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
        obj.parent = root
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

    def place(at, heading, stride, swing=1):
        root.location, root.rotation_euler = (*at, 0), (0, 0, heading)
        hip = 0.84 + 0.02 * math.cos(2 * stride) * swing
        parts['trunk'].location = (0, 0, hip + 0.6)
        parts['trunk'].rotation_euler = (0, 0.06, 0.08 * math.sin(stride))
        parts['head'].location = (0.03, 0, hip + 0.92)
        for side, sign in (('l', 1), ('r', -1)):
            turn = 0.5 * math.sin(stride) * sign * swing
            bend = 0.55 * swing * max(0, math.sin(stride + 1.3 * sign) * sign) + 0.1
            leg = ('thigh.' + side, 'shin.' + side), (0, 0.12 * sign, hip), 0.42, (-turn, -turn + bend)
            arm = (('upper.' + side, 'lower.' + side), (0, 0.28 * sign, hip + 0.57), 0.32,
                   (turn * 0.9, turn * 0.9 - 0.35))
            for (upper, lower), start, length, (first, second) in (leg, arm):
                parts[upper].location, parts[upper].rotation_euler = start, (0, first, 0)
                end = (start[0] - length * math.sin(first), start[1], start[2] - length * math.cos(first))
                parts[lower].location, parts[lower].rotation_euler = end, (0, second, 0)

    return parts, place


def walker():
    """A figure walks from one side to the other."""
    stage()
    parts, place = figure()

    def pose(frame):  # a step with each foot each second
        place((-1.9 + 3.8 * frame / (FRAMES - 1), -0.6), 0, 2 * math.pi * frame / 24)

    return list(parts.values()), pose


def _things(dice, kinds, count, ranges, last_begin, stays):
    """[(object, frame at which it appears, frame at which it is gone)] of things in turn of each kind, anywhere in the
    ranges of x, y and z. stays: least number of frames, and one more than the most."""
    things = []
    for number in range(count):
        at = tuple(dice.uniform(*one) for one in ranges)
        thing = _moves_alone(lambda: kinds[number % len(kinds)](at))
        dark = [dice.uniform(0, 0.4) for _ in range(3)]
        give('ShaderNodeTexVoronoi' if number % 2 else 'ShaderNodeTexNoise', 7, dark,
             [min(1, value + dice.uniform(0.3, 0.6)) for value in dark])
        begin = dice.randrange(0, last_begin)
        things.append((thing, begin, begin + dice.randrange(*stays)))
    return things


def appearing():
    """Things appear and vanish; each stays where it is for 6 to 24 frames."""
    stage()
    dice = random.Random(7)
    mesh = bpy.ops.mesh
    kinds = (lambda at: mesh.primitive_cube_add(size=0.4, location=at, rotation=(0.4, 0.3, dice.uniform(0, 3))),
             lambda at: mesh.primitive_uv_sphere_add(radius=0.26, location=at),
             lambda at: mesh.primitive_torus_add(major_radius=0.24, minor_radius=0.09, location=at, rotation=(1, 0, 1)),
             lambda at: mesh.primitive_cone_add(radius1=0.26, depth=0.5, location=at))
    things = _things(dice, kinds, 14, ((-1.6, 1.6), (-1.3, 0.5), (0.3, 1.4)), FRAMES - 6, (6, 25))

    def pose(frame):
        for thing, first, end in things:
            _show(thing, first <= frame < end)

    return [thing for thing, _, _ in things], pose


def passing():
    """A figure comes in by the gap of the ring, walks around in the room, and leaves by that gap."""
    stage()
    parts, place = figure()
    way = [Vector(at) for at in ((0.7, 6.7), (0.7, 3.2), (2.0, 2.0), (2.1, 0.2), (0.9, -1.1), (-0.9, -1.1), (-2.1, 0.2),
                                 (-2.0, 2.0), (-0.7, 3.2), (-0.7, 6.7))]
    first, last = 24, 408
    lengths = [(b - a).length for a, b in zip(way, way[1:])]
    shown = [obj for obj in parts.values()]

    def along(distance):
        for a, b, length in zip(way, way[1:], lengths):
            if distance <= length:
                return a.lerp(b, max(0, distance) / length)
            distance -= length
        return way[-1]

    def pose(frame):
        distance = sum(lengths) * (frame - first) / (last - first)
        # Corners are rounded by the mean over a step before and a step behind.
        at = sum((along(distance + offset) for offset in STEPS_ASIDE), Vector((0, 0))) / len(STEPS_ASIDE)
        ahead = along(distance + 0.5) - along(distance - 0.5)
        for obj in shown:
            _show(obj, first <= frame <= last)
        if first <= frame <= last:
            place(at, math.atan2(ahead.y, ahead.x), 2 * math.pi * distance / 1.5)

    return shown, pose


def doors():
    """Doors open and close before cupboards, and things appear and vanish; each stays for 1 to 5 seconds."""
    stage()
    dice = random.Random(11)
    mesh = bpy.ops.mesh
    hinges = []
    for number, (x, y, turn) in enumerate(((-1.9, -0.6, 0.6), (1.9, -0.7, -0.5), (0.2, -1.5, 0.0))):
        bpy.ops.object.empty_add(location=(x, y, 0), rotation=(0, 0, turn))
        root = bpy.context.object
        for size, at in (((0.8, 0.05, 1.1), (0, 0.4, 0.55)), ((0.05, 0.4, 1.1), (-0.4, 0.2, 0.55)),
                         ((0.05, 0.4, 1.1), (0.4, 0.2, 0.55)), ((0.85, 0.45, 0.05), (0, 0.2, 1.12))):
            mesh.primitive_cube_add(size=1)
            stretch(size)
            bpy.context.object.parent, bpy.context.object.location = root, at
            give('ShaderNodeTexNoise', 6, (0.25, 0.12, 0.05), (0.7, 0.45, 0.25))
        mesh.primitive_uv_sphere_add(radius=0.18)
        bpy.context.object.parent, bpy.context.object.location = root, (0, 0.2, 0.3 + 0.25 * number)
        give('ShaderNodeTexVoronoi', 8, (0.6, 0.1, 0.1 + 0.3 * number), (0.95, 0.9, 0.3))
        mesh.primitive_cube_add(size=1)
        stretch((0.8, 0.04, 1.1))
        door = bpy.context.object
        door.data.transform(Matrix.Translation((0.4, 0, 0)))  # its left edge is its origin
        door.parent, door.location = root, (-0.4, -0.03, 0.55)
        give('ShaderNodeTexVoronoi', 6, (0.05, 0.2 + 0.1 * number, 0.3), (0.5, 0.8, 0.7 - 0.2 * number))
        hinges.append((door, 30 + 45 * number, 150 + 20 * number))
    kinds = (lambda at: mesh.primitive_cube_add(size=0.4, location=at, rotation=(0.4, 0.3, dice.uniform(0, 3))),
             lambda at: mesh.primitive_uv_sphere_add(radius=0.26, location=at),
             lambda at: mesh.primitive_cone_add(radius1=0.26, depth=0.5, location=at))
    things = _things(dice, kinds, 24, ((-1.5, 1.5), (-1.0, 0.5), (0.3, 1.4)), LONG - 24, (24, 121))

    def pose(frame):
        for door, first, period in hinges:  # a second to open, two open, a second to close
            since = (frame - first) % period if frame >= first else -1
            part = min(1, max(0, since / 24), max(0, (96 - since) / 24))
            door.rotation_euler = (0, 0, -1.9 * part * part * (3 - 2 * part))
        for thing, first, end in things:
            _show(thing, first <= frame < end)

    return [door for door, _, _ in hinges] + [thing for thing, _, _ in things], pose


def breathing():
    """A figure stands and breathes; its arms and its head move a little."""
    stage()
    parts, place = figure()

    def pose(frame):
        breath, sway = math.sin(2 * math.pi * frame / 90), math.sin(2 * math.pi * frame / 132)
        place((0.02 * sway, -0.4), -math.pi / 2 + 0.1 * sway, 0.4 * sway, 0.2)
        parts['trunk'].scale = (1 + 0.06 * breath, 1 + 0.03 * breath, 1)
        parts['head'].rotation_euler = (0, 0.1 * breath, 0.3 * sway)

    return list(parts.values()), pose


SCENES = {'crossing': Scene(crossing), 'walker': Scene(walker), 'appearing': Scene(appearing),
          'passing': Scene(passing, LONG, ring), 'doors': Scene(doors, LONG, arc),
          'breathing': Scene(breathing, LONG, arc)}
