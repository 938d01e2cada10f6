#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders a photo set with Cycles, pictures as nerfstudio has them.

    blender -b --factory-startup -P make_photos.py -- FOLDER [--scene still_life] [--views 57] [--width 464]
        [--height 256]

transforms.json, view_00.png..., and points.ply: places that rays through random pixels meet, a little off, in the
colours of those pixels, as a reconstruction from the photos would have them.
"""

import argparse
import json
import math
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).resolve().parent))
from make_scene import write_points  # noqa: E402
from photo_scenes import SCENES  # noqa: E402

POINTS = 14700
POINT_NOISE = 0.004  # metres
SAMPLES = 8  # edges alone need them


def settings(given, transparent):
    scene = bpy.context.scene
    scene.render.engine = 'CYCLES'
    scene.cycles.device = 'CPU'
    scene.cycles.samples = SAMPLES
    scene.cycles.use_denoising = False  # not every build has a denoiser
    scene.cycles.max_bounces = 0
    scene.render.resolution_x, scene.render.resolution_y = given.width, given.height
    scene.render.use_persistent_data = True
    scene.view_settings.view_transform = 'Standard'
    scene.render.image_settings.file_format = 'PNG'
    scene.render.film_transparent = transparent
    scene.render.image_settings.color_mode = 'RGBA' if transparent else 'RGB'
    return scene


def sample_points(scene, frames, focal, folder, given):
    """([N,3] places, [N,3] display colours) of what random pixels see."""
    dice = np.random.default_rng(3)
    graph = bpy.context.evaluated_depsgraph_get()
    places, shown = [], []
    for view, (path, matrix) in enumerate(frames):
        picture = bpy.data.images.load(str(folder / path))
        pixels = np.empty(given.width * given.height * 4, np.float32)
        picture.pixels.foreach_get(pixels)
        pixels = pixels.reshape(given.height, given.width, 4)[::-1]
        wanted = (view + 1) * POINTS // len(frames) - view * POINTS // len(frames)
        while wanted > 0:
            x, y = dice.uniform(0, given.width), dice.uniform(0, given.height)
            ray = matrix.to_3x3() @ Vector(((x - given.width / 2) / focal, (given.height / 2 - y) / focal, -1))
            hit, place, *_ = scene.ray_cast(graph, matrix.translation, ray.normalized())
            if not hit:
                continue
            places.append(np.array(place) + dice.normal(0, POINT_NOISE, 3))
            shown.append(pixels[int(y), int(x), :3])
            wanted -= 1
        bpy.data.images.remove(picture)
    return np.array(places, np.float32), np.array(shown)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('folder', type=Path)
    parser.add_argument('--scene', choices=SCENES, default='still_life')
    parser.add_argument('--views', type=int, default=57)
    parser.add_argument('--width', type=int, default=464)
    parser.add_argument('--height', type=int, default=256)
    given = parser.parse_args(sys.argv[sys.argv.index('--') + 1:])
    given.folder.mkdir(parents=True, exist_ok=True)
    build, cameras, transparent = SCENES[given.scene]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    build()
    scene = settings(given, transparent)
    camera = bpy.data.objects.new('Camera', bpy.data.cameras.new('Camera'))
    scene.collection.objects.link(camera)
    scene.camera = camera
    camera.data.angle = math.radians(60)
    focal = given.width / 2 / math.tan(math.radians(30))
    frames = []
    for view, (position, target) in enumerate(cameras(given.views)):
        camera.location = position
        camera.rotation_euler = (target - position).to_track_quat('-Z', 'Y').to_euler()
        bpy.context.view_layer.update()
        path = f'view_{view:02}.png'
        scene.render.filepath = str(given.folder / path)
        bpy.ops.render.render(write_still=True)
        frames.append((path, camera.matrix_world.copy()))
    write_points(given.folder / 'points.ply', *sample_points(scene, frames, focal, given.folder, given))
    (given.folder / 'transforms.json').write_text(json.dumps(
        {'camera_model': 'OPENCV', 'w': given.width, 'h': given.height, 'fl_x': focal, 'fl_y': focal,
         'cx': given.width / 2, 'cy': given.height / 2, 'ply_file_path': 'points.ply',
         'frames': [{'file_path': path, 'transform_matrix': [list(row) for row in matrix]}
                    for path, matrix in frames]}, indent=1))
    print(f'{POINTS} points, {given.views} views of {given.width} x {given.height} in {given.folder}')


if __name__ == '__main__':
    main()
