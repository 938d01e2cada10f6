# SPDX-License-Identifier: GPL-3.0-or-later
"""One image of the selected objects on a transparent film: no network has to find what the object is."""

import math
from dataclasses import dataclass

from mathutils import Euler, Vector

from ..fit import view_capture, view_rigs

# A little from above and from the front: what the networks were trained with looks like this.
_ELEVATION, _ANGLE = math.radians(15), math.radians(40)
_MARGIN = 1.1  # the sphere around the objects, and a little air


@dataclass
class SelectionView:
    linear: object  # [H,W,4] scene linear, premultiplied, row 0 = top
    bounds: object  # view_rigs.Bounds of the objects
    viewer: object  # where it was seen from


def render(context, objects, engine, size, samples, camera):
    """camera: a camera object, None for one in front of the objects. Errors: StippleError where nothing has a size."""
    bounds = view_rigs.bounds_of(objects, context.evaluated_depsgraph_get())
    capturing = view_capture.CaptureSettings(engine, size, samples, transparent=True)
    with view_capture.Capture(context, objects, capturing) as capture:
        if camera is None:
            pose = _front(bounds)
            seen, viewer = capture.pose('front', pose), pose.matrix.translation.copy()
        else:
            seen, viewer = capture.camera(camera), camera.matrix_world.translation.copy()
    return SelectionView(seen.linear, bounds, viewer)


def _front(bounds):
    radius = bounds.radius * _MARGIN
    distance = radius / math.sin(_ANGLE / 2)
    direction = Vector((0.0, -math.cos(_ELEVATION), math.sin(_ELEVATION)))
    matrix = Euler((math.pi / 2 - _ELEVATION, 0.0, 0.0)).to_matrix().to_4x4()
    matrix.translation = bounds.centre + direction * distance
    return view_rigs.Pose(matrix, _ANGLE, max(distance - 2 * radius, distance * 1e-3), distance + 2 * radius)
