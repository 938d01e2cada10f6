#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes three families of objects that networks can learn: rocks, plants in pots, and bottles.

    make_families.py FOLDER [--each 140] [--seed 1]

Each object is a .ply of triangles with display colours at its vertices, about one metre across, z upwards. Rocks have
patches of lichen, bottles a label with stripes or chequers: about a fifth of their surface has finer detail than the
rest. addon/collect_for_training.py makes data sets of them.
"""

import argparse
import math
from pathlib import Path

import numpy as np


def grid_triangles(rows, columns, closed):
    """Triangles between rows of a grid of vertices. In: closed: the last column meets the first."""
    triangles = []
    for row in range(rows - 1):
        for column in range(columns if closed else columns - 1):
            a, b = row * columns + column, row * columns + (column + 1) % columns
            triangles += [(a, b, b + columns), (a, b + columns, a + columns)]
    return np.array(triangles)


class Body:
    """Vertices, colours and triangles that are put together."""

    def __init__(self):
        self._vertices, self._colours, self._triangles, self._count = [], [], [], 0

    def add(self, vertices, colours, triangles):
        self._vertices.append(vertices)
        self._colours.append(np.broadcast_to(colours, vertices.shape))
        self._triangles.append(triangles + self._count)
        self._count += len(vertices)

    def arrays(self):
        """Vertices [n,3], their display colours [n,3] and triangles [m,3]."""
        return (np.concatenate(self._vertices), np.clip(np.concatenate(self._colours), 0, 1),
                np.concatenate(self._triangles))

    def write(self, path):
        vertices, colours, triangles = self.arrays()
        rows = np.zeros(len(vertices), [('place', '<f4', 3), ('colour', 'u1', 3)])
        rows['place'], rows['colour'] = vertices, np.round(255 * colours)
        faces = np.zeros(len(triangles), [('count', 'u1'), ('corners', '<i4', 3)])
        faces['count'], faces['corners'] = 3, triangles
        names = ''.join(f'property float {name}\n' for name in 'xyz')
        names += ''.join(f'property uchar {name}\n' for name in ('red', 'green', 'blue'))
        head = (f'ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{names}'
                f'element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n')
        path.write_bytes(head.encode() + rows.tobytes() + faces.tobytes())


def waves(dice, places, count, frequency):
    """Smooth noise of about -1 to 1 at places [n,3]: waves in random directions."""
    value = np.zeros(len(places))
    for _ in range(count):
        direction = dice.normal(size=3)
        direction *= frequency * dice.uniform(0.6, 1.4) / np.linalg.norm(direction)
        value += np.sin(places @ direction + dice.uniform(0, 2 * math.pi))
    return value / math.sqrt(count / 2)


def tint(dice, low, high):
    return dice.uniform(low, high)


def sphere(rows, columns):
    """[rows * columns, 3] unit directions, from below to above."""
    height = np.pi * (np.arange(rows) + 0.5) / rows
    turn = 2 * np.pi * np.arange(columns) / columns
    h, t = np.meshgrid(height, turn, indexing='ij')
    return np.stack([np.sin(h) * np.cos(t), np.sin(h) * np.sin(t), -np.cos(h)], -1).reshape(-1, 3)


def rock(dice, body):
    rows, columns = 72, 112
    out = sphere(rows, columns)
    size = 0.45 + 0.10 * waves(dice, out, 5, 2.0) + 0.045 * waves(dice, out, 8, 5.0) + 0.012 * waves(dice, out, 9, 16)
    places = out * size[:, None] * dice.uniform([0.7, 0.7, 0.5], [1.2, 1.2, 1.0])
    stone = tint(dice, [0.30, 0.26, 0.22], [0.62, 0.56, 0.52])
    colours = stone * (1 + 0.12 * waves(dice, places, 8, 9))[:, None] * (1 + 0.10 * waves(dice, places, 8, 40))[:, None]
    lichen = tint(dice, [0.45, 0.50, 0.10], [0.85, 0.75, 0.35])
    grown = (waves(dice, places, 6, 5) > 0.9) & (waves(dice, places, 8, 45) > -0.2)
    colours = np.where(grown[:, None], lichen, colours)
    body.add(places, colours, grid_triangles(rows, columns, True))


def turned(profile, columns):
    """A surface of revolution. In: profile: [rows,2] radius and height. Returns vertices and triangles."""
    turn = 2 * np.pi * np.arange(columns) / columns
    places = np.stack([profile[:, :1] * np.cos(turn), profile[:, :1] * np.sin(turn),
                       np.broadcast_to(profile[:, 1:], (len(profile), columns))], -1).reshape(-1, 3)
    return places, grid_triangles(len(profile), columns, True)


def leaf(dice, body, start, turn, colour):
    length, width = dice.uniform(0.25, 0.5), dice.uniform(0.05, 0.11)
    rise, fall = dice.uniform(0.5, 1.2), dice.uniform(0.5, 1.6)
    along, across = np.meshgrid(np.linspace(0, 1, 18), np.linspace(-1, 1, 7), indexing='ij')
    half = width * np.sin(np.pi * np.clip(along, 0.02, 1)) ** 0.8
    out = length * along
    up = length * (rise * along - fall * along ** 2) + 0.3 * half * np.abs(across)
    direction = np.array([math.cos(turn), math.sin(turn), 0])
    side = np.array([-math.sin(turn), math.cos(turn), 0])
    places = start + out[..., None] * direction + (half * across)[..., None] * side + up[..., None] * [0, 0, 1]
    rib = np.abs(across) < 0.2
    shade = np.where(rib[..., None], np.minimum(1, colour * 1.5 + 0.1), colour * (0.8 + 0.3 * along[..., None]))
    # Both sides, as images look from everywhere.
    triangles = grid_triangles(18, 7, False)
    body.add(places.reshape(-1, 3), shade.reshape(-1, 3), triangles)
    body.add(places.reshape(-1, 3) - [0, 0, 0.004], shade.reshape(-1, 3), triangles[:, ::-1])


def plant(dice, body):
    clay = tint(dice, [0.45, 0.18, 0.10], [0.85, 0.60, 0.55])
    radius, height = dice.uniform(0.14, 0.22), dice.uniform(0.2, 0.34)
    profile = np.array([[0.001, 0], [0.7, 0], [0.85, 0.5], [1, 0.85], [1.12, 0.86], [1.12, 1], [0.95, 1], [0.95, 0.9],
                        [0.001, 0.9]]) * [radius, height]
    places, triangles = turned(profile, 40)
    ring = (np.arange(len(places)) // 40 >= 6)[:, None]
    body.add(places, np.where(ring, np.array([0.16, 0.11, 0.07]), clay), triangles)
    stem = dice.uniform(0.1, 0.45)
    green = tint(dice, [0.08, 0.30, 0.06], [0.35, 0.62, 0.25])
    places, triangles = turned(np.stack([np.linspace(0.018, 0.010, 12),
                                         height * 0.9 + np.linspace(0, stem, 12)], -1), 10)
    body.add(places, green * 0.6, triangles)
    count = int(dice.integers(5, 14))
    for number in range(count):
        level = height * 0.9 + stem * dice.uniform(0.3, 1)
        leaf(dice, body, np.array([0, 0, level]), 2.4 * number + dice.uniform(-0.4, 0.4),
             np.clip(green * dice.uniform(0.8, 1.25), 0, 1))


def bottle(dice, body):
    belly, neck = dice.uniform(0.14, 0.24), dice.uniform(0.05, 0.08)
    shoulder, height = dice.uniform(0.5, 0.68), 1.0
    at = np.linspace(0, 1, 120)
    width = np.where(at < shoulder, belly, neck + (belly - neck) * 0.5 *
                     (1 + np.cos(np.pi * np.clip((at - shoulder) / dice.uniform(0.12, 0.25), 0, 1))))
    width = width * (1 + dice.uniform(0, 0.10) * np.sin(at * dice.uniform(5, 14)))
    width[0], width[-1] = 0.001, 0.001
    columns = 96
    places, triangles = turned(np.stack([width, at * height], -1), columns)
    glass = tint(dice, [0.05, 0.15, 0.08], [0.75, 0.85, 0.85])
    paper, ink = tint(dice, [0.75, 0.7, 0.6], [1, 0.98, 0.95]), tint(dice, [0.05, 0.02, 0.02], [0.8, 0.3, 0.6])
    cap = tint(dice, [0.1, 0.1, 0.1], [0.9, 0.8, 0.3])
    level = places[:, 2]
    turn = (np.arange(len(places)) % columns) / columns
    low = dice.uniform(0.12, 0.2)
    high = low + dice.uniform(0.18, 0.3)
    stripes, across = int(dice.integers(8, 20)), int(dice.integers(3, 8))
    pattern = np.floor(turn * 2 * stripes).astype(int)
    if dice.random() < 0.5:
        pattern = pattern + np.floor((level - low) / (high - low) * 2 * across).astype(int)
    label = np.where((pattern % 2 == 0)[:, None], paper, ink)
    colours = np.where(((level > low) & (level < high))[:, None], label, glass)
    body.add(places, np.where((level > 0.9)[:, None], cap, colours), triangles)


FAMILIES = {'bottle': bottle, 'plant': plant, 'rock': rock}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('folder', type=Path)
    parser.add_argument('--each', type=int, default=140)
    parser.add_argument('--seed', type=int, default=1)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    for family, (name, make) in enumerate(FAMILIES.items()):
        for number in range(given.each):
            body = Body()
            make(np.random.default_rng((given.seed, family, number)), body)
            body.write(given.folder / f'{name}_{number:03}.ply')


if __name__ == '__main__':
    main()
