# SPDX-License-Identifier: GPL-3.0-or-later
"""How long decoding a source takes, judged by how long it has taken."""

import math
from bisect import bisect_left

# A smaller budget takes a part of the time of the one that was measured, at least as this power of its size...
_SMALLER = 1.0
# ...and a larger one at most as this: attention among all anchors.
_LARGER = 2.0
# Budgets of a source that are remembered; the ones measured last stay.
_MOST_SIZES = 32
# Shorter times say nothing about others.
_LEAST_SECONDS = 1e-4


class DecodeTimes:
    """Measured seconds of sources' budgets. It errs to the side of too long, and learns from each decode."""

    def __init__(self):
        self._known = {}  # source → {splats: seconds}

    def note(self, source, size, seconds):
        """A source took these seconds to give so many splats."""
        known = self._known.setdefault(source, {})
        known.pop(size, None)
        known[size] = max(seconds, _LEAST_SECONDS)
        while len(known) > _MOST_SIZES:
            del known[next(iter(known))]

    def estimate(self, source, size):
        """Seconds that so many splats will take; None where nothing is known of the source."""
        known = self._known.get(source)
        if not known:
            return None
        sizes = sorted(known)
        i = bisect_left(sizes, size)
        if i == len(sizes):
            return known[sizes[-1]] * (size / sizes[-1]) ** _LARGER
        above = known[sizes[i]]
        if i == 0 or sizes[i] == size:
            return above * (size / sizes[i]) ** _SMALLER
        below = known[sizes[i - 1]]
        share = math.log(size / sizes[i - 1]) / math.log(sizes[i] / sizes[i - 1])
        return math.exp(math.log(below) + share * (math.log(above) - math.log(below)))

    def forget(self):
        self._known.clear()
