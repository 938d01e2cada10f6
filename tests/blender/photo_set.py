# SPDX-License-Identifier: GPL-3.0-or-later
"""A data set as nerfstudio and NeRF-synthetic have it: pictures of an object, and where their cameras stood."""

import json
import math

import bpy
import numpy as np


def write(rigs, capture, source, folder, count, settings, scene_frames=()):
    """In: the add-on's modules view_rigs and view_capture, the object, CaptureSettings. scene_frames: cam00/0000.png and so
    on are of these, and the list has the first ones."""
    folder.mkdir()
    graph = bpy.context.evaluated_depsgraph_get()
    poses = rigs.poses('AROUND', bpy.context.scene, graph, rigs.bounds_of([source], graph), count, seed=3)
    frames = []
    with capture.Capture(bpy.context, [source], settings) as views:
        for i, pose in enumerate(poses):
            paths = [f'cam{i:02d}/{k:04d}.png' for k in range(len(scene_frames))] or [f'{i:03d}.png']
            for k, path in enumerate(paths):
                if scene_frames:
                    bpy.context.scene.frame_set(scene_frames[k])
                seen = views.pose(f'{i:03d}', pose).linear[::-1]
                straight = np.clip(seen[..., :3] / np.maximum(seen[..., 3:], 1e-6), 0, 1)
                shown = np.where(straight <= 0.0031308, 12.92 * straight, 1.055 * straight ** (1 / 2.4) - 0.055)
                (folder / path).parent.mkdir(exist_ok=True)
                save(shown, folder / path, seen[..., 3])
            frames.append({'file_path': paths[0], 'transform_matrix': [list(row) for row in pose.matrix]})
    side = settings.size
    length = 0.5 * side / math.tan(0.5 * poses[0].angle)
    (folder / 'transforms.json').write_text(json.dumps(
        {'w': side, 'h': side, 'fl_x': length, 'fl_y': length, 'cx': side / 2, 'cy': side / 2, 'frames': frames}))


def save(colours, path, alpha=None):
    """In: colours [H,W,3] display, row 0 = bottom."""
    height, width = colours.shape[:2]
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = colours
    if alpha is not None:
        pixels[..., 3] = alpha
    image = bpy.data.images.new('saved', width, height, alpha=True)
    image.pixels.foreach_set(pixels.reshape(-1))
    image.filepath_raw, image.file_format = str(path), 'PNG'
    image.save()
    bpy.data.images.remove(image)
