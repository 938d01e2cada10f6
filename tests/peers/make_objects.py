#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders objects from all around with Cycles, before nothing: what the quality of fields is measured on.

    blender -b --factory-startup -P make_objects.py -- FOLDER [--views 60] [--size 160]

One data set per object as nerfstudio has them, FOLDER/head, cage and heap: a smooth body, thin rods around an
emptiness, and many small things that hide each other. PNG with alpha, and points as make_photos.py makes them.
"""

import argparse
import json
import math
import random
import sys
from pathlib import Path

import bpy
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).resolve().parent))
from make_photos import POINTS, sample_points, settings  # noqa: E402
from make_scene import write_points  # noqa: E402
from photo_scenes import give  # noqa: E402

DISTANCE = 4.2  # metres
ANGLE = math.radians(40)


def head():
    bpy.ops.mesh.primitive_monkey_add(size=2)
    made = bpy.context.object
    smooth = made.modifiers.new('Smooth', 'SUBSURF')
    smooth.levels = smooth.render_levels = 2
    for polygon in made.data.polygons:
        polygon.use_smooth = True
    give('ShaderNodeTexVoronoi', 5, (0.5, 0.08, 0.03), (0.15, 0.5, 0.8))


def cage():
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3, radius=1.2)
    made = bpy.context.object
    rods = made.modifiers.new('Rods', 'WIREFRAME')
    rods.thickness = 0.09
    give('ShaderNodeTexNoise', 3, (0.05, 0.1, 0.5), (0.95, 0.7, 0.1))
    bpy.ops.mesh.primitive_cube_add(size=0.8, rotation=(0.5, 0.3, 0.8))
    give('ShaderNodeTexVoronoi', 6, (0.02, 0.2, 0.1), (0.9, 0.9, 0.6))


def heap():
    dice = random.Random(7)
    for number in range(90):
        place = Vector([dice.gauss(0, 1) for _ in range(3)]).normalized() * 1.15 * dice.random() ** (1 / 3)
        size = dice.uniform(0.12, 0.3)
        turn = [dice.uniform(0, 3) for _ in range(3)]
        if number % 2:
            bpy.ops.mesh.primitive_cube_add(size=size, location=place, rotation=turn)
        else:
            bpy.ops.mesh.primitive_uv_sphere_add(radius=0.6 * size, location=place, segments=24, ring_count=12)
        shade = [dice.random() for _ in range(3)]
        give('ShaderNodeTexNoise', 8, [0.3 * c for c in shade], shade)


def write_views(folder, given):
    folder.mkdir(parents=True, exist_ok=True)
    bpy.ops.object.light_add(type='SUN', rotation=(0.6, 0.3, 0.2))
    bpy.context.object.data.energy = 2.5
    bpy.context.object.data.angle = 0
    scene = settings(given, transparent=True)
    camera = bpy.data.objects.new('Camera', bpy.data.cameras.new('Camera'))
    scene.collection.objects.link(camera)
    scene.camera = camera
    camera.data.angle = ANGLE
    focal = given.width / 2 / math.tan(ANGLE / 2)
    frames = []
    for view in range(given.views):
        height = 1 - 2 * (view + 0.5) / given.views
        turn = view * math.pi * (3 - math.sqrt(5))
        across = math.sqrt(1 - height * height)
        away = Vector((across * math.cos(turn), across * math.sin(turn), height))
        camera.location = DISTANCE * away
        camera.rotation_euler = (-away).to_track_quat('-Z', 'Y').to_euler()
        bpy.context.view_layer.update()
        path = f'view_{view:02}.png'
        scene.render.filepath = str(folder / path)
        bpy.ops.render.render(write_still=True)
        frames.append((path, camera.matrix_world.copy()))
    write_points(folder / 'points.ply', *sample_points(scene, frames, focal, folder, given))
    (folder / 'transforms.json').write_text(json.dumps(
        {'camera_model': 'OPENCV', 'w': given.width, 'h': given.height, 'fl_x': focal, 'fl_y': focal,
         'cx': given.width / 2, 'cy': given.height / 2, 'ply_file_path': 'points.ply',
         'frames': [{'file_path': path, 'transform_matrix': [list(row) for row in matrix]}
                    for path, matrix in frames]}, indent=1))
    print(f'{POINTS} points, {given.views} views of {given.width} x {given.height} in {folder}')


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('folder', type=Path)
    parser.add_argument('--views', type=int, default=60)
    parser.add_argument('--size', type=int, default=160)
    given = parser.parse_args(sys.argv[sys.argv.index('--') + 1:])
    given.width = given.height = given.size
    for make in (head, cage, heap):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        make()
        write_views(given.folder / make.__name__, given)


if __name__ == '__main__':
    main()
