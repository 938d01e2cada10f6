# SPDX-License-Identifier: GPL-3.0-or-later
"""What is being drawn over a 3D view: the circle of a brush and its path, an outline, a circle that is dragged."""

import math

import bpy
import gpu
from gpu_extras.batch import batch_for_shader
from gpu_extras.presets import draw_circle_2d

from .. import version
from .marks import Marks

_COLOUR = (1.0, 1.0, 1.0, 0.9)
_SEGMENTS = 48


class StrokeMarks(Marks):
    """shape: 'BRUSH', 'LASSO', 'SPHERE' or 'COLOR'. radius: of a brush, pixels."""

    def __init__(self, shape, radius):
        self.radius = radius
        self._shape = shape
        self._region = None  # that is drawn in
        self._mouse = None
        self._path = []      # since the button was pressed
        super().__init__()

    def move(self, region, x, y):
        """The mouse is over a region, or over none."""
        self._region, self._mouse = region, (x, y)
        self.redraw()

    def begin(self, region, place):
        self._region, self._mouse, self._path = region, place, [place]
        self.redraw()

    def add(self, place):
        self._mouse = place
        self._path.append(place)
        self.redraw()

    def _draw(self):
        if self._region is None or bpy.context.region != self._region:
            return
        gpu.state.blend_set('ALPHA')
        if self._shape == 'BRUSH':
            if len(self._path) > 1:
                _draw_line(self._path)
                draw_brush_circle(self._path[0], self.radius)
            draw_brush_circle(self._mouse, self.radius)
        elif self._shape == 'LASSO' and len(self._path) > 1:
            _draw_line(self._path + self._path[:1])
        elif self._shape == 'SPHERE' and self._path:
            draw_brush_circle(self._path[0], math.dist(self._path[0], self._mouse))
            _draw_line([self._path[0], self._mouse])
        gpu.state.blend_set('NONE')


def draw_brush_circle(place, radius):
    if radius > 0:
        draw_circle_2d(place, _COLOUR, radius, segments=_SEGMENTS)


def _draw_line(points):
    shader = gpu.shader.from_builtin(version.UNIFORM_COLOR_2D_SHADER)
    shader.bind()
    shader.uniform_float('color', _COLOUR)
    batch_for_shader(shader, 'LINE_STRIP', {'pos': points}).draw(shader)
