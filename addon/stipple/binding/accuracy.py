# SPDX-License-Identifier: GPL-3.0-or-later
"""How exact pictures are, and what that costs."""

from ctypes import byref, c_uint64
from dataclasses import dataclass

from .errors import check
from .structs import AccuracyLevel, StippleAccuracy, StippleAccuracyKnobInfo


@dataclass(frozen=True)
class AccuracyKnob:
    name: str        # the field of StippleAccuracy
    label: str
    bound: str       # how far off it may be, and what it costs
    has_bound: bool


def accuracy(library, level=AccuracyLevel.FINAL, **knobs):
    """A StippleAccuracy of a level, with fields set by name; raises StippleError where they do not go together."""
    made = StippleAccuracy()
    check(library, library.stipple_accuracy_init(int(level), byref(made)))
    for name, value in knobs.items():
        if name not in dict(StippleAccuracy._fields_):
            raise TypeError(f"accuracy() has no knob '{name}'")
        setattr(made, name, value)
    check(library, library.stipple_accuracy_check(byref(made)))
    return made


def accuracy_knobs(library):
    """Every knob with its label and the bound of its error, in the order in which they are shown."""
    count = c_uint64()
    check(library, library.stipple_accuracy_knob_count(byref(count)))
    knobs = []
    for index in range(count.value):
        info = StippleAccuracyKnobInfo()
        check(library, library.stipple_accuracy_knob_info(index, byref(info)))
        knobs.append(AccuracyKnob(info.name_utf8.decode(), info.label_utf8.decode(), info.bound_utf8.decode(),
                                  info.has_bound == 1))
    return knobs


def accuracy_level_name(library, level):
    return library.stipple_accuracy_level_name(int(level)).decode()


def accuracy_verdict(library, psnr):
    """What a PSNR means to who looks."""
    return library.stipple_accuracy_verdict(psnr).decode()
