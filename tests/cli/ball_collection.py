"""A collection of patterned balls, each seen from all around, for networks to learn."""
import json
import math
import struct
import zlib

import numpy as np
import pytest

RADIUS = 0.4
DISTANCE = 2.0
FOCAL = 1.6  # of the image's side


def write_png(path, rgba):
    """rgba: [H,W,4] bytes."""
    height, width, _ = rgba.shape
    rows = b''.join(b'\0' + rgba[y].tobytes() for y in range(height))

    def chunk(kind, data):
        return struct.pack('>I', len(data)) + kind + data + struct.pack('>I', zlib.crc32(kind + data))

    path.write_bytes(b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', struct.pack('>IIBBBBB', width, height, 8, 6, 0, 0, 0)) +
                     chunk(b'IDAT', zlib.compress(rows)) + chunk(b'IEND', b''))


def colour_at(place, tint):
    """Display values of places [..., 3] of the ball around the origin: half of it dark, half in its tint."""
    lit = (place[..., :1] > 0).astype(float)
    return lit * np.array(tint) + (1 - lit) * 0.2


def pose(i, count):
    """Camera to world, looking at the origin along -z, from the i-th of count places all around."""
    height = 1 - 2 * (i + 0.5) / count
    turn, across = 2.4 * i, math.sqrt(1 - height * height)
    back = np.array([across * math.cos(turn), across * math.sin(turn), height])
    right = np.array([-math.sin(turn), math.cos(turn), 0])
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = right, np.cross(back, right), back, DISTANCE * back
    return matrix


def image_of(matrix, side, tint, scale, offset):
    """[side,side,4] bytes of the ball, whose world is scaled and moved."""
    steps = (np.arange(side) + 0.5 - side / 2) / (FOCAL * side)
    x, y = np.meshgrid(steps, -steps)
    along = np.stack([x, y, -np.ones_like(x)], -1) @ matrix[:3, :3].T
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    start = (matrix[:3, 3] - offset) / scale
    half = along @ start
    inside = half ** 2 - start @ start + RADIUS ** 2
    seen = inside > 0
    place = start + (-half - np.sqrt(np.maximum(inside, 0)))[..., None] * along
    colour = np.where(seen[..., None], colour_at(place, tint), 0)
    return np.round(255 * np.concatenate([colour, seen[..., None]], -1)).astype(np.uint8)


def write_points(path, tint, scale, offset, count=800):
    index = np.arange(count)
    z, turn = 1 - 2 * (index + 0.5) / count, 2.399963 * index
    across = np.sqrt(1 - z * z)
    place = RADIUS * np.stack([across * np.cos(turn), across * np.sin(turn), z], -1)
    colour = np.round(255 * colour_at(place, tint)).astype(np.uint8)
    rows = np.zeros(count, [('place', '<f4', 3), ('colour', 'u1', 3)])
    rows['place'], rows['colour'] = place * scale + offset, colour
    names = ''.join(f'property float {name}\n' for name in 'xyz')
    names += ''.join(f'property uchar {name}\n' for name in ('red', 'green', 'blue'))
    path.write_bytes(f'ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{names}end_header\n'.encode() +
                     rows.tobytes())


def write_ball(folder, tint, views=8, side=32, scale=1.0, offset=(0, 0, 0)):
    """One object. In: tint: display colour; scale, offset: of its world, which learning takes back."""
    (folder / 'images').mkdir(parents=True)
    frames = []
    for i in range(views):
        matrix = pose(i, views)
        matrix[:3, 3] = matrix[:3, 3] * scale + offset
        write_png(folder / f'images/{i:04}.png', image_of(matrix, side, tint, scale, np.array(offset)))
        frames.append({'file_path': f'images/{i:04}.png', 'transform_matrix': matrix.tolist()})
    write_points(folder / 'points.ply', tint, scale, np.array(offset))
    (folder / 'transforms.json').write_text(json.dumps(
        {'w': side, 'h': side, 'fl_x': FOCAL * side, 'fl_y': FOCAL * side, 'cx': side / 2, 'cy': side / 2,
         'ply_file_path': 'points.ply', 'frames': frames}))


TINTS = (0.9, 0.3, 0.2), (0.2, 0.8, 0.3), (0.3, 0.4, 0.95), (0.9, 0.8, 0.2), (0.7, 0.3, 0.8), (0.3, 0.8, 0.8)


def write_collection(folder, count=6):
    """Balls of other tints, some of them far from the origin and of another size."""
    for i in range(count):
        write_ball(folder / f'balls/{i}', TINTS[i], scale=(1, 3, 0.2)[i % 3], offset=((0, 0, 0), (5, -2, 1))[i % 2])


NETWORK = {'heads': 2, 'head_width': 16, 'latent_width': 8, 'encoder_blocks': 1, 'octree_blocks': 1,
           'splat_blocks': 1, 'gaussians': 4, 'leaf_level': 4}


def config(**changes):
    """Settings of a training that takes seconds."""
    part = {'batch': 1, 'tokens': 24, 'token_halvings': 0, 'least_anchors': 32, 'most_anchors': 128, 'views': 2,
            'learning_rate': 3e-3, 'warm_up': 10, 'mean_decay': 0.95}
    parts = [dict(part, stage='structure', steps=60), dict(part, stage='attributes', steps=480),
             dict(part, stage='joint', steps=20, learning_rate=1e-4)]
    return {'collection': 'objects', 'out': 'result', 'held_out': 3, 'measure_interval': 100, 'points': 400,
            'checkpoint_interval': 50, 'network': NETWORK, 'parts': parts, **changes}


@pytest.fixture(scope='module')
def objects(tmp_path_factory):
    folder = tmp_path_factory.mktemp('collection') / 'objects'
    write_collection(folder)
    return folder
