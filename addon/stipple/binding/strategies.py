# SPDX-License-Identifier: GPL-3.0-or-later
"""The ways of adding and removing splats that the library knows."""

from ctypes import byref, c_uint64
from dataclasses import dataclass

from .errors import check
from .structs import FitModel, StippleStrategyInfo


@dataclass(frozen=True)
class StrategyEntry:
    name: str        # as the option strategy takes it
    summary: str     # one sentence for artists
    model: FitModel  # that it is for


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
        entries.append(StrategyEntry(info.name_utf8.decode(), info.summary_utf8.decode(), FitModel(info.model)))
    return entries
