# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of test_fit_window.py inside the Blender with a window; window.py runs them."""

import importlib
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
import scenes  # noqa: E402

facts = {}
previews = {}


def module(name):
    addon = next(module for module in sys.modules if module.rpartition('.')[2] == 'stipple')
    return importlib.import_module(name, addon)


def prepare_ball(quality):
    """A selected ball of two colours alone in the scene, and settings of a quick fit."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    ball = scenes.sphere(segments=24, rings=12)
    scenes.image_material('Halves', scenes.half_image(), ball)
    scenes.select(ball)
    settings = bpy.context.scene.stipple.fit
    settings.view_count, settings.view_size, settings.engine, settings.max_splats = 12, 64, 'WORKBENCH', 3000
    settings.quality = quality


def show_panel(window):
    """The sidebar with the panel, in a tab that every Blender opens first, beside the scene from its front."""
    window.space.show_region_ui = True
    for panel in reversed(module('.panels.fit').classes):
        bpy.utils.unregister_class(panel)
    for panel in module('.panels.fit').classes:
        panel.bl_category = 'Item'
        bpy.utils.register_class(panel)
    with window.context():
        bpy.ops.view3d.view_axis(type='FRONT')
    window.region_data.view_distance = 6


def build(window):
    """A ball."""
    prepare_ball('BALANCED')
    show_panel(window)


def panel(_window):
    return 'panel'


def start(window):
    settings = bpy.context.scene.stipple.fit
    settings.quality, settings.view_size = 'FINE_DETAIL', 160  # runs longer than the test waits
    with window.context():
        assert bpy.ops.stipple.splats_fit('INVOKE_DEFAULT') == {'RUNNING_MODAL'}


def rendering(_window):
    """Blender draws between two views."""
    state = module('.scene.fit.fitting').state
    if 'Rendering' not in state.stage:
        return False
    facts['said_while_rendering'] = state.stage
    return 'rendering'


def previewed(window):
    """The preview is there while the fit goes on, and held-out views were measured."""
    state = module('.scene.fit.fitting').state
    assert state.is_running, state.problem
    if 'Sphere Fit' not in bpy.data.objects or not state.figures.psnr > 20:
        return False
    # A preview is up to seconds older than the figures, and the first shows the start, which is nearly transparent.
    shown = module('.scene.source.splat_data').fingerprint(bpy.data.objects['Sphere Fit'].data)
    if previews.setdefault('when measured', shown) == shown:
        return False
    source = bpy.data.objects['Sphere']
    facts['previewed_while_running'] = source.hide_get() and not source.hide_render
    facts['estimates'] = state.figures.estimated_seconds, state.figures.estimated_bytes, state.seconds_left
    return 'running'


def compare(_window):
    bpy.context.scene.stipple.fit.shown = 'SOURCE'
    facts['source_shows'] = not bpy.data.objects['Sphere'].hide_get() and bpy.data.objects['Sphere Fit'].hide_get()
    return 'source'


def escape(window):
    """A key, as a hand presses it."""
    bpy.context.scene.stipple.fit.shown = 'SPLATS'
    press(window, 'ESC')


def press(window, key):
    region = window.region
    for value in ('PRESS', 'RELEASE'):
        window.window.event_simulate(type=key, value=value, x=region.x + 200, y=region.y + 200)


def ended(_window):
    state = module('.scene.fit.fitting').state
    if state.is_running:
        return False
    facts['problem'], facts['psnr'] = state.problem, state.figures.best_psnr
    facts['steps'], facts['of_steps'] = state.figures.iteration, state.figures.iterations
    return None


def proposed(_window):
    facts['proposed'] = module('.scene.fit.fit_proposal').find(bpy.context) is not None
    facts['count'] = module('.scene.fit.fitting').state.kept_count
    facts['nothing_replaced'] = not bpy.data.objects['Sphere'].hide_render
    return 'proposed'


def report(window):
    """In a window of its own: no Image Editor is open."""
    with window.context():
        assert bpy.ops.stipple.show_report() == {'FINISHED'}
    return 'report'


def close_report(_window):
    reports = module('.scene.fit.fit_reports')
    (other, area), = reports.editors(bpy.context)
    facts['report'] = area.spaces.active.image.name
    facts['windows'] = len(bpy.context.window_manager.windows)
    with bpy.context.temp_override(window=other):
        bpy.ops.wm.window_close()


def discard(window):
    with window.context():
        assert bpy.ops.stipple.fit_discard() == {'FINISHED'}
    facts['discarded'] = 'Sphere Fit' not in bpy.data.objects and not bpy.data.objects['Sphere'].hide_get()
    facts['reports_left'] = [image.name for image in bpy.data.images if 'Report' in image.name]
    scenes.select(bpy.data.objects['Sphere'])


def stop(_window):
    """By the button, once there is something to keep."""
    state = module('.scene.fit.fitting').state
    if state.figures is None or not state.figures.psnr > 0:
        return False
    assert bpy.ops.stipple.fit_stop() == {'FINISHED'}


def accept(window):
    with window.context():
        assert bpy.ops.stipple.fit_accept() == {'FINISHED'}
    facts['source_is_hidden'] = bpy.data.objects['Sphere'].hide_render
    facts['kind'] = bpy.data.objects['Sphere Fit'].data.stipple.source_kind
    facts['active'] = bpy.context.view_layer.objects.active.name
    return 'accepted'


steps = [build, panel, start, rendering, previewed, compare, escape, ended, proposed, report, close_report, discard,
         start, stop, ended, accept]
