# SPDX-License-Identifier: GPL-3.0-or-later
"""Enumerations of stipple.h that fits and density control have; structs.py hands them out with all others."""

from enum import IntEnum


class FitModel(IntEnum):
    EXPLICIT = 0
    FIELD = 1
    MOTION = 2
    SCAFFOLD = 3
    RELAY = 4


class FitQuality(IntEnum):
    FAST = 0
    BALANCED = 1
    FINE_DETAIL = 2


class FitBackground(IntEnum):
    BLACK = 0
    WHITE = 1
    RANDOM = 2


class KeyFrameBlend(IntEnum):
    LEARNED = 0
    LINEAR = 1
    NONE = 2
    PLATEAU = 3


class FitShell(IntEnum):
    AUTO = 0
    ON = 1
    OFF = 2


class FitOptionKind(IntEnum):
    COUNT = 0
    NUMBER = 1
    BYTES = 2
    SWITCH = 3
    CHOICE = 4
    TEXT = 5


class SplatQuantity(IntEnum):
    SCORE = 0
    AGE = 1
    SPLIT_AXIS = 2
    CONTRIBUTION = 3
