# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of test_generate_window.py inside the Blender with a window; window.py runs them."""

import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
from window_steps import addon  # noqa: E402

facts = {'names': []}
weights = sys.argv[sys.argv.index('--') + 4]


def build(window):
    """The default cube is selected, and a second editor shows the preferences of the add-on."""
    chosen = sys.modules[addon().__name__ + '.preferences'].get()
    chosen.weights_folder = weights
    chosen.cache_folder = str(Path(weights).parent / 'cache')
    with window.context():
        bpy.ops.screen.area_split(direction='VERTICAL', factor=0.5)
    other = [area for area in window.window.screen.areas if area.type == 'VIEW_3D'][-1]
    other.type = 'PREFERENCES'
    bpy.context.preferences.active_section = 'ADDONS'
    bpy.ops.preferences.addon_show(module=addon().__name__)
    facts['preferences'] = other.x, other.y, other.width, other.height


def preferences(_window):
    return 'preferences'


def ask(window):
    with window.context():
        bpy.ops.stipple.splats_from_render('INVOKE_DEFAULT', canvas='512', tokens=64, steps=30, samples=1,
                                           engine='CYCLES', anchors=64, seed_count=1)


def dialog(_window):
    return 'dialog'


def confirm(window):
    window.window.event_simulate(type='RET', value='PRESS', x=10, y=10)
    window.window.event_simulate(type='RET', value='RELEASE', x=10, y=10)


def running(_window):
    """Until the result is there; names of objects on the way."""
    names = sorted(obj.name for obj in bpy.data.objects)
    if not facts['names'] or facts['names'][-1] != names:
        facts['names'].append(names)
    obj = bpy.data.objects.get('Cube Splats')
    return None if obj is not None and obj.data.stipple.source else False


def made(_window):
    obj = bpy.data.objects['Cube Splats']
    facts['count'] = len(obj.data.vertices) if hasattr(obj.data, 'vertices') else len(obj.data.points)
    facts['location'] = tuple(obj.location)
    facts['cube_hidden'] = bpy.data.objects['Cube'].hide_render
    return 'made'


def wait(_window):
    return None


steps = [build, wait, preferences, ask, dialog, confirm, running, wait, made]
