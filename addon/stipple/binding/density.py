# SPDX-License-Identifier: GPL-3.0-or-later
"""Probability densities over an octree, and anchors drawn from them."""

from ctypes import byref
from dataclasses import dataclass

import numpy as np

from .errors import invalid
from .handle import Handle, contiguous, new_handle, pointer_to
from .structs import MAX_ANCHORS, AnchorOrder, StippleAnchorBuffers, StippleDensityInfo, StippleSampleOptions


@dataclass
class Anchors:
    positions: np.ndarray  # [P,3] metres
    log_q: np.ndarray      # [P]
    leaves: np.ndarray     # [P] Morton codes, ascending
    ranks: np.ndarray      # [P], or None where the order has none


def check_anchor_count(count, what='Anchor budget'):
    """Refuses a budget outside 1..2^28 before it is turned into an unsigned number."""
    if not 1 <= count <= MAX_ANCHORS:
        raise invalid(f'{what} is {count:,}; allowed are 1 to {MAX_ANCHORS:,}.')


class Density(Handle):
    free_function = 'stipple_density_free'

    @classmethod
    def from_points(cls, context, positions, weights=None, leaf_level=10):
        positions = contiguous(positions)
        weights = None if weights is None else contiguous(weights)
        return cls(context.library,
                   new_handle(context.library, 'stipple_density_from_points', context.pointer, pointer_to(positions),
                              pointer_to(weights), len(positions), leaf_level))

    def info(self):
        info = StippleDensityInfo()
        self._check(self.library.stipple_density_info(self.pointer, byref(info)))
        return info

    def sample(self, count, order=AnchorOrder.SYSTEMATIC, seed=0):
        """Exactly `count` anchors."""
        check_anchor_count(count)
        options = StippleSampleOptions()
        self.library.stipple_sample_options_init(byref(options))
        options.order, options.count, options.seed = int(order), count, seed
        ranked = order == AnchorOrder.PROGRESSIVE
        anchors = Anchors(np.empty((count, 3), np.float32), np.empty(count, np.float32), np.empty(count, np.uint64),
                          np.empty(count, np.uint64) if ranked else None)
        buffers = StippleAnchorBuffers(positions=pointer_to(anchors.positions), log_q=pointer_to(anchors.log_q),
                                       leaves=pointer_to(anchors.leaves), ranks=pointer_to(anchors.ranks))
        self._check(self.library.stipple_density_sample(self.pointer, byref(options), byref(buffers)))
        return anchors
