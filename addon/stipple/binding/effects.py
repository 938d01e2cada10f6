# SPDX-License-Identifier: GPL-3.0-or-later
"""Which effects an image needs, and why."""

import math
from ctypes import byref, pointer
from dataclasses import dataclass

from .errors import check
from .renderer import instance_array
from .structs import Effect, StippleEffectFacts, StippleEffectRow, StippleEffectsSurvey


@dataclass(frozen=True)
class EffectRow:
    effect: Effect
    is_on: bool
    reason: str
    seconds: float  # NaN: not measured
    sh_degree: int  # of Effect.VIEW_COLOUR

    @property
    def is_measured(self):
        return not math.isnan(self.seconds)


def survey(context, instances, camera):
    """What splats say: instances as of instance_array. Errors: StippleError."""
    made = StippleEffectsSurvey()
    check(context.library, context.library.stipple_effects_survey(context.pointer, instance_array(instances),
                                                                  len(instances), byref(camera), byref(made)))
    return made


def facts(library, seen=None, seconds=None, **given):
    """StippleEffectFacts with these fields. seen: of survey, or None; seconds: {Effect: measured}."""
    made = StippleEffectFacts()
    library.stipple_effect_facts_init(byref(made))
    for name, value in given.items():
        setattr(made, name, value)
    for effect, value in (seconds or {}).items():
        made.seconds[effect] = value
    if seen is not None:
        made.survey = pointer(seen)
    return made


def plan(library, given):
    """[EffectRow], one of each effect. Errors: StippleError."""
    rows = (StippleEffectRow * len(Effect))(*(StippleEffectRow() for _ in Effect))
    check(library, library.stipple_effects_plan(byref(given), rows, len(rows)))
    return [EffectRow(Effect(row.effect), bool(row.is_on), row.reason.decode(), row.seconds, row.sh_degree)
            for row in rows]
