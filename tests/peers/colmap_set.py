#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the set that compare_fits.py reads of photographs that COLMAP has undistorted.

    colmap image_undistorter --image_path PHOTOS --input_path sparse/0 --output_path small --max_image_size 363
    colmap model_converter --input_path small/sparse --output_path small/sparse --output_type TXT
    python3 tests/peers/colmap_set.py small

Writes transforms.json and points.ply beside the folder `images`: one pinhole camera for all.
"""

import json
import sys
from pathlib import Path

import numpy as np


def rows(path):
    return [line.split() for line in path.read_text().splitlines() if not line.startswith('#')]


def rotation(w, x, y, z):
    """[3,3] of a unit quaternion."""
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def frame(row):
    """A camera that looks along -z, as OpenGL's, of one that looks along +z."""
    to_camera = rotation(*map(float, row[1:5]))
    matrix = np.eye(4)
    matrix[:3, :3] = to_camera.T @ np.diag([1.0, -1.0, -1.0])
    matrix[:3, 3] = -to_camera.T @ np.array([float(value) for value in row[5:8]])
    return {'file_path': f'images/{row[9]}', 'transform_matrix': matrix.tolist()}


def main():
    folder = Path(sys.argv[1])
    cameras = rows(folder / 'sparse' / 'cameras.txt')
    if len(cameras) != 1 or cameras[0][1] != 'PINHOLE':
        sys.exit(f'{folder} has {len(cameras)} cameras; one pinhole camera is needed.')
    width, height = map(int, cameras[0][2:4])
    fx, fy, cx, cy = map(float, cameras[0][4:8])
    # Every second row holds the points that an image sees.
    frames = [frame(row) for row in rows(folder / 'sparse' / 'images.txt')[::2]]
    points = rows(folder / 'sparse' / 'points3D.txt')
    header = ['ply', 'format ascii 1.0', f'element vertex {len(points)}', *(f'property float {c}' for c in 'xyz'),
              *(f'property uchar {c}' for c in ('red', 'green', 'blue')), 'end_header']
    (folder / 'points.ply').write_text('\n'.join(header + [' '.join(row[1:7]) for row in points]) + '\n')
    (folder / 'transforms.json').write_text(json.dumps(
        {'camera_model': 'OPENCV', 'w': width, 'h': height, 'fl_x': fx, 'fl_y': fy, 'cx': cx, 'cy': cy,
         'ply_file_path': 'points.ply', 'frames': frames}, indent=1))
    print(f'{len(frames)} views of {width} x {height}, {len(points)} points')


if __name__ == '__main__':
    main()
