#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes a furnished room as a GLB of coloured triangles, to be seen from inside: make_room.py OUT.glb"""
import json
import struct
import sys

import numpy as np

WIDTH, DEPTH, HEIGHT = 5.0, 4.0, 2.6  # metres
BOXES = 14


class Patches:
    """Grids of quads with a colour per vertex. Up is z until the file is written."""

    def __init__(self):
        self.positions, self.normals, self.colours, self.triangles = [], [], [], []
        self.count = 0

    def add(self, corner, along, across, counts, colours):
        """colours: (i, j) arrays -> [n, 3]; both directions turn from `along` to `across` around the normal."""
        corner, along, across = (np.asarray(v, float) for v in (corner, along, across))
        columns, rows = counts
        j, i = (v.ravel() for v in np.mgrid[0:rows + 1, 0:columns + 1])
        normal = np.cross(along, across)
        self.positions.append(corner + np.outer(i / columns, along) + np.outer(j / rows, across))
        self.normals.append(np.tile(normal / np.linalg.norm(normal), (len(i), 1)))
        self.colours.append(np.clip(colours(i, j), 0, 1))
        first = self.count + (i + j * (columns + 1))[(i < columns) & (j < rows)]
        above = first + columns + 1
        self.triangles.append(np.stack([first, first + 1, above + 1, first, above + 1, above], 1).ravel())
        self.count += len(i)


def checks(first, second, size):
    return lambda i, j: np.where(((i // size + j // size) % 2 == 0)[:, None], first, second)


def speckles(colour, amount, random):
    return lambda i, j: np.asarray(colour) + random.uniform(-amount, amount, (len(i), 1))


def room():
    random = np.random.default_rng(3)
    patches = Patches()
    x, y, z = np.diag([WIDTH, DEPTH, HEIGHT])
    patches.add((0, 0, 0), x, y, (60, 48), checks((.35, .2, .1), (.6, .42, .25), 3))
    patches.add(z, y, x, (10, 10), speckles((.9, .9, .88), .02, random))
    patches.add((0, 0, 0), z, x, (30, 60), speckles((.7, .75, .6), .06, random))
    patches.add(y, x, z, (60, 30), checks((.75, .7, .6), (.6, .3, .3), 4))
    patches.add((0, 0, 0), y, z, (48, 30), speckles((.5, .6, .75), .08, random))
    patches.add(x, z, y, (30, 48), checks((.8, .8, .75), (.3, .5, .4), 6))
    for box in range(BOXES):
        low = np.array([random.uniform(.1, 4.2), random.uniform(.1, .6) if box % 2 else random.uniform(2.9, 3.3), 0])
        a, b, c = np.diag([random.uniform(.2, .7), random.uniform(.2, .6), random.uniform(.3, 1.4)])
        paint = speckles(random.uniform(0, 1, 3), .05, random)
        for corner, along, across in ((low + c, a, b), (low, a, c), (low + b, c, a), (low, c, b), (low + a, b, c)):
            patches.add(corner, along, across, (12, 12), paint)
    return patches


def write(patches, path):
    def turned(rows):  # z up to glTF's y up
        rows = np.concatenate(rows)
        return np.stack([rows[:, 0], rows[:, 2], -rows[:, 1]], 1).astype('<f4')

    positions = turned(patches.positions)
    arrays = [positions, turned(patches.normals), np.concatenate(patches.colours).astype('<f4'),
              np.concatenate(patches.triangles).astype('<u4')]
    blobs = [array.tobytes() for array in arrays]
    starts = np.cumsum([0] + [len(blob) for blob in blobs]).tolist()
    accessors = [{'bufferView': k, 'componentType': 5125 if k == 3 else 5126, 'count': len(array),
                  'type': 'SCALAR' if k == 3 else 'VEC3'} for k, array in enumerate(arrays)]
    accessors[0].update(min=positions.min(0).tolist(), max=positions.max(0).tolist())
    head = {
        'asset': {'version': '2.0'}, 'scene': 0, 'scenes': [{'nodes': [0]}], 'nodes': [{'mesh': 0}],
        'materials': [{'pbrMetallicRoughness': {}}],
        'meshes': [{'primitives': [{'attributes': {'POSITION': 0, 'NORMAL': 1, 'COLOR_0': 2}, 'indices': 3,
                                    'material': 0}]}],
        'buffers': [{'byteLength': starts[-1]}],
        'bufferViews': [{'buffer': 0, 'byteOffset': starts[k], 'byteLength': len(blob)}
                        for k, blob in enumerate(blobs)],
        'accessors': accessors}
    text = json.dumps(head).encode()
    text += b' ' * (-len(text) % 4)
    body = b''.join(blobs)
    with open(path, 'wb') as file:
        file.write(struct.pack('<4sIIII', b'glTF', 2, 28 + len(text) + len(body), len(text), 0x4E4F534A) + text)
        file.write(struct.pack('<II', len(body), 0x004E4942) + body)


if __name__ == '__main__':
    write(room(), sys.argv[1])
