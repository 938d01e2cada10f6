# SPDX-License-Identifier: GPL-3.0-or-later
"""Which settings the splats of a datablock have.

The library is asked when a source is attached (stipple_model_settings), and its answer is kept with the datablock, so
that panels need not read a file. This file alone knows kinds of sources: all others ask of().
"""

import json
from dataclasses import asdict, dataclass
from functools import lru_cache

from ...binding import structs

KINDS = (('NONE', "None", "The splats have no source"),
         ('MODEL', "Model", "The source decodes to splats at any budget"),
         ('CLOUD', "Splats", "The source is splats, shown as they are"),
         ('TREE', "Splat Tree", "The source is a splat file, shown at any budget"))
# Properties of a datablock that note_model() and note_cloud() set.
PROPERTIES = ('source_kind', 'source_settings', 'learned_gaussians', 'learned_least', 'learned_most')
_MAX_INT = 2**31 - 1  # of Blender's properties
_MAX_GAUSSIANS = 32   # that models of earlier versions take


@dataclass(frozen=True)
class SourceSettings:
    """The defaults are those of splats that have no source."""

    has_source: bool = False
    has_budget: bool = False     # it is a model: splats at any budget
    counts_splats: bool = False  # the budget is a number of the source's own splats, else of anchors
    takes_mask: bool = True      # splats can be hidden
    default_budget: int = 0
    least_learned: int = 0       # budgets that it was learned for; 0: all are alike
    most_learned: int = 0
    min_gaussians: int = 1       # splats per anchor
    max_gaussians: int = 1
    default_gaussians: int = 1
    has_order: bool = False
    has_seed: bool = False
    has_time: bool = False       # its splats move
    time_begin: float = 0.0      # seconds: from when
    time_end: float = 0.0        # and to when; both stand still outside
    least_budget: int = 1        # that it takes
    most_budget: int = 0         # of anchors that there are; 0: any number is drawn
    has_smooth: bool = False     # budgets that move can make no splat jump

    @property
    def as_they_are(self):
        """Whether the source is a file whose splats are all shown."""
        return self.has_source and not self.has_budget

    @property
    def counts_anchors(self):
        return self.has_budget and not self.counts_splats

    @property
    def is_learned(self):
        return self.most_learned > 0


_NOTHING = SourceSettings()
_CLOUD = SourceSettings(has_source=True)
_TREE = SourceSettings(has_source=True, has_budget=True, counts_splats=True, has_smooth=True)


def of_model(settings):
    """In: settings, StippleModelSettings."""
    unit = settings.budget_unit
    counts_kept_anchors = unit == structs.BudgetUnit.ANCHORS and settings.maximum_budget < structs.MAX_ANCHORS
    return SourceSettings(
        True, True, unit == structs.BudgetUnit.SPLATS, bool(settings.takes_mask), settings.default_budget,
        settings.minimum_learned_budget, settings.maximum_learned_budget, settings.minimum_gaussians_per_anchor,
        settings.maximum_gaussians_per_anchor, settings.default_gaussians_per_anchor, bool(settings.has_order),
        bool(settings.has_seed), bool(settings.has_time), settings.time_begin, settings.time_end,
        settings.minimum_budget,
        settings.maximum_budget if counts_kept_anchors else 0, bool(settings.has_smooth))


def of(stipple):
    """The settings of a splat datablock's source."""
    return _known(stipple.source_kind, stipple.source_settings, stipple.learned_gaussians, stipple.learned_least,
                  stipple.learned_most)


def _stored(text):
    """The settings that a text holds; None where it holds none. A .blend from elsewhere may hold any text, nested to
    any depth too."""
    try:
        values = json.loads(text)
        # Settings of a later version that this one does not have are left out.
        known = SourceSettings.__dataclass_fields__
        chosen = {name: value for name, value in values.items() if name in known}
        if not all(isinstance(value, (bool, int, float)) for value in chosen.values()):
            return None
        # Versions before it did not store it.
        chosen.setdefault('has_smooth', bool(chosen.get('has_budget')) and not chosen.get('has_time'))
        return SourceSettings(**chosen)
    except (ValueError, RecursionError, AttributeError, TypeError):
        return None


@lru_cache(maxsize=256)
def _known(kind, stored, gaussians, least, most):
    if kind == 'NONE':
        return _NOTHING
    if kind == 'CLOUD':
        return _CLOUD
    settings = _stored(stored)
    if settings is not None:
        return settings
    if kind == 'TREE':
        return _TREE
    # Files of versions that did not store settings, and texts that hold none.
    return SourceSettings(True, True, False, False, most or 20_000, least, most, gaussians or 1,
                          gaussians or _MAX_GAUSSIANS, gaussians or 1, not gaussians, True, has_smooth=True)


def note_model(stipple, settings):
    """In: settings, SourceSettings of a model."""
    stipple.source_kind = 'TREE' if settings.counts_splats else 'MODEL'
    stipple.source_settings = json.dumps(asdict(settings))
    # What versions that do not read the text above go by.
    is_learned = settings.is_learned
    stipple.learned_gaussians = settings.default_gaussians if is_learned else 0
    stipple.learned_least = min(settings.least_learned, _MAX_INT)
    stipple.learned_most = min(settings.most_learned, _MAX_INT)


def note_tree(stipple):
    """Notes splats with a budget whose file is yet to be read."""
    note_model(stipple, _TREE)


def note_cloud(stipple):
    """Notes splats as they are."""
    stipple.source_kind = 'CLOUD'
    stipple.source_settings = ''
    stipple.learned_gaussians = stipple.learned_least = stipple.learned_most = 0
