#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the data set that peers are timed on: a coloured Suzanne in a room, drawn by Stipple itself.

    make_scene.py FOLDER --splats 14700 --width 256 --height 464

transforms.json and pictures as nerfstudio has them, points.ply (coloured points) for a peer to begin with, and
start.ply: the splats that trainers make of such points, for our side of the comparison.
"""

import argparse
import json
import math
import os
import sys
import types
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
_package = types.ModuleType('stipple')  # without the add-on's own __init__, which needs Blender
_package.__path__ = [str(ROOT / 'addon' / 'stipple')]
sys.modules['stipple'] = _package

from stipple.binding import library  # noqa: E402
from stipple.binding.cloud import Cloud, SplatArrays  # noqa: E402
from stipple.binding.context import Context  # noqa: E402
from stipple.binding.image import Image  # noqa: E402
from stipple.binding.mesh import Mesh  # noqa: E402
from stipple.binding.model import DecodeSettings, Model  # noqa: E402
from stipple.binding.renderer import Renderer  # noqa: E402
from stipple.binding.structs import MaterialColour, OutputColour, Transfer  # noqa: E402
from stipple.binding.views import Views  # noqa: E402

VIEWS = 12
SH_C0 = 0.28209479177387814
START_OPACITY = 0.1  # what trainers begin with


def read_obj(path):
    """(positions [V,3], triangles [T,3]) with Y up turned to Z up."""
    positions, triangles = [], []
    for line in path.read_text().splitlines():
        kind, *values = line.split() or ['']
        if kind == 'v':
            x, y, z = map(float, values[:3])
            positions.append((x, y, z))
        elif kind == 'f':
            triangles.append([int(value.split('/')[0]) - 1 for value in values[:3]])
    return np.array(positions), np.array(triangles)


def room(side):
    """A box seen from inside, each wall of 16 x 16 squares."""
    steps = np.linspace(-side, side, 17)
    corners, triangles = [], []
    for axis in range(3):
        for wall in (-side, side):
            first = len(corners)
            for a in steps:
                for b in steps:
                    corners.append(np.insert([a, b], axis, wall))
            for i in range(16):
                for j in range(16):
                    p = first + i * 17 + j
                    triangles += [(p, p + 1, p + 17), (p + 1, p + 18, p + 17)]
    return np.array(corners), np.array(triangles)


def colours(positions):
    """[..., 4] scene linear: waves of a hand's width, so that pictures have something to fit."""
    waves = np.sin(positions * (5.0, 6.0, 7.0) + np.roll(positions, 1, -1) * 2.0)
    return np.concatenate([0.4 + 0.3 * waves, np.ones(positions.shape[:-1] + (1,))], -1)


def add(mesh, positions, triangles):
    material = mesh.add_material(MaterialColour.CORNER)
    mesh.add_part(positions, triangles, np.eye(4), corner_colours=colours(positions[triangles]),
                  triangle_materials=np.full(len(triangles), material))


def write_cameras(folder, width, height):
    frames = []
    for view in range(VIEWS):
        angle = 2 * math.pi * view / VIEWS
        position = np.array([2.6 * math.sin(angle), -2.6 * math.cos(angle), 0.5 * math.sin(3 * angle)])
        back = position / np.linalg.norm(position)  # cameras look along their -z
        right = np.cross([0, 0, 1], back)
        right /= np.linalg.norm(right)
        matrix = np.eye(4)
        matrix[:3, :4] = np.stack([right, np.cross(back, right), back, position], 1)
        frames.append({'file_path': f'view_{view:02}.png', 'transform_matrix': matrix.tolist()})
    focal = 0.75 * height
    (folder / 'transforms.json').write_text(json.dumps(
        {'camera_model': 'OPENCV', 'w': width, 'h': height, 'fl_x': focal, 'fl_y': focal, 'cx': width / 2,
         'cy': height / 2, 'ply_file_path': 'points.ply', 'frames': frames}, indent=1))


def write_points(path, positions, display, times=None):
    """times: seconds of the images in which the points were found."""
    rows = np.empty(len(positions), [('xyz', '<f4', 3), ('rgb', 'u1', 3), *([('time', '<f4')] if times is not None
                                                                            else [])])
    rows['xyz'], rows['rgb'] = positions, np.clip(np.rint(display * 255), 0, 255)
    if times is not None:
        rows['time'] = times
    header = '\n'.join(['ply', 'format binary_little_endian 1.0', f'element vertex {len(rows)}', 'property float x',
                        'property float y', 'property float z', 'property uchar red', 'property uchar green',
                        'property uchar blue', *(['property float time'] if times is not None else []), 'end_header',
                        ''])
    path.write_bytes(header.encode() + rows.tobytes())


def start_splats(positions, display):
    """Round splats as wide as the mean distance to the three nearest points, faint, harmonics of degree 3."""
    p = positions.astype(np.float64)
    scales = np.empty(len(p))
    for i in range(0, len(p), 512):
        block = p[i:i + 512]
        squares = (block ** 2).sum(1)[:, None] + (p ** 2).sum(1) - 2 * block @ p.T
        nearest = np.sqrt(np.maximum(np.partition(squares, 4, 1)[:, :4], 0))
        scales[i:i + 512] = np.sort(nearest, 1)[:, 1:].mean(1)
    count = len(p)
    sh = np.zeros((count, 16, 3))
    sh[:, 0] = (display - 0.5) / SH_C0
    return SplatArrays(positions, np.tile([1.0, 0, 0, 0], (count, 1)), np.repeat(scales[:, None], 3, 1),
                       np.full(count, START_OPACITY), sh)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('folder', type=Path)
    parser.add_argument('--splats', type=int, default=14700)
    parser.add_argument('--width', type=int, default=256)
    parser.add_argument('--height', type=int, default=464)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    file = os.environ.get(library.ENVIRONMENT_VARIABLE) or ROOT / 'build' / 'release' / 'lib' / 'libstipple.so'
    context = Context(library.load(file))

    mesh = Mesh.create(context)
    add(mesh, *read_obj(ROOT / 'tests' / 'data' / 'suzanne.obj'))
    add(mesh, *room(4.0))
    job = Model.from_mesh_start(context, mesh)
    job.wait()
    model = Model.of_job(job)
    # The pictures are of more splats than the fit begins with.
    shown = model.decode(DecodeSettings(anchors=10 * given.splats))
    write_cameras(given.folder, given.width, given.height)
    views = Views.load(context, given.folder / 'transforms.json')
    renderer = Renderer(context)
    options = renderer.options(output_colour=OutputColour.COMPOSITED, background=(0.5, 0.5, 0.5))
    for view in range(VIEWS):
        task = renderer.start([(shown, np.eye(4))], views.camera(view), options, with_depth=False)
        task.job.wait()
        picture = Image.create(context, task.colour[..., :3], Transfer.SRGB)
        picture.save(given.folder / f'view_{view:02}.png', keep_values=True)

    splats = model.decode(DecodeSettings(anchors=given.splats)).read()
    display = np.clip(splats.sh[:, 0] * SH_C0 + 0.5, 0, 1)
    write_points(given.folder / 'points.ply', splats.positions, display)
    Cloud.create(context, start_splats(splats.positions, display)).save(given.folder / 'start.ply')
    print(f'{given.splats} points, {VIEWS} views of {given.width} x {given.height} in {given.folder}')


if __name__ == '__main__':
    main()
