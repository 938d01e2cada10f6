# SPDX-License-Identifier: GPL-3.0-or-later
"""The folder of a collected asset: images, points and, written last, transforms.json, as nerfstudio has them."""

import contextlib
import json
import os

import bpy
import numpy as np

from . import sphere
from .assets import LeftOutError

TRANSFORMS, POINTS, IMAGES = 'transforms.json', 'points.ply', 'images'
_UNFINISHED = 'unfinished.json'  # what the images are of, until all is there
_PNG_END = b'IEND\xaeB`\x82'
_POINT = [('place', '<f4', 3), ('normal', '<f4', 3), ('colour', 'u1', 3)]
_HEADER = '\n'.join(['ply', 'format binary_little_endian 1.0', 'element vertex {count}',
                     *(f'property float {name}' for name in ('x', 'y', 'z', 'nx', 'ny', 'nz')),
                     *(f'property uchar {name}' for name in ('red', 'green', 'blue')), 'end_header', ''])


class AssetFolder:
    def __init__(self, path):
        self._path = path

    def view_count(self):
        """How many views a whole folder has; 0 for one that is not whole."""
        try:
            with open(self._at(TRANSFORMS), encoding='utf-8') as file:
                return len(json.load(file)['frames'])
        except (OSError, ValueError, KeyError, TypeError):
            return 0

    def begin(self, facts):
        """facts: what the images are of, a dictionary of texts and numbers. Images of other facts, or that are cut off,
        go. Errors: LeftOutError for a folder of somebody else."""
        found = None
        with contextlib.suppress(OSError, ValueError):
            with open(self._at(_UNFINISHED), encoding='utf-8') as file:
                found = json.load(file)
        if found is None and os.path.isdir(self._path) and os.listdir(self._path):
            raise LeftOutError(f"its folder '{self._path}' has other files")
        os.makedirs(self._at(IMAGES), exist_ok=True)
        if found != facts:
            self._remove_images()
            self._write(_UNFINISHED, json.dumps(facts).encode())

    def image(self, view):
        """[size,size,4] display values with straight alpha, row 0 = top, or None where it is not there or cannot be
        read."""
        path = self._image_path(view)
        try:
            with open(path, 'rb') as file:
                file.seek(-len(_PNG_END), os.SEEK_END)
                if file.read() != _PNG_END:
                    return None
            image = bpy.data.images.load(path, check_existing=False)
        except (OSError, RuntimeError):
            return None
        try:
            width, height = image.size
            values = np.empty(width * height * 4, np.float32)
            if len(image.pixels) != len(values) or len(values) == 0:
                return None
            image.pixels.foreach_get(values)
            return values.reshape(height, width, 4)[::-1]
        finally:
            bpy.data.images.remove(image)

    def add_image(self, view, render):
        """render(path) writes it."""
        name = f'{IMAGES}/{view:04}.png'
        render(self._at(f'{name}.part'))
        with open(self._at(f'{name}.part'), 'rb') as file:
            content = file.read()
        self._write(name, _without_notes(content))

    def finish(self, size, poses, points, asset):
        """points: (places [N,3], normals [N,3], display colours [N,3]). asset: the Surface."""
        rows = np.empty(len(points[0]), _POINT)
        rows['place'], rows['normal'] = points[:2]
        rows['colour'] = np.clip(np.rint(points[2] * 255), 0, 255)
        self._write(POINTS, _HEADER.format(count=len(rows)).encode() + rows.tobytes())
        focal = sphere.focal(size)
        content = {'camera_model': 'OPENCV', 'w': size, 'h': size, 'fl_x': focal, 'fl_y': focal, 'cx': size / 2,
                   'cy': size / 2, 'ply_file_path': POINTS,
                   'normalised': {'centre': asset.centre.tolist(), 'size': asset.size},
                   'frames': [{'file_path': f'{IMAGES}/{view:04}.png', 'transform_matrix': pose.tolist()}
                              for view, pose in enumerate(poses)]}
        self._write(TRANSFORMS, json.dumps(content, indent=1).encode())
        os.remove(self._at(_UNFINISHED))

    def abandon(self):
        """Removes what is there of an asset that is left out."""
        if not os.path.exists(self._at(_UNFINISHED)):
            return
        self._remove_images()
        for path in (self._at(POINTS), self._at(_UNFINISHED)):
            with contextlib.suppress(FileNotFoundError):
                os.remove(path)
        for path in (self._at(IMAGES), self._path):
            with contextlib.suppress(OSError):  # somebody has put a file there
                os.rmdir(path)

    def _remove_images(self):
        for name in os.listdir(self._at(IMAGES)):
            if name.removesuffix('.part').endswith('.png') and name[:4].isdigit():
                os.remove(os.path.join(self._at(IMAGES), name))

    def _write(self, name, content):
        """Under another name first."""
        path = self._at(name)
        with open(path + '.part', 'wb') as file:
            file.write(content)
        os.replace(path + '.part', path)

    def _image_path(self, view):
        return os.path.join(self._at(IMAGES), f'{view:04}.png')

    def _at(self, name):
        return os.path.join(self._path, name)


def _without_notes(png):
    """A PNG file without the chunks that its pixels do not need: Blender notes there when, and in what time, it has
    rendered, so that no two files were the same."""
    kept, at = [png[:8]], 8
    while at < len(png):
        end = at + 12 + int.from_bytes(png[at:at + 4], 'big')
        if png[at + 4:at + 5].isupper():
            kept.append(png[at:end])
        at = end
    return b''.join(kept)
