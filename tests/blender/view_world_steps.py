# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of test_view_world.py inside the Blender with a window; window.py runs them."""

import sys
import time
from importlib import import_module
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import scenes  # noqa: E402
import shots  # noqa: E402
import view_lens_steps as views  # noqa: E402
from window_steps import BLUE, RED, addon, splats_of  # noqa: E402

# Fewer pixels than the add-on paints: the worlds here have no edges, and there are many.
STEPS = ((256, 1), (1024, 1))
facts = views.facts
facts['seconds'] = {}


def painter():
    return import_module(f'{addon().__name__}.viewport.view_world')


def build(window):
    """A square of splats before a world of many colours, through a camera."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    painter().STEPS = STEPS
    splats_of('Near', RED, (0.8, 0, -0.4))
    window.camera = scenes.camera((0, -6, 0), (np.pi / 2, 0.2, 0.4), width=400, height=300, lens=20.0)
    window.background = shots.set_panorama()
    scene = window.window.scene
    scene.render.engine = 'STIPPLE'
    scene.view_settings.view_transform = 'Standard'
    scene.render.dither_intensity = 0
    window.space.overlay.show_overlays = False
    window.space.show_gizmo = False
    window.region_data.view_perspective = 'CAMERA'
    window.space.shading.type = 'RENDERED'
    window.begun = time.perf_counter()


def painted(name):
    """A step that waits until the world is painted as finely as it gets, and until the view shows that."""
    def step(window):
        state = painter()._state
        if state.shown is not None and 'first ' + name not in facts['seconds'] and state.asked == state.wanted[:2]:
            facts['seconds']['first ' + name] = time.perf_counter() - window.begun
        if state.wanted is None or painter()._is_behind() or painter().is_waiting():
            return False
        facts['seconds'][name] = time.perf_counter() - window.begun
        return None
    return step


def taken(name):
    """The same, with a picture of the view and a render of it."""
    return [painted(name), views.taken(name), views.rendered(name)]


def turn(window):
    window.camera.rotation_euler = (1.2, 0.0, -2.5)


def brighter(window):
    window.begun = time.perf_counter()
    window.background.inputs['Strength'].default_value = 0.3


def gradient(window):
    """Nodes without an image."""
    window.begun = time.perf_counter()
    tree = window.background.id_data
    texture, ramp = tree.nodes.new('ShaderNodeTexGradient'), tree.nodes.new('ShaderNodeValToRGB')
    ramp.color_ramp.elements[0].color, ramp.color_ramp.elements[1].color = (0.9, 0.3, 0.1, 1.0), (0.1, 0.2, 0.9, 1.0)
    tree.links.new(tree.nodes.new('ShaderNodeTexCoord').outputs['Generated'], texture.inputs[0])
    tree.links.new(texture.outputs['Fac'], ramp.inputs['Fac'])
    tree.links.new(ramp.outputs['Color'], window.background.inputs['Color'])
    window.ramp = ramp


def ramp_changes(window):
    window.begun = time.perf_counter()
    window.ramp.color_ramp.elements[0].color = (0.1, 0.8, 0.1, 1.0)
    with window.context():
        bpy.ops.ed.undo_push(message='green')


def ramp_changes_again(window):
    window.begun = time.perf_counter()
    window.ramp.color_ramp.elements[0].color = (0.8, 0.1, 0.8, 1.0)
    with window.context():
        bpy.ops.ed.undo_push(message='pink')


def undo(window):
    window.begun = time.perf_counter()
    with window.context():
        bpy.ops.ed.undo()
    window.camera = bpy.context.scene.camera


def panorama(window):
    views.panorama(window)


def plain(window):
    facts['asked'] = list(painter()._state.asked)
    tree = bpy.context.scene.world.node_tree
    background = next(node for node in tree.nodes if node.type == 'BACKGROUND')
    for link in list(background.inputs['Color'].links):
        tree.links.remove(link)
    background.inputs['Color'].default_value = (0.2, 0.4, 0.6, 1.0)
    background.inputs['Strength'].default_value = 1.0


def no_picture(_window):
    facts['picture of a plain world'] = painter().picture(bpy.context.evaluated_depsgraph_get()) is not None


def move_something(_window):
    facts['versions'] = dict(painter()._state.versions)
    bpy.data.objects['Near Splats'].location.z += 0.1
    scenes.material('Other', BLUE)


def nothing_was_painted_for_it(_window):
    facts['versions after'] = dict(painter()._state.versions)


def finish(_window):
    state = painter()._state
    facts['process'] = state.painter._process.pid
    facts['sizes'] = list(state.shown[1].pixels.shape)


steps = [build, views.watch, *taken('panorama_world'), turn, views.taken('turned'), views.rendered('turned'), brighter,
         *taken('dimmer'), gradient, *taken('gradient'), ramp_changes, *taken('green'), ramp_changes_again,
         *taken('pink'), undo, views.watch, *taken('undone'), move_something, lambda _window: None,
         nothing_was_painted_for_it, panorama, views.taken('wide'), views.rendered('wide'), plain, no_picture,
         views.taken('plain'), views.rendered('plain'), finish]
