# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of test_mesh_adapt_window.py inside the Blender with a window; window.py runs them."""

import json
import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import file_browser  # noqa: E402
import photo_set  # noqa: E402
import scenes  # noqa: E402
from fit_steps import module, press  # noqa: E402

folder = Path(sys.argv[sys.argv.index('--') + 2])
facts = {}


def keys():
    found = bpy.data.objects['Ball'].data.shape_keys
    return [] if found is None else [key.name for key in found.key_blocks]


def build(window):
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    with window.context():
        bpy.ops.mesh.primitive_monkey_add(size=2, rotation=(0, 0, 0))
        head = bpy.context.object
        head.name, head.display_type = 'Head', 'WIRE'
        head.modifiers.new('Subdivision', 'SUBSURF').levels = 1
        scenes.sphere('Ball', 48, 24)
        scenes.select(bpy.data.objects['Ball'], head)
        bpy.ops.view3d.view_axis(type='FRONT')
    window.region_data.view_distance = 6
    with window.context():
        bpy.ops.ed.undo_push(message='before')


def wait(_window):
    return None


def ball(_window):
    facts['before'] = keys()
    return 'ball'


def open_menu(window):
    with window.context():
        bpy.ops.wm.call_menu(name='VIEW3D_MT_object')


def menu(_window):
    return 'menu'


def close_menu(window):
    press(window, 'ESC')


def start(window):
    with window.context():
        # More steps than anybody waits for.
        facts['started'] = list(bpy.ops.stipple.mesh_adapt('INVOKE_DEFAULT', steps=1000000, points=4000))


def previewed(_window):
    """The template has gone a good part of its way while the operator runs."""
    if not keys():
        return False
    key = bpy.data.objects['Ball'].data.shape_keys.key_blocks[-1]
    places = np.empty(len(key.data) * 3, np.float32)
    key.data.foreach_get('co', places)
    if np.ptp(np.linalg.norm(places.reshape(-1, 3), axis=1)) < 0.3:
        return False
    facts.setdefault('while_running', [])
    facts['while_running'] = facts['while_running'] + [op.bl_idname for op in bpy.context.window_manager.operators]
    return 'running'


def escape(window):
    press(window, 'ESC')


def ended(_window):
    if 'STIPPLE_OT_mesh_adapt' not in [op.bl_idname for op in bpy.context.window_manager.operators]:
        return False
    facts['ended'] = keys()
    facts['value'] = bpy.data.objects['Ball'].data.shape_keys.key_blocks[-1].value
    return None


def kept(_window):
    return 'kept'


def open_settings(window):
    """F9."""
    with window.context():
        bpy.ops.screen.redo_last('INVOKE_DEFAULT')


def settings(_window):
    return 'settings'


def undo(window):
    with window.context():
        bpy.ops.ed.undo()
    facts['undone'] = keys()


def undone(_window):
    return 'undone'


def even_out(window):
    scenes.select(bpy.data.objects['Ball'])
    with window.context():
        facts['evening'] = list(bpy.ops.stipple.mesh_even_out('INVOKE_DEFAULT', preview=False))


def evened(_window):
    if 'STIPPLE_OT_mesh_even_out' not in [op.bl_idname for op in bpy.context.window_manager.operators]:
        return False
    facts['evened'] = keys()
    return None


def evened_out(_window):
    return 'evened'


def photograph(window):
    """Images of the head, and a fresh ball."""
    capture = module('.scene.fit.view_capture')
    rigs = module('.scene.fit.view_rigs')
    head = bpy.data.objects['Head']
    head.display_type = 'TEXTURED'
    photo_set.write(rigs, capture, head, folder / 'set', 12, capture.CaptureSettings('CYCLES', 64, 4))
    bpy.data.objects.remove(bpy.data.objects['Ball'])
    with window.context():
        scenes.select(scenes.sphere('Ball', 48, 24))
        bpy.context.preferences.view.filebrowser_display_type = 'WINDOW'
        bpy.ops.stipple.mesh_adapt_to_images('INVOKE_DEFAULT', steps=100000, image_size=64, alignment='SIZE')


def find_images(_window):
    return None if file_browser.point_at(folder / 'set' / 'transforms.json') else False


def browse(_window):
    return 'browser'


def choose(_window):
    file_browser.accept()


def taught(_window):
    if 'STIPPLE_OT_mesh_adapt_to_images' not in [op.bl_idname for op in bpy.context.window_manager.operators]:
        return False
    facts['taught'] = keys()
    return None


def shown(_window):
    return 'from_images'


steps = [build, wait, ball, open_menu, wait, menu, close_menu, wait, start, previewed, escape, ended, wait, kept,
         open_settings, wait, settings, close_menu, wait, undo, wait, undone, even_out, evened, wait, evened_out,
         photograph, find_images, wait, wait, browse, choose, previewed, wait, escape, taught, wait, shown]
