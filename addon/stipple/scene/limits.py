# SPDX-License-Identifier: GPL-3.0-or-later
"""Max Splats, under Simplify: how much of its own budget each object may show.

Everything that a view layer shows counts, each instance for itself. Objects with a budget share what those
without one leave over, in proportion to their own budgets.
"""

from collections import Counter
from dataclasses import dataclass

import bpy

from ..binding.errors import StippleError
from . import shown
from .sequence import sequences
from .source import source_settings, sources, splat_data

# Instances of each datablock, by name, that a view layer showed when it was evaluated last.
_seen = {}


@dataclass(frozen=True)
class Share:
    """Splats that datablocks show at most, by name; the others show what they have."""

    most_of: dict
    fixed: int  # splats without a budget

    def most(self, data):
        return self.most_of.get(data.name_full)


NO_LIMIT = Share({}, 0)


def limit(scene, mode):
    """Max Splats of a scene, None for none. mode: 'VIEWPORT' or 'RENDER'."""
    if not scene.render.use_simplify:
        return None
    return (scene.stipple.max_splats_render if mode == 'RENDER' else scene.stipple.max_splats) or None


def share(depsgraph, mode):
    """Each datablock's share of Max Splats. depsgraph: whose view layer and evaluated settings; None: the settings as
    they are, and what the active view layer showed last."""
    scene = bpy.context.scene if depsgraph is None else depsgraph.scene
    largest = limit(scene, mode)
    if largest is None:
        return NO_LIMIT
    counts = _seen.get(scene.name_full) if depsgraph is None else shown_counts(depsgraph)
    own, fixed = {}, 0
    for data in _splat_datablocks():
        name = data.name_full
        count = 1 if counts is None else counts[name]
        settings = data.stipple if depsgraph is None else data.evaluated_get(depsgraph).stipple
        budget = _budget(data, settings, scene.frame_current, mode)
        if budget is None:
            fixed += count * splat_data.count(data)
        else:
            own[name] = (budget, count)
    wanted = sum(budget * count for budget, count in own.values())
    left = max(largest - fixed, 0)
    if wanted <= left:
        return Share({}, fixed)
    return Share({name: max(1, budget * left // wanted) for name, (budget, _) in own.items()}, fixed)


def shown_counts(depsgraph):
    """Counter of how many instances of each splat datablock an engine shows, by name."""
    counts, splats = Counter(), shown.SplatObjects(depsgraph)
    for entry in depsgraph.object_instances:
        obj = splats.of(entry)
        if obj is not None and shown.is_shown(entry) and shown.seen_by_camera(entry, depsgraph):
            counts[obj.original.data.name_full] += 1
    return counts


def note(depsgraph):
    """Notes what a view layer shows, for calls of share() without a depsgraph."""
    _seen[depsgraph.scene.name_full] = shown_counts(depsgraph)


def forget():
    _seen.clear()


def has_budget(stipple):
    """Whether the number of splats that a datablock shows can be chosen."""
    return (stipple.is_sequence or source_settings.of(stipple).has_budget) and not stipple.edited


def _splat_datablocks():
    """Every splat datablock that has users."""
    return {obj.data.name_full: obj.data for obj in bpy.data.objects if splat_data.is_splat_object(obj)}.values()


def _budget(data, stipple, frame, mode):
    """Splats that a datablock would show; None where it has no budget. What cannot be read is said when it is shown."""
    if not has_budget(data.stipple):  # not animated, and evaluated copies learn of edits late
        return None
    if not stipple.is_sequence:
        settings = sources.decode_settings(stipple, mode)
        return max(settings.most_splats, 0)
    try:
        return sequences.frame_of(data, stipple, frame, mode).shown_count()
    except StippleError:
        return 0
