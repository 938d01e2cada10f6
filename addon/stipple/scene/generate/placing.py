# SPDX-License-Identifier: GPL-3.0-or-later
"""Where generated splats stand. Their data is upright with the origin in the middle of its base; the side that the image
shows looks along +x."""

import math

from mathutils import Matrix, Vector

_GAP = 1.25  # from one seed to the next, times the size
FRONT = -math.pi / 2  # turns +x to -y, which Blender's front view looks at


def beside(location, size, index, count):
    """The matrix of one of several objects in a row along x, the middle of which is at the location."""
    x = (index - (count - 1) / 2) * _GAP * size
    return Matrix.Translation(Vector(location) + Vector((x, 0.0, 0.0))) @ Matrix.Rotation(FRONT, 4, 'Z')


def in_bounds(bounds, viewer, index):
    """The matrix of one that stands in for what was rendered: on the floor of the bounds, with the side that the image
    shows towards the viewer; others beside it."""
    centre = bounds.centre
    base = Vector((centre.x, centre.y, bounds.lowest.z))
    towards = Vector(viewer) - centre
    angle = math.atan2(towards.y, towards.x) if towards.xy.length > 1e-9 else FRONT
    x = index * _GAP * largest_side(bounds)  # the first stands where the selection does
    return Matrix.Translation(base + Vector((x, 0.0, 0.0))) @ Matrix.Rotation(angle, 4, 'Z')


def largest_side(bounds):
    return max(bounds.highest - bounds.lowest)
