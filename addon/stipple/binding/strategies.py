# SPDX-License-Identifier: GPL-3.0-or-later
"""The ways of adding and removing splats that the library knows."""

from ctypes import byref, c_uint64
from dataclasses import dataclass

from .errors import check
from .structs import NO_INDEX, FitModel, StippleStrategyInfo, StippleStrategySetting


@dataclass(frozen=True)
class StrategySetting:
    name: str
    default: float
    minimum: float
    maximum: float
    is_whole: bool   # a count, or 0 and 1 for no and yes


@dataclass(frozen=True)
class StrategyEntry:
    name: str        # as the option strategy takes it
    label: str       # for people
    summary: str     # one sentence for artists
    model: FitModel  # that it is for
    decides: str = ''      # in words, with commas between
    bit: int | None = None  # of a part: under which files keep it
    settings: tuple = ()   # of StrategySetting


def strategies(library):
    """Every strategy, in the order in which they are shown."""
    return _entries(library, library.stipple_strategy_count, library.stipple_strategy_info)


def strategy_parts(library):
    """Parts that go into strategies of explicit splats: 'strategy+part'."""
    return _entries(library, library.stipple_strategy_part_count, library.stipple_strategy_part_info)


def check_strategy(library, strategy):
    """Raises StippleError with the reason where explicit splats do not take it."""
    check(library, library.stipple_strategy_check(strategy.encode()))


def _entries(library, count_of, info_of):
    count = c_uint64()
    check(library, count_of(byref(count)))
    entries = []
    for index in range(count.value):
        info = StippleStrategyInfo()
        check(library, info_of(index, byref(info)))
        name = info.name_utf8.decode()
        entries.append(StrategyEntry(name, info.label_utf8.decode(), info.summary_utf8.decode(), FitModel(info.model),
                                     info.decides_utf8.decode(), None if info.bit == NO_INDEX else info.bit,
                                     tuple(_setting(library, name, i) for i in range(info.setting_count))))
    return entries


def _setting(library, name, index):
    setting = StippleStrategySetting()
    check(library, library.stipple_strategy_setting(name.encode(), index, byref(setting)))
    return StrategySetting(setting.name_utf8.decode(), setting.default_value, setting.minimum, setting.maximum,
                           bool(setting.is_whole))
