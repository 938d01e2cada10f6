# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of test_binding_window.py inside the Blender with a window; window.py runs them."""

import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
import scenes  # noqa: E402
from tour_steps import LEFT_OUT, show_tab  # noqa: E402
from window_steps import addon  # noqa: E402

facts = {}


def note(name):
    """Where the stored splats are along z, on average, and how many bindings there are."""
    splats = bpy.data.objects['Square Splats']
    arrays = addon().scene.source.splat_data.read(splats.data)
    facts[name] = float(arrays.positions[:, 2].mean())
    facts[f'{name}_bound'] = splats.data.stipple.bind_object is not None
    return name


def key_block():
    return bpy.data.objects['Square'].data.shape_keys.key_blocks['Up']


def build(window):
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    for name in LEFT_OUT:
        if hasattr(bpy.types, name):
            bpy.utils.unregister_class(getattr(bpy.types, name))
    panel = addon().panels.data.STIPPLE_PT_binding
    bpy.utils.unregister_class(panel)
    panel.bl_options = set()
    bpy.utils.register_class(panel)
    square = scenes.quad('Square')
    scenes.material('Red', obj=square)
    square.shape_key_add(name='Basis')
    key = square.shape_key_add(name='Up')
    key.value = 0.0  # from Blender 5 on they begin at 1
    for point in key.data:
        point.co.z += 1.5
    scenes.make_splats(square, anchors=2000)
    with window.context():
        bpy.ops.view3d.view_axis(type='FRONT')
    window.region_data.view_distance = 9
    window.space.overlay.show_floor = window.space.overlay.show_axis_x = window.space.overlay.show_axis_z = False
    show_tab(window, 'DATA')
    with window.context():
        bpy.ops.ed.undo_push(message='before')


def unbound(_window):
    return note('unbound')


def bind(window):
    with window.context():
        assert bpy.ops.stipple.bind_to_mesh('INVOKE_DEFAULT') == {'FINISHED'}
        bpy.ops.ed.undo_push(message='Bind to Mesh')


def rest(_window):
    return note('rest')


def move(_window):
    """As by the slider of the shape key, which nothing animates."""
    key_block().value = 1.0


def wait(_window):
    return None


def moved(_window):
    return note('moved')


def undo(window):
    key_block().value = 0.0
    with window.context():
        bpy.ops.ed.undo_push(message='Shape key')
        bpy.ops.ed.undo()
        bpy.ops.ed.undo()


def undone(_window):
    return note('undone')


def redo(window):
    with window.context():
        bpy.ops.ed.redo()
    key_block().value = 0.5


def redone(_window):
    return note('redone')


steps = [build, wait, unbound, bind, wait, rest, move, wait, moved, undo, wait, undone, redo, wait, redone]
