# SPDX-License-Identifier: GPL-3.0-or-later
"""Which way a file's axes point, and the object matrix that puts them upright in Blender."""

import numpy as np

from ...binding.structs import Frame

WORLD = Frame.RFU         # Blender: x right, y forward, z up
CONVENTIONAL = Frame.RDF  # of files that do not say: the frame of trained splats
_DIRECTIONS = {'R': (1, 0, 0), 'L': (-1, 0, 0), 'U': (0, 0, 1), 'D': (0, 0, -1), 'F': (0, 1, 0), 'B': (0, -1, 0)}
# What the interface calls them.
UP_AXES = {'Z': Frame.RFU, '-Y': Frame.RDF, 'Y': Frame.RUB}


def of_matrix(matrix):
    """The frame whose positions a 4x4 object matrix puts upright, as far as single precision tells, or None."""
    return next((frame for frame in Frame if frame != Frame.UNKNOWN
                 and np.abs(to_world(frame) - matrix).max() < 1e-6), None)


def to_world(frame):
    """[4,4] from positions of a frame to Blender's world."""
    frame = CONVENTIONAL if frame == Frame.UNKNOWN else Frame(frame)
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([_DIRECTIONS[letter] for letter in frame.name]).T
    return matrix
