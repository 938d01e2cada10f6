# SPDX-License-Identifier: GPL-3.0-or-later
"""Bar and words about the time that is left, by a clock that the test moves."""

import pytest

from stipple.pace import Pace

PARTS = {'views': 0.35, 'fit': 0.62, 'keep': 0.03}


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


class Watched:
    """Work whose bar and words are noted: [(seconds, fraction, seconds_left, part_left)]."""

    def __init__(self, parts=None):
        self.clock = Clock()
        self.pace = Pace(PARTS if parts is None else parts, self.clock)
        self.notes = []

    def run(self, part, steps, seconds, tells=True):
        """steps: how many; seconds: of each, a number or a function of its number. tells: says its rest itself."""
        length = [seconds(i) if callable(seconds) else seconds for i in range(steps)]
        for i in range(steps):
            for _ in range(10):  # a panel looks more often than steps end
                self.clock.now += length[i] / 10
                left = sum(length[i:]) if tells else None
                self.pace.update(part, i / steps, left)
                self.notes.append((self.clock.now - 100, self.pace.fraction, self.pace.seconds_left,
                                   self.pace.part_left))


def agree(notes, tolerance=0.1):
    """Where the bar gets by its present speed in the time that the words say: to its end."""
    compared = 0
    for (before, bar_before, _, _), (now, bar, left, _) in zip(notes, notes[1:]):
        if left is None or left < 1:
            continue
        reached = bar + (bar - bar_before) / (now - before) * left
        assert reached == pytest.approx(1.0, abs=tolerance), (now, bar, left)
        compared += 1
    return compared


def test_bar_and_words_agree_and_the_bar_never_goes_back():
    work = Watched()
    work.run('views', 60, 2.0)
    work.run('fit', 200, lambda i: 0.5 + 0.01 * i)  # steps that get slower
    work.run('keep', 3, 2.0)
    bars = [bar for _, bar, _, _ in work.notes]
    assert bars == sorted(bars) and 0.97 < bars[-1] < 1
    assert agree(work.notes) > 1500
    # Half of the time left, half of what was left of the bar: it moves evenly once the fit's length is known.
    whole = work.notes[-1][0]
    known = next(note for note in work.notes if note[2] is not None and note[0] > 125)
    middle = next(note for note in work.notes if note[0] >= (known[0] + whole) / 2)
    assert 1 - middle[1] == pytest.approx((1 - known[1]) / 2, abs=0.05)


def test_the_bar_moves_from_the_first_second_while_a_first_step_is_long():
    work = Watched()
    work.run('views', 4, 120.0, tells=False)
    first = [bar for seconds, bar, _, _ in work.notes if seconds <= 120]
    assert all(b > a for a, b in zip([0.0] + first, first))
    assert first[-1] < 0.4  # a quarter of the views, whose share is a third


def test_no_time_is_told_while_most_of_the_work_is_guessed():
    work = Watched()
    work.run('views', 60, 2.0, tells=False)
    assert all(left is None for _, _, left, _ in work.notes)
    ready = [rest for seconds, _, _, rest in work.notes if seconds > 20]
    assert ready[0] == pytest.approx(100, rel=0.2) and ready[-1] < 5
    work.run('fit', 100, 3.0)
    assert work.pace.seconds_left < 30
    told = [left for seconds, _, left, _ in work.notes if seconds > 121]
    assert None not in told and told[0] == pytest.approx(300, rel=0.1)


def test_a_wrong_estimate_changes_the_speed_alone():
    work = Watched()
    for left in (10, 10, 1000, 5, 600):
        for _ in range(50):
            work.clock.now += 1.0
            before = work.pace.fraction
            work.pace.update('fit', 0.5, left)
            assert before < work.pace.fraction < 1
    assert work.pace.seconds_left == pytest.approx(600, rel=0.2)


def test_work_without_its_first_parts():
    """Photographs need no views."""
    work = Watched()
    work.run('fit', 50, 1.0)
    work.run('keep', 2, 1.0)
    assert agree(work.notes) > 300 and work.notes[-1][1] > 0.95
