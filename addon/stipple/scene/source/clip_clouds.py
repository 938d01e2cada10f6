# SPDX-License-Identifier: GPL-3.0-or-later
"""Where splats that move are in the course of their clip, for edits that hold over all of it."""

import math

import bpy
import numpy as np

from ...binding.model import DecodeSettings
from ...binding.structs import Side
from . import source_paths, source_settings, sources

# Times that are looked at, at most; a longer clip is looked at in larger steps than a frame.
_MOST_TIMES = 250
# Of 8 bits: a splat below it shows nothing.
_LEAST_OPACITY = 1 / 255


def readers(target, whole_clip):
    """Functions that each give the whole cloud of an edits.Target, and never touch Blender: as it is shown, or, of splats
    that move, at every frame of their clip."""
    known = source_settings.of(target.obj.data.stipple)
    if not whole_clip or not known.has_time:
        return [lambda: target.cloud]
    source = sources.model(source_paths.file_of(target.obj.data))
    count = target.obj.data.stipple.source_count
    return [_reader(source, DecodeSettings(count, time=time)) for time in _times(known)]


def _reader(source, settings):
    return lambda: source.decode(settings)


def _times(known):
    render = bpy.context.scene.render
    frames = (known.time_end - known.time_begin) * render.fps / render.fps_base
    return np.linspace(known.time_begin, known.time_end, min(_MOST_TIMES, math.ceil(frames - 1e-6) + 1))


def crop(task, wanted, keep, inside):
    """The work of a Task: [(target, mask)] of what stays. What is ever inside while it shows is inside.

    In: wanted, [(target, its readers(), where it is cut)]; keep, of SIDES; inside(cloud, where, start, end) gives a mask
    [N] and is the part of the work between two fractions.
    """
    masks = []
    for i, (target, read_all, where) in enumerate(wanted):
        found = None
        for k, read in enumerate(read_all):
            begin, end = ((i + (k + more) / len(read_all)) / len(wanted) for more in (0, 1))
            task.advance(begin, 'Looking at the clip' if len(read_all) > 1 else 'Looking at the splats')
            cloud = read()
            seen = inside(cloud, where, begin, end).astype(bool)
            if len(read_all) > 1:
                seen &= cloud.opacities() >= _LEAST_OPACITY
            found = seen if found is None else found | seen
        masks.append((target, np.uint8(found == (Side[keep] == Side.INSIDE))))
    return masks
