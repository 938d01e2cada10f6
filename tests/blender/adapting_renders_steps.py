# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of test_mesh_adapt_renders_window.py inside the Blender with a window; window.py runs them."""

import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
import scenes  # noqa: E402
from adapting_steps import keys  # noqa: E402
from fit_steps import press  # noqa: E402

facts = {}


def state():
    """What an Esc while views are rendered leaves as it was."""
    scene = bpy.context.scene
    return [sorted(obj.name for obj in bpy.data.objects), sorted(obj.name for obj in bpy.context.selected_objects),
            sorted(obj.name for obj in scene.objects if obj.hide_render), scene.render.engine,
            scene.render.resolution_x, scene.render.film_transparent, keys()]


def finished():
    return [op.bl_idname for op in bpy.context.window_manager.operators].count('STIPPLE_OT_mesh_adapt_to_renders')


def wait(_window):
    return None


def build(window):
    """A large ball before a smaller, flat one."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    with window.context():
        flat = scenes.sphere('Flat', 32, 16)
        flat.scale, flat.display_type = (1.0, 1.0, 0.3), 'WIRE'
        scenes.sphere('Ball', 32, 16, radius=1.2)
        scenes.select(bpy.data.objects['Ball'], flat)
        bpy.ops.view3d.view_axis(type='FRONT')
        bpy.ops.ed.undo_push(message='before')
    window.region_data.view_distance = 6
    facts['before'] = state()


def ball(_window):
    return 'ball'


def open_menu(window):
    with window.context():
        bpy.ops.wm.call_menu(name='VIEW3D_MT_object')


def menu(_window):
    return 'menu'


def escape(window):
    press(window, 'ESC')


def ask(window, **settings):
    with window.context():
        bpy.ops.stipple.mesh_adapt_to_renders('INVOKE_DEFAULT', view_count=8, samples=1, image_size=48, **settings)


def ask_first(window):
    ask(window, steps=5)


def dialog(_window):
    return 'dialog'


def confirm(window):
    press(window, 'RET')


def rendering(_window):
    """Blender draws between two views, whose camera is in the scene."""
    if 'Stipple View' not in bpy.data.objects:
        return False
    facts['while_rendering'] = state()
    return 'rendering'


def cancelled(_window):
    if 'Stipple View' in bpy.data.objects:
        return False
    facts['cancelled'] = state()
    facts['finished_after_cancel'] = finished()
    return None


def ask_for_long(window):
    ask(window, steps=1000000)


def adapting(_window):
    """The preview shows the ball on its way."""
    if not keys() or min(abs(point.co.z) for point in bpy.data.objects['Ball'].data.shape_keys.key_blocks[-1].data
                         if point.co.xy.length < 0.05) > 0.8:
        return False
    facts['camera_is_gone'] = 'Stipple View' not in bpy.data.objects
    return 'adapting'


def ended(_window):
    if not finished():
        return False
    facts['ended'] = keys()
    return 'ended'


def undo(window):
    with window.context():
        bpy.ops.ed.undo()
    facts['undone'] = keys()


def ask_for_few(window):
    ask(window, steps=5)


def repeated(window):
    """Shift R once it is over: Blender has the same operator run again."""
    if not finished():
        return False
    facts['once'] = keys()
    with window.context():
        bpy.ops.screen.repeat_last('INVOKE_DEFAULT')
    return None


def twice(_window):
    facts['twice'] = keys()
    facts['in_list'] = finished()
    return 'repeated'


steps = [build, ball, open_menu, menu, escape, ask_first, dialog, confirm, rendering, escape, cancelled, ask_for_long,
         wait, confirm, adapting, escape, ended, undo, ask_for_few, wait, confirm, repeated, wait, twice, wait]
