# SPDX-License-Identifier: GPL-3.0-or-later
"""What the colours of the overlay mean, at the lower edge of a 3D view."""

import blf
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from .. import choices, version
from ..scene import overlays

# Pixels at a user interface scale of 1.
WIDTH, BAR, EDGE, TEXT = 220, 10, 18, 11
STEPS = 64
_TITLES = {kind: title for kind, title, _ in choices.OVERLAYS}
_AXES = (("X", (1.0, 0.0, 0.0)), ("Y", (0.0, 1.0, 0.0)), ("Z", (0.0, 0.0, 1.0)), ("round", (0.0, 0.0, 0.0)))


def draw(scale, kind, width, unit):
    """In the pixels of a region `width` wide. scale: overlays.Scale, None where nothing is known; unit: pixels of the
    user interface that count as one."""
    left, bottom = (width - WIDTH * unit) / 2, EDGE * unit
    if scale is None:
        _text(f"{_TITLES[kind]}: not known of these splats", left, bottom, unit)
    elif kind == 'SPLIT_AXIS':
        _swatches(left, bottom, unit)
    else:
        _bar(scale, left, bottom, unit)


def number(value):
    """As short as a label wants it."""
    return f'{value:,.0f}' if abs(value) >= 100 or value == int(value) else f'{value:.3g}'


def _bar(scale, left, bottom, unit):
    places = np.linspace(0, 1, STEPS + 1)
    colours = overlays.map_colours(0.5 * (places[1:] + places[:-1]))
    for place, colour in zip(places, colours):
        _box(left + place * WIDTH * unit, bottom, WIDTH * unit / STEPS, BAR * unit, colour)
    below = bottom - (TEXT + 2) * unit
    _text(number(scale.low), left, below, unit)
    high = number(scale.high)
    _text(high, left + WIDTH * unit - _width(high, unit), below, unit)
    how = ', logarithmic' if scale.is_logarithmic else ''
    _text(f'{_TITLES[scale.kind]} ({overlays.UNITS[scale.kind]}{how})', left, bottom + (BAR + 4) * unit, unit)


def _swatches(left, bottom, unit):
    step = WIDTH * unit / len(_AXES)
    for i, (name, axis) in enumerate(_AXES):
        _box(left + i * step, bottom, BAR * unit, BAR * unit, overlays.axis_colours(np.array([axis]))[0])
        _text(name, left + i * step + (BAR + 4) * unit, bottom, unit)
    _text(f"{_TITLES['SPLIT_AXIS']} (axes of the object)", left, bottom + (BAR + 4) * unit, unit)


def _box(x, y, width, height, colour):
    # Display values, as Blender's own 2D drawing takes them in this pass.
    shader = gpu.shader.from_builtin(version.UNIFORM_COLOR_2D_SHADER)
    corners = ((x, y), (x + width, y), (x + width, y + height), (x, y + height))
    shader.bind()
    shader.uniform_float('color', (*map(float, colour), 1.0))
    batch_for_shader(shader, 'TRIS', {'pos': corners}, indices=((0, 1, 2), (0, 2, 3))).draw(shader)


def _text(text, x, y, unit):
    version.set_text_size(blf, TEXT * unit)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 3, 0.0, 0.0, 0.0, 0.8)
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    blf.position(0, x, y, 0)
    blf.draw(0, text)
    blf.disable(0, blf.SHADOW)


def _width(text, unit):
    version.set_text_size(blf, TEXT * unit)
    return blf.dimensions(0, text)[0]
