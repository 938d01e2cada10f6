# SPDX-License-Identifier: GPL-3.0-or-later
"""What would be selected, while a stroke is being drawn: on an even sample of the splats, so that the mouse never
waits. What is executed at the end sees all of them."""

import time

import numpy as np

from ... import binding
from ...binding import regions
from ...binding.errors import StippleError
from ...scene.source import edits, selecting, selections, sources

# Splats of all objects that are looked at for each move of the mouse.
MOST = 100_000
LEAST = 10_000
# Seconds that an update may take: one image of a screen at 60 Hz. A sample that takes longer is halved.
SECONDS = 0.016


class StrokePreview:
    """One stroke's. show: a function of {name of the data: centres [n,3] in the object's space}, which draws them in
    place of the selection."""

    def __init__(self, context, show):
        self._show, self._most, self._samples = show, MOST, None
        self._targets = None
        self._objects = edits.selected_splats(context)
        self._context_targets = lambda: selecting.targets(context, self._objects)

    def update(self, regions_of):
        """Shows what the stroke would select now. regions_of: as of selecting.select. What cannot be told is not
        shown: the stroke says at its end what is wrong. Returns the seconds it took."""
        begun = time.perf_counter()
        try:
            if self._samples is None:
                if self._targets is None:
                    if not all(map(_is_read, self._objects)):
                        return 0.0
                    self._targets = self._context_targets()
                self._samples = [_Sample(target, self._most // len(self._targets)) for target in self._targets]
                begun = time.perf_counter()  # once for a stroke
            self._show({sample.name: sample.after(regions_of(sample.obj)) for sample in self._samples})
        except StippleError:
            return 0.0
        taken = time.perf_counter() - begun
        if taken > SECONDS and self._most > LEAST:
            self._most, self._samples = max(self._most // 2, LEAST), None
        return taken

    def close(self):
        self._show({})
        self._samples = self._targets = None


def _is_read(obj):
    """Splats without a file get one by the stroke itself, which is a step of undo."""
    return not selections.takes_mask(obj.data) or bool(obj.data.stipple.source)


def _places(positions):
    """A Cloud of splats at these places; what is drawn asks for nothing else of them."""
    count = len(positions)
    rotations = np.zeros((count, 4), np.float32)
    rotations[:, 0] = 1.0
    return binding.cloud.Cloud.create(sources.context(), binding.cloud.SplatArrays(
        positions, rotations, np.ones((count, 3), np.float32), np.ones(count, np.float32),
        np.zeros((count, 1, 3), np.float32)))


class _Sample:
    """Every n-th splat of a target that can be selected."""

    def __init__(self, target, most):
        self.obj, self.name = target.obj, target.obj.data.name_full
        chosen = np.flatnonzero(target.stays)
        chosen = chosen[::max(1, -(-len(chosen) // max(most, 1)))]
        mask = np.zeros(len(target.stays), np.uint8)
        mask[chosen] = 1
        self._cloud = _places(regions.selected_positions(target.cloud, mask, len(chosen)))
        self._before = target.selected[chosen]

    def after(self, chosen):
        """Centres [n,3] of what would be selected after regions."""
        return regions.selected_positions(self._cloud, regions.select(self._cloud, chosen, self._before),
                                          len(self._before))
