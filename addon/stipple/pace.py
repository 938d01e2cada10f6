# SPDX-License-Identifier: GPL-3.0-or-later
"""How far long work is and how long it still takes: one estimate, for a bar and for the words beside it."""

import time

# Of a part that has just begun, the share that counts as done: a first step tells its length only when it is over.
_FIRST_SHARE = 0.02
# Seconds that all work is taken for until something of it is known.
_FIRST_GUESS = 30.0
# From this share on the pace of a part tells when it ends.
_TELLING_SHARE = 0.05
# A time is told from when the parts that have not begun, which are guessed, are at most this share of the work.
_MAX_GUESSED = 0.1


class Pace:
    """Work of several parts, one after the other.

    The bar covers its rest in the time that is left, whatever that is: it never goes back, moves from the first second
    on, and agrees with the words. A wrong estimate changes its speed and nothing else.
    """

    def __init__(self, parts, clock=time.monotonic):
        """parts: {name: weight}, in order; a weight is the part's usual share of the time."""
        self._weights, self._names, self._clock = dict(parts), list(parts), clock
        self._spent = {}  # part → seconds, of those that are over
        self._part = self._names[0]
        self._begun = self._updated = clock()
        self.fraction = 0.0       # of the bar
        self.seconds_left = None  # of everything, None while it is not known
        self.part_left = None     # of the present part, None while it is not known

    def update(self, part, share, seconds_left=None):
        """The work is in a part of which a share is done. seconds_left: of that part, where it says so itself."""
        now = self._clock()
        if part != self._part:
            self._spent[self._part] = now - self._begun
            self._part, self._begun = part, now
        elapsed, share = now - self._begun, min(max(share, 0.0), 1.0)
        self.part_left = seconds_left
        if seconds_left is None and share >= _TELLING_SHARE:
            self.part_left = elapsed * (1 - share) / share
        here, later = self._rest(elapsed, share)
        left = here + later
        guessed = sum(map(self._weights.get, self._behind())) / sum(self._weights.values())
        self.seconds_left = left if self.part_left is not None and guessed <= _MAX_GUESSED else None
        passed = now - self._updated
        self._updated = now
        if passed > 0:
            self.fraction += (1 - self.fraction) * passed / (passed + left)

    def _rest(self, elapsed, share):
        """Seconds left of the present part, and of those after it."""
        weight = self._weights[self._part]
        whole = None if self.part_left is None else elapsed + self.part_left
        if whole is None:
            whole = max(weight * self._second_per_weight(0.0, 0.0), elapsed / max(share, _FIRST_SHARE))
        per_weight = self._second_per_weight(whole, weight)
        return max(whole - elapsed, 0.0), sum(map(self._weights.get, self._behind())) * per_weight

    def _behind(self):
        """Parts that have not begun."""
        return self._names[self._names.index(self._part) + 1:]

    def _second_per_weight(self, seconds, weight):
        """From the parts that are over and one of which this is known."""
        for name, spent in self._spent.items():
            seconds, weight = seconds + spent, weight + self._weights[name]
        return seconds / weight if seconds > 0 else _FIRST_GUESS
