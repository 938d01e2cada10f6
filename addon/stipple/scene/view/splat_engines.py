# SPDX-License-Identifier: GPL-3.0-or-later
"""Which render engines draw splats, and what is said where the chosen one does not."""

import bpy
from bpy.app.handlers import persistent

from .. import handlers
from ..source import splat_data

STIPPLE, CYCLES = 'STIPPLE', 'STIPPLE_CYCLES'
ENGINES = ((CYCLES, "Cycles + Stipple", "Cycles renders meshes, lights and world; splats stand between them"),
           (STIPPLE, "Stipple", "Splats alone, with meshes as mattes"))
# From this version on Blender's own engines may draw splats.
_BLENDER_DRAWS_SPLATS = (5, 3, 0)


def draws_splats(engine):
    return engine in (STIPPLE, CYCLES) or bpy.app.version >= _BLENDER_DRAWS_SPLATS


def hint(scene):
    """The sentence for a scene with splats whose engine does not draw them, '' for others."""
    engine = scene.render.engine
    if draws_splats(engine):
        return ''
    count = sum(splat_data.is_splat_object(obj) and not obj.hide_render for obj in scene.objects)
    if count == 0:
        return ''
    name = {'CYCLES': 'Cycles', 'BLENDER_WORKBENCH': 'Workbench'}.get(engine, 'EEVEE' if 'EEVEE' in engine else engine)
    objects = 'the splats of 1 object' if count == 1 else f'the splats of {count} objects'
    return f'{name} does not draw {objects}'


@persistent
def _on_render_init(scene, *_):
    sentence = hint(scene)
    if sentence:
        print(f'Stipple: {sentence}; the engines Cycles + Stipple and Stipple do.')


_HANDLERS = (('render_init', _on_render_init),)


def register():
    handlers.add(_HANDLERS)


def unregister():
    handlers.remove(_HANDLERS)
