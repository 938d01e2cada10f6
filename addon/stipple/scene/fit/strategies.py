# SPDX-License-Identifier: GPL-3.0-or-later
"""The ways of adding and removing splats, as the library lists them, for enums and panels."""

from functools import lru_cache
from zlib import crc32

from ... import binding
from ...binding import strategies as native, structs
from ...binding.errors import LibraryError, StippleError
from ..source import sources

ADAPTIVE, TEMPORAL = 'adaptive', 'temporal'
# As the preset of the quality has it; the number is that of the item in files.
BY_QUALITY, BY_QUALITY_NUMBER = 'by_quality', 1


@lru_cache(maxsize=1)
def _adaptive_alone():
    return (native.StrategyEntry(ADAPTIVE, "Adaptive", "", structs.FitModel.EXPLICIT),)


@lru_cache(maxsize=1)
def _of(library):
    return (tuple(entry for entry in native.strategies(library) if entry.model == structs.FitModel.EXPLICIT),
            tuple(native.strategy_parts(library)))


def _library():
    """None where it cannot be used."""
    if sources.library_problem():
        return None
    try:
        return sources.context().library
    except LibraryError:
        return None


def _listed():
    """(strategies of splats, parts); without the library the one that a fit starts from."""
    library = _library()
    return (_adaptive_alone(), ()) if library is None else _of(library)


@lru_cache(maxsize=2)  # Blender keeps no reference to the texts of items
def _strategy_items(entries):
    chosen = (BY_QUALITY, "By Quality", "The strategy that goes with the quality", BY_QUALITY_NUMBER)
    return (chosen, *((entry.name, entry.label, entry.summary,
                       0 if entry.name == ADAPTIVE else crc32(entry.name.encode()) & 0x7fffffff) for entry in entries))


@lru_cache(maxsize=2)
def _part_items(entries):
    return tuple((entry.name, entry.label, f"{entry.summary}. It decides {entry.decides}", 1 << entry.bit)
                 for entry in entries)


def strategy_items(_settings=None, _context=None):
    return _strategy_items(_listed()[0])


def part_items(_settings=None, _context=None):
    return _part_items(_listed()[1])


def chosen(settings):
    """The name of a fit's strategy, or of the one that goes with its quality."""
    if settings.strategy not in ('', BY_QUALITY):
        return settings.strategy
    library = _library()
    if library is None:
        return ADAPTIVE
    model = structs.FitModel.MOTION if settings.model == 'MOTION' else structs.FitModel.EXPLICIT
    strategy = binding.fit.fit_options(library, model, structs.FitQuality[settings.quality]).strategy_utf8
    return TEMPORAL if strategy is None else strategy.decode()


def summary(settings):
    """One sentence on a fit's strategy, which it names where the quality chooses it."""
    name = chosen(settings)
    found = next((entry for entries in _listed() for entry in entries if entry.name == name), None)
    if found is None:
        return ""
    return (f"{found.label}: " if name != settings.strategy else "") + found.summary


def text_of(settings):
    """A fit's strategy and its parts, as the library takes them."""
    parts = [name for name, *_ in part_items() if name in settings.parts]
    return '+'.join([chosen(settings)] + parts)


def problem(text):
    """Why a strategy and its parts do not go together, or None."""
    library = _library()
    return None if library is None else _problem(library, text)


def require(text):
    """Before views are rendered for minutes: raises StippleError where a strategy and its parts do not go together."""
    native.check_strategy(sources.context().library, text)


@lru_cache(maxsize=256)  # a panel asks with every drawing
def _problem(library, text):
    try:
        native.check_strategy(library, text)
    except StippleError as error:
        return str(error)
    return None
