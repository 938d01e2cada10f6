# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras all over a sphere, as the renders have them that DeG is trained on: a Hammersley set that is moved at random.

Based on: Yan et al., Generative 3D Gaussians with Learned Density Control, 2026, and its published preparation of data
(distance 2, 40 degrees). Differs: the number of views and their size are free.
"""

import math
from ctypes import c_double

import numpy as np

from ...binding.structs import CameraModel, StippleCamera
from ..view.cameras import world_to_camera

DISTANCE = 2.0
ANGLE = math.radians(40)
# Everything lies within half the diagonal of a cube of side 1, which is 0.87.
NEAR, FAR = 1.0, 3.0


def poses(count, seed):
    """[count,4,4] camera to world in Blender's frame (y up, looking along -z at the origin)."""
    first, second = np.random.default_rng(seed).random(2)
    numbers = np.arange(count)
    heights = 1 - 2 * (numbers + first) / count
    turns = 2 * np.pi * (_mirrored_bits(numbers) + second)
    across = np.sqrt(np.maximum(1 - heights ** 2, 0))
    return np.array([_looking_at_origin(back) for back in
                     np.stack([across * np.cos(turns), across * np.sin(turns), heights], 1)])


def focal(size):
    """Pixels."""
    return 0.5 * size / math.tan(ANGLE / 2)


def native_camera(pose, size):
    """A pose as the library takes it."""
    return StippleCamera(model=int(CameraModel.PERSPECTIVE), width=size, height=size, fx=focal(size), fy=focal(size),
                         cx=size / 2, cy=size / 2, world_to_camera=(c_double * 16)(*world_to_camera(pose).reshape(16)),
                         near_plane=NEAR, far_plane=FAR)


def _mirrored_bits(numbers):
    """Each number with its binary digits behind the point, the last one first: van der Corput's sequence."""
    result, share, left = np.zeros(len(numbers)), 0.5, numbers.copy()
    while left.any():
        result += share * (left & 1)
        left >>= 1
        share /= 2
    return result


def _looking_at_origin(back):
    up = np.array([0.0, 0.0, 1.0]) if abs(back[2]) < 1 - 1e-9 else np.array([0.0, 1.0, 0.0])
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3] = np.stack([right, np.cross(back, right), back, DISTANCE * back], 1)
    return pose
