# SPDX-License-Identifier: GPL-3.0-or-later
"""What the 3D view colours splats by, in place of their own colours, to look at density control.

Splats that nothing is known of are grey. Split axes have the colours of the object's axes, as far as
they are clear; all else has a map whose lightness rises evenly with the value.
"""

from dataclasses import dataclass

import bpy
import numpy as np

from ..binding.cloud import Cloud
from ..binding.errors import StippleError
from ..binding.structs import ColourSpace, SplatQuantity
from .source import sources, splat_data
from .view import viewed

UNITS = {'SCORE': "in the strategy's units", 'AGE': "iterations, or events", 'CONTRIBUTION': "pixels"}
# Equally spaced anchors of the colour map viridis (S. van der Walt, N. Smith, CC0), display values.
_MAP = np.array([[.267, .005, .329], [.283, .141, .458], [.254, .265, .530], [.207, .372, .553], [.164, .471, .558],
                 [.128, .567, .551], [.135, .659, .518], [.267, .749, .441], [.478, .821, .318], [.741, .873, .150],
                 [.993, .906, .144]], np.float32)
UNKNOWN = 0.35  # grey, display value
# Kinds whose values spread over powers of ten.
_LOGARITHMIC = {'SCORE', 'CONTRIBUTION'}
# Of the values above 0: outside these the map ends, as single splats lie far from all others.
_PERCENTILES = (2.0, 99.5)
_Y00 = 0.28209479177387814  # of the real harmonics


@dataclass(frozen=True)
class Scale:
    """Which value has which colour."""

    kind: str
    low: float
    high: float

    def places(self, values):
        """0..1 along the map."""
        low, high = self.low, self.high
        values = np.clip(values, low, high)
        if self.is_logarithmic:
            low, high, values = np.log(low), np.log(high), np.log(values)
        return (values - low) / (high - low) if high > low else np.zeros_like(values)

    @property
    def is_logarithmic(self):
        return self.kind in _LOGARITHMIC and self.low > 0

    def colours(self, values):
        """Display colours [N,3] of values: [N], or axes [N,3]."""
        return axis_colours(values) if self.kind == 'SPLIT_AXIS' else map_colours(self.places(values))


def map_colours(places):
    """Display colours [N,3] at places 0..1 of the map."""
    anchors = np.linspace(0, 1, len(_MAP))
    return np.stack([np.interp(places, anchors, channel) for channel in _MAP.T], axis=-1).astype(np.float32)


def axis_colours(axes):
    """Display colours [N,3] of axes [N,3] whose lengths say how clear they are."""
    lengths = np.linalg.norm(axes, axis=1, keepdims=True)
    return (UNKNOWN * (1 - lengths) + np.abs(axes)).astype(np.float32)


def settings_of(scene):
    return scene.stipple.overlay


def is_on(scene, space):
    """Whether a view shows the overlay."""
    return settings_of(scene).kind != 'OFF' and space.overlay.show_overlays


def shows_contributions(scene):
    return settings_of(scene).kind == 'CONTRIBUTION'


class Overlay:
    """The coloured splats of what is viewed, kept until they change."""

    def __init__(self):
        self._values = {}  # by cloud: (state, values or None, their range or None)
        self._made = {}    # by cloud: (state, scale, cloud, its info)
        self.scale = None  # of the last update(); None: nothing is known of any splat

    def update(self, entries, depsgraph, scene):
        """Looks at all that a view shows, which have one scale."""
        settings, ranges, keys = settings_of(scene), [], set()
        for entry in entries:
            key = viewed.cloud_key(entry.obj)
            keys.add(key)
            known = self._values.get(key)
            if known is None or known[0] != (entry.state, settings.kind):
                values = _values(entry, depsgraph, settings.kind)
                known = self._values[key] = ((entry.state, settings.kind), values, _range(settings.kind, values))
            if known[2] is not None:
                ranges.append(known[2])
        for table in (self._values, self._made):
            for key in [key for key in table if key not in keys]:
                del table[key]
        self.scale = _scale(settings, ranges)

    def colours(self, entry):
        """Display colours [N,3] of an entry of the last update()."""
        values = self._values[viewed.cloud_key(entry.obj)][1]
        if values is None or self.scale is None:
            return np.full((entry.count, 3), UNKNOWN, np.float32)
        return self.scale.colours(values)

    def cloud_of(self, entry, depsgraph):
        """(native cloud, its info), as viewed.cloud_of, in these colours. Errors: StippleError."""
        key = viewed.cloud_key(entry.obj)
        known = self._made.get(key)
        if known is None or known[0] != entry.state or known[1] != self.scale:
            arrays = viewed.cloud_of(entry, depsgraph)[0].read()
            arrays.sh = ((self.colours(entry) - 0.5) / _Y00).astype(np.float32).reshape(-1, 1, 3)
            arrays.colour_space = ColourSpace.DISPLAY
            cloud = Cloud.create(sources.context(), arrays)
            known = self._made[key] = (entry.state, self.scale, cloud, cloud.info())
        return known[2], known[3]


def _values(entry, depsgraph, kind):
    """[N] or [N,3] of a viewed object; None where it is not known."""
    if kind == 'SPLIT_AXIS':
        try:
            return viewed.cloud_of(entry, depsgraph)[0].quantity(SplatQuantity.SPLIT_AXIS)
        except StippleError:
            return None  # drawing says what is wrong
    return splat_data.read_seen(entry.obj.evaluated_get(depsgraph).data, SplatQuantity[kind])


def _range(kind, values):
    """(lowest, highest) that are worth a colour of their own, None where there is no value."""
    if values is None or len(values) == 0 or kind == 'SPLIT_AXIS':
        return None if values is None or len(values) == 0 else (0.0, 1.0)
    if kind not in _LOGARITHMIC:
        return float(values.min()), float(values.max())
    above = values[values > 0]
    if len(above) == 0:
        return 0.0, 0.0
    low, high = np.percentile(above, _PERCENTILES)
    return float(low), float(high)


def _scale(settings, ranges):
    if not ranges:
        return None
    if settings.kind != 'SPLIT_AXIS' and not settings.auto_range:
        return Scale(settings.kind, settings.low, max(settings.low, settings.high))
    above = [r for r in ranges if r[1] > 0] or ranges
    return Scale(settings.kind, min(r[0] for r in above), max(r[1] for r in above))


def on_change(_settings, _context):
    """Update function: every 3D view shows it."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == 'VIEW_3D':
                area.tag_redraw()
