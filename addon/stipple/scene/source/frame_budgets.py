# SPDX-License-Identifier: GPL-3.0-or-later
"""Which budgets splats have over the frames of a scene."""

from .. import limits
from . import source_settings, sources, sync

MODES = ('VIEWPORT', 'RENDER')


def is_animated(data):
    """Whether settings of a datablock may change with the frame."""
    animation = data.animation_data
    return animation is not None and (animation.action is not None or len(animation.drivers) > 0
                                      or len(animation.nla_tracks) > 0)


def gather(context, data):
    """[DecodeSettings] that a datablock has in the scene's range of frames, in the viewport and in renders: each once,
    in the order of the frames. Decodes nothing; the scene is at its own frame at the end. Errors: StippleError for
    settings out of range."""
    scene = context.scene
    data.update_tag()  # what a script has set may not be evaluated yet
    # Max Splats may be animated, and shares of it change with what others show.
    changes = (is_animated(data) or source_settings.of(data.stipple).has_time or scene.render.use_simplify
               or scene.animation_data is not None)
    if not changes:
        return list(dict.fromkeys(_at_frame(context, data)))
    before, found = (scene.frame_current, scene.frame_subframe), {}
    try:
        with sync.paused():  # nothing has to be shown
            for number in range(scene.frame_start, scene.frame_end + 1):
                scene.frame_set(number)
                found.update(dict.fromkeys(_at_frame(context, data)))
    finally:
        scene.frame_set(before[0], subframe=before[1])
    return list(found)


def _at_frame(context, data):
    depsgraph = context.evaluated_depsgraph_get()
    stipple = data.evaluated_get(depsgraph).stipple
    for mode in MODES:
        settings = sources.decode_settings(stipple, mode, depsgraph.scene)
        settings.check()
        yield sources.at_most(settings, limits.share(depsgraph, mode).most(data),
                              source_settings.of(stipple).least_budget)
