# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of test_motion_fit_window.py inside the Blender with a window; window.py runs them."""

import sys
import tempfile
import time
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import moving_scene  # noqa: E402
from fit_steps import module, press, show_panel  # noqa: E402

LATEST = 4.0  # seconds until a preview is shown, at every 1.5 seconds
facts = {}
_shown = {}


def fit():
    return bpy.context.scene.stipple.fit


def state():
    return module('.scene.fit.fitting').state


def look():
    """What a stopped fit must leave as it was."""
    scene = bpy.context.scene
    return (scene.frame_current, scene.frame_subframe, str(scene.camera), scene.render.engine,
            scene.render.resolution_x, [(obj.name, obj.hide_get(), obj.hide_render) for obj in bpy.data.objects],
            [tuple(obj.matrix_world.translation) for obj in bpy.data.objects])


def build(window):
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    moving_scene.build(Path(tempfile.mkdtemp(prefix='stipple-steps-')))
    # Runs longer than the test waits.
    moving_scene.settings(view_count=8, image_count=96, max_splats=4000, quality='FINE_DETAIL')
    window.space.shading.color_type = 'TEXTURE'
    show_panel(window)
    bpy.context.scene.frame_set(9)


def panel(_window):
    return 'panel'


def start(window):
    facts['before'] = repr(look())
    with window.context():
        assert bpy.ops.stipple.splats_fit('INVOKE_DEFAULT') == {'RUNNING_MODAL'}


def rendering(_window):
    if not state().stage.startswith('Rendering view 2'):
        return False
    facts['said'] = state().stage
    facts['was_elsewhere'] = repr(look()) != facts['before']
    return 'rendering'


def escape(window):
    press(window, 'ESC')


def stopped(_window):
    if state().is_running:
        return False
    facts['as_before'] = repr(look()) == facts['before']
    facts['said_after'] = state().problem


def told(_window):
    """The panel knows by now how long views take."""
    return 'told'


def previewed(frame, name):
    """A step that waits for a preview at a frame, where the first is up to seconds old."""
    def step(window):
        assert state().is_running, state().problem
        figures = state().figures
        if figures is None or figures.iteration < 500 or state().name not in bpy.data.objects:
            return False
        if _shown.get('frame') != frame:
            bpy.context.scene.frame_set(frame)
            _shown.update(frame=frame, made_at=figures.preview_iteration, changed_at=time.monotonic())
            return False
        is_shown = time.monotonic() > _shown['changed_at'] + LATEST
        if figures.preview_iteration < _shown['made_at'] + 200 or not is_shown:
            return False
        return name
    return step


def end(_window):
    if state().is_running:  # a quick machine may be done
        assert bpy.ops.stipple.fit_stop() == {'FINISHED'}


def ended(_window):
    if state().is_running:
        return False
    facts['problem'] = state().problem
    facts['psnr'], facts['count'] = state().figures.best_psnr, state().kept_count


def accept(window):
    with window.context():
        assert bpy.ops.stipple.fit_accept() == {'FINISHED'}
    obj = bpy.context.view_layer.objects.active
    stored = obj.data.stipple
    facts['clip'] = (obj.name, stored.frame_start, stored.frame_speed, stored.time_mode)
    facts['hidden'] = bpy.data.objects['Sphere'].hide_render and bpy.data.objects['Cube'].hide_render


def at(frame):
    """A step that plays to a frame and notes where what is red or blue lies."""
    def step(_window):
        if _shown.get('played') != frame:
            bpy.context.scene.frame_set(frame)
            _shown['played'] = frame
            return False
        splats = module('.scene.source.splat_data').read(bpy.context.view_layer.objects.active.data)
        red = splats.positions[(splats.opacities > 0.5) & (splats.sh[:, 0, 1] < -1)]
        facts[f'at {frame}'] = float(np.median(red[:, 0]))
        return f'at_{frame}'
    return step


steps = [build, panel, start, rendering, escape, stopped, told, start, previewed(3, 'preview_first'),
         previewed(26, 'preview_last'), end, ended, accept, at(3), at(26)]
