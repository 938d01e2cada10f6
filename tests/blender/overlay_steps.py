# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of test_overlay_window.py inside the Blender with a window; window.py runs them."""

import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
import scenes  # noqa: E402
from fit_steps import module, prepare_ball  # noqa: E402

facts = {}


def build(window):
    """A ball in the middle of an empty view."""
    prepare_ball('FINE_DETAIL')
    overlay = window.space.overlay
    overlay.show_floor = overlay.show_ortho_grid = overlay.show_cursor = overlay.show_outline_selected = False
    overlay.show_axis_x = overlay.show_axis_y = overlay.show_axis_z = False
    with window.context():
        bpy.ops.view3d.view_axis(type='FRONT')
    window.region_data.view_distance = 4
    region = window.region
    facts['middle'] = (region.x + region.width / 2, window.window.height - 1 - (region.y + region.height / 2))


def start(window):
    settings().kind = 'CONTRIBUTION'
    with window.context():
        assert bpy.ops.stipple.splats_fit('INVOKE_DEFAULT') == {'RUNNING_MODAL'}


def settings():
    return bpy.context.scene.stipple.overlay


def live(_window):
    """The preview of a fit that runs tells contributions, of splats that are no longer as faint as they begin."""
    obj = bpy.data.objects.get('Sphere Fit')
    if obj is None or 'seen:contribution' not in obj.data.attributes or len(obj.data.attributes['scale'].data) < 500:
        return False
    opacities = [element.color[3] for element in obj.data.attributes['radiance:base'].data]
    if sum(opacities) / len(opacities) < 0.3:
        return False
    facts['is_running'] = module('.scene.fit.fitting').state.is_running
    return 'live'


def stop(_window):
    state = module('.scene.fit.fitting').state
    # Splats multiply for the first time at 100 of 4000 iterations.
    if state.figures is None or not state.figures.psnr > 0 or state.figures.iteration < 420:
        return False
    assert bpy.ops.stipple.fit_stop() == {'FINISHED'}


def ended(_window):
    return None if not module('.scene.fit.fitting').state.is_running else False


def accept(window):
    with window.context():
        assert bpy.ops.stipple.fit_accept() == {'FINISHED'}
    bpy.ops.object.select_all(action='DESELECT')


def of(kind, name):
    def step(_window):
        settings().kind = kind

    def shot(_window):
        return name

    return [step, shot]


def without_overlays(window):
    window.space.overlay.show_overlays = False


def hidden(window):
    return 'hidden'


def with_overlays(window):
    window.space.overlay.show_overlays = True


def densify(window):
    """The boundary of the halves is where splats multiply."""
    obj, ball = bpy.data.objects['Sphere Fit'], bpy.data.objects['Sphere']
    ball.hide_render = False
    ball.hide_set(False)
    scenes.select(ball, obj)
    bpy.context.view_layer.objects.active = obj
    with window.context():
        assert bpy.ops.stipple.splats_densify('EXEC_DEFAULT', strategy='adaptive(threshold=1e-7)') == {'FINISHED'}
    ball.hide_set(True)
    bpy.ops.object.select_all(action='DESELECT')


def popover(window):
    window.window.cursor_warp(window.area.x + window.area.width // 2, window.area.y + window.area.height - 60)
    with window.context():
        bpy.ops.wm.call_panel(name='VIEW3D_PT_overlay', keep_open=True)


def wait(_window):
    return None


def popover_shot(_window):
    return 'popover'


steps = [build, start, live, stop, ended, accept, *of('OFF', 'own'), *of('AGE', 'age'), *of('SCORE', 'score'),
         *of('SPLIT_AXIS', 'axis'), *of('CONTRIBUTION', 'contribution'), without_overlays, hidden, with_overlays,
         densify, *of('AGE', 'densified'), popover, wait, popover_shot]
