#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Films a scene in which something moves, by cameras that stand still.

    blender -b --factory-startup -P make_moving.py -- FOLDER --scene walker [--cameras 16] [--step 1] [--width 320]
        [--height 180]
    xvfb-run -a blender --factory-startup -P make_moving.py -- FOLDER --scene passing --flat

Cycles draws the pictures, or with --flat, for long clips, a shader that knows no light (flat_pictures.py).

transforms.json with times (24 frames are a second), cam00/0000.png..., points.ply with times: places that rays through
random pixels meet at every fourth frame and the last one, as reconstructions of those frames would have them. Two
cameras in the middle are held out; moving/ has masks of their pixels in which a render without what moves differs.
Images that are there are kept, so that a run goes on where it ended.
"""

import argparse
import json
import math
import os
import sys
import traceback
from dataclasses import astuple
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).resolve().parent))
from make_photos import POINT_NOISE, settings  # noqa: E402
from make_scene import write_points  # noqa: E402
from moving_scenes import SCENES  # noqa: E402

FRAME_RATE = 24
FRAMES_BETWEEN_POINTS = 4
POINTS_PER_MOMENT = 2000
ANGLE = math.radians(55)
HELD_OUT = 5, 10
LEAST_CHANGE = 3  # of 255, in one channel


def pixels_of(path):
    """[H,W,4] 0..1, row 0 = top."""
    image = bpy.data.images.load(str(path))
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)[::-1]


def render(path, camera):
    bpy.context.scene.camera = camera
    bpy.context.scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def points_of(shots, focal, dice):
    """(places, colours) that rays through random pixels of these pictures meet now."""
    graph = bpy.context.evaluated_depsgraph_get()
    places, shown = [], []
    for number, (path, matrix) in enumerate(shots):
        pixels = pixels_of(path)
        height, width = pixels.shape[:2]
        wanted = (number + 1) * POINTS_PER_MOMENT // len(shots) - number * POINTS_PER_MOMENT // len(shots)
        while wanted > 0:
            x, y = dice.uniform(0, width), dice.uniform(0, height)
            ray = matrix.to_3x3() @ Vector(((x - width / 2) / focal, (height / 2 - y) / focal, -1))
            hit, place, *_ = bpy.context.scene.ray_cast(graph, matrix.translation, ray.normalized())
            if hit:
                places.append(np.array(place) + dice.normal(0, POINT_NOISE, 3))
                shown.append(pixels[int(y), int(x), :3])
                wanted -= 1
    return places, shown


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('folder', type=Path)
    parser.add_argument('--scene', choices=SCENES, default='walker')
    parser.add_argument('--cameras', type=int, default=16)
    parser.add_argument('--step', type=int, default=1)
    parser.add_argument('--width', type=int, default=320)
    parser.add_argument('--height', type=int, default=180)
    parser.add_argument('--flat', action='store_true')
    given = parser.parse_args(sys.argv[sys.argv.index('--') + 1:])
    given.folder.mkdir(parents=True, exist_ok=True)
    if given.flat:  # a new file would close the window
        bpy.data.batch_remove(list(bpy.data.objects))
    else:
        bpy.ops.wm.read_factory_settings(use_empty=True)
    build, length, stands = astuple(SCENES[given.scene])
    movers, pose = build()
    scene = settings(given, False)
    draw = render
    if given.flat:
        from flat_pictures import FlatPictures, paint
        solid = [obj for obj in scene.objects if obj.type == 'MESH']
        paint(solid)
        draw = FlatPictures(solid, movers, given.width, given.height).write
    focal = given.width / 2 / math.tan(ANGLE / 2)
    cameras = []
    for number, (place, target) in enumerate(stands(given.cameras)):
        camera = bpy.data.objects.new(f'cam{number:02}', bpy.data.cameras.new('Camera'))
        camera.data.angle = ANGLE
        camera.location = place
        camera.rotation_euler = (target - place).to_track_quat('-Z', 'Y').to_euler()
        scene.collection.objects.link(camera)
        cameras.append(camera)
    bpy.context.view_layer.update()

    dice = np.random.default_rng(3)
    frames, times, places, shown = [], [], [], []
    for frame in range(0, length, given.step):
        pose(frame)
        bpy.context.view_layer.update()
        shots = []
        for camera in cameras:
            path = given.folder / camera.name / f'{frame:04}.png'
            if not path.exists():
                path.parent.mkdir(exist_ok=True)
                draw(path, camera)
            shots.append((path, camera.matrix_world.copy()))
            frames.append({'file_path': f'{camera.name}/{frame:04}.png', 'time': frame / FRAME_RATE,
                           'transform_matrix': [list(row) for row in camera.matrix_world]})
        if frame % FRAMES_BETWEEN_POINTS == 0 or frame + given.step >= length:
            seen = [shot for number, shot in enumerate(shots) if number not in HELD_OUT]
            found = points_of(seen, focal, dice)
            places += found[0]
            shown += found[1]
            times += [frame / FRAME_RATE] * len(found[0])
    write_points(given.folder / 'points.ply', np.array(places, np.float32), np.array(shown), np.array(times))

    held_out = [camera.name for number, camera in enumerate(cameras) if number in HELD_OUT]
    for mover in movers:
        mover.hide_render = True
    (given.folder / 'moving').mkdir(exist_ok=True)
    for name in held_out:
        draw(given.folder / 'moving' / (name + '.png'), bpy.data.objects[name])
        still = pixels_of(given.folder / 'moving' / (name + '.png'))
        masks = []
        for frame in range(0, length, given.step):
            change = np.abs(pixels_of(given.folder / name / f'{frame:04}.png') - still)[..., :3].max(-1)
            masks.append(change * 255 >= LEAST_CHANGE)
        np.save(given.folder / 'moving' / (name + '.npy'), np.array(masks))

    (given.folder / 'transforms.json').write_text(json.dumps(
        {'camera_model': 'OPENCV', 'w': given.width, 'h': given.height, 'fl_x': focal, 'fl_y': focal,
         'cx': given.width / 2, 'cy': given.height / 2, 'ply_file_path': 'points.ply',
         'train_filenames': [f['file_path'] for f in frames if f['file_path'][:5] not in held_out],
         'test_filenames': [f['file_path'] for f in frames if f['file_path'][:5] in held_out],
         'frames': frames}, indent=1))
    print(f'{len(frames)} images of {given.width} x {given.height}, {len(places)} points in {given.folder}')


def main_in_window():
    """Ends Blender, too, which would stay."""
    failed = 1
    try:
        main()
        failed = 0
    except Exception:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        os._exit(failed)


if __name__ == '__main__' and bpy.app.background:
    main()
elif __name__ == '__main__':
    bpy.app.timers.register(main_in_window, first_interval=0.5)
