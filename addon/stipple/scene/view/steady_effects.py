# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects that Auto has switched on in an animation stay on until it is rendered: to come and go would flicker."""

import dataclasses

from bpy.app.handlers import persistent

from ...binding import structs
from .. import handlers

# Whose coming shows: Auto's degree of harmonics carries all but what nobody sees.
KEPT = ('EXACT_PROJECTION', 'ZOOM_ANTIALIASING')

_since = {}  # {(scene, effect): the first frame that had it} of the animation that is being rendered


def kept(scene, rows):
    """The rows of a plan for the present frame of an animation, those on that an earlier frame of it has had."""
    rows = list(rows)
    for name in KEPT:
        if getattr(scene.stipple, name.lower()) != 'AUTO':
            continue
        effect = structs.Effect[name]
        key = scene.name_full, effect
        if rows[effect].is_on:
            _since.setdefault(key, scene.frame_current)
        elif key in _since:
            rows[effect] = dataclasses.replace(rows[effect], is_on=True,
                                               reason=f'On since frame {_since[key]} of this animation')
    return rows


@persistent
def _begin(*_):
    _since.clear()


_HANDLERS = (('render_init', _begin), ('load_post', _begin))


def register():
    handlers.add(_HANDLERS)


def unregister():
    handlers.remove(_HANDLERS)
    _since.clear()
