# SPDX-License-Identifier: GPL-3.0-or-later
"""The points that an operator has had clicked so far, drawn over the 3D views until it ends."""

import bpy
import gpu
from bpy_extras.view3d_utils import location_3d_to_region_2d
from gpu_extras.batch import batch_for_shader

from .. import version
from .marks import Marks

_RADIUS_PX = 5.0
_COLOUR = (1.0, 0.6, 0.1, 1.0)


class PickedPoints(Marks):
    """points: flat coordinates in the world, which grow while clicks come."""

    def __init__(self, points):
        self._points = points
        super().__init__()
        self.redraw()

    def _draw(self):
        context, points = bpy.context, self._points
        region, region_data = context.region, context.region_data
        seen = [location_3d_to_region_2d(region, region_data, points[i:i + 3])
                for i in range(0, len(points) - 2, 3)]
        seen = [place for place in seen if place is not None]
        if not seen:
            return
        radius = _RADIUS_PX * context.preferences.system.ui_scale
        shader = gpu.shader.from_builtin(version.UNIFORM_COLOR_2D_SHADER)
        shader.bind()
        shader.uniform_float('color', _COLOUR)
        corners, triangles = [], []
        for x, y in seen:
            first = len(corners)
            corners += [(x - radius, y), (x, y - radius), (x + radius, y), (x, y + radius)]
            triangles += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
        batch_for_shader(shader, 'TRIS', {'pos': corners}, indices=triangles).draw(shader)
        if len(seen) > 1:
            batch_for_shader(shader, 'LINE_STRIP', {'pos': [tuple(place) for place in seen]}).draw(shader)
