#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes a set of several cameras' frames, as Neural 3D Video has it once its videos are images.

    /usr/bin/python3 make_series.py FOLDER [--cameras 24] [--frames 300] [--width 960] [--height 540]
        [--distinct 300]

poses_bounds.npy, and cam00/0000.png to cam23/0299.png: an arc of cameras that look at a textured wall, in front of which
a disc goes round. The wall has noise of eight bits, so that its images are as large as those of a video, about 1 MB.
Of each camera so many frames are distinct; later ones are links to them, which cost as much to read and nothing to make.
"""

import argparse
import math
import struct
import zlib
from pathlib import Path

import numpy as np

NOISE = 6  # of 255, to each side
LEVEL = 1  # of zlib: what writes thousands of images


def png(pixels):
    """The bytes of a PNG. In: pixels [H,W,3] of 8 bits."""
    height, width, _ = pixels.shape
    rows = np.zeros((height, 1 + 3 * width), np.uint8)  # each with filter 0
    rows[:, 1:] = pixels.reshape(height, -1)

    def chunk(kind, data):
        return struct.pack('>I', len(data)) + kind + data + struct.pack('>I', zlib.crc32(kind + data))

    return (b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', struct.pack('>IIBBBBB', width, height, 8, 2, 0, 0, 0)) +
            chunk(b'IDAT', zlib.compress(rows.tobytes(), LEVEL)) + chunk(b'IEND', b''))


def poses_bounds(cameras, width, height, focal):
    """[N,17]: cameras on an arc of 60 degrees and radius 4 around the origin, in LLFF's axes."""
    rows = []
    for c in range(cameras):
        angle = math.radians(60) * (c / max(1, cameras - 1) - 0.5)
        back = np.array((math.sin(angle), 0, math.cos(angle)))
        down = np.array((0.0, -1.0, 0.0))
        right = np.cross(back, down)
        pose = np.stack((down, right, back, 4 * back, (height, width, focal)), axis=1)
        rows.append(np.concatenate((pose.ravel(), (2.0, 12.0))))
    return np.array(rows)


def places_of(pose, width, height, focal):
    """([H,W], [H,W]) x and y on the wall z = 0 that pixels see."""
    down, right, back, place = pose[:, :4].T
    u, v = np.meshgrid(np.arange(width) + 0.5 - width / 2, np.arange(height) + 0.5 - height / 2)
    ray = u[..., None] * right + v[..., None] * down - focal * back
    at = place - ray * (place[2] / ray[..., 2:])
    return at[..., 0], at[..., 1]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('folder', type=Path)
    parser.add_argument('--cameras', type=int, default=24)
    parser.add_argument('--frames', type=int, default=300)
    parser.add_argument('--width', type=int, default=960)
    parser.add_argument('--height', type=int, default=540)
    parser.add_argument('--distinct', type=int)
    given = parser.parse_args()
    distinct = given.distinct or given.frames
    focal = 1.1 * given.width
    rows = poses_bounds(given.cameras, given.width, given.height, focal)
    given.folder.mkdir(parents=True, exist_ok=True)
    np.save(given.folder / 'poses_bounds.npy', rows)
    dice = np.random.default_rng(1)
    for c, row in enumerate(rows):
        x, y = places_of(row[:15].reshape(3, 5), given.width, given.height, focal)
        wall = np.stack([127 + 90 * np.sin(a * x + b * y + a) for a, b in ((3, 5), (7, -2), (-4, 6))], axis=-1)
        wall += dice.integers(-NOISE, NOISE + 1, wall.shape)
        folder = given.folder / f'cam{c:02}'
        folder.mkdir(exist_ok=True)
        for f in range(given.frames):
            if f >= distinct:
                (folder / f'{f:04}.png').hardlink_to(folder / f'{f % distinct:04}.png')
                continue
            angle = math.tau * f / max(60, distinct)
            disc = (x - 0.8 * math.cos(angle)) ** 2 + (y - 0.5 * math.sin(angle)) ** 2 < 0.09
            shown = np.where(disc[..., None], (230, 60, 40), wall)
            (folder / f'{f:04}.png').write_bytes(png(np.clip(shown, 0, 255).astype(np.uint8)))


if __name__ == '__main__':
    main()
