# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of test_from_image_window.py inside the Blender with a window; window.py runs them."""

import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
import file_browser  # noqa: E402
from window_steps import addon  # noqa: E402

folder, weights, image = (Path(sys.argv[sys.argv.index('--') + i]) for i in (2, 4, 5))
facts = {}
STEPS, TOKENS = 1000, 512  # most of a minute, even with these small networks


def build(window):
    chosen = sys.modules[addon().__name__ + '.preferences'].get()
    chosen.weights_folder, chosen.cache_folder = str(weights), str(weights.parent / 'cache')
    bpy.data.objects.remove(bpy.data.objects['Cube'])
    # In a window of its own: redraws of the 3D view are what steps wait for.
    bpy.context.preferences.view.filebrowser_display_type = 'WINDOW'
    with window.context():
        bpy.ops.stipple.splats_from_image('INVOKE_DEFAULT', canvas='512', tokens=TOKENS, steps=STEPS, anchors=64)


def open_browser(_window):
    return None if file_browser.point_at(image) else False


def wait(_window):
    return None


def browse(_window):
    return 'browser'


def choose(_window):
    file_browser.accept()


def preview(window):
    """Until splats are shown that are no result yet."""
    obj = bpy.data.objects.get('chair Splats')
    if obj is None or count(obj) == 0:
        return False
    with window.context():
        bpy.ops.view3d.view_all()
    facts['preview'] = count(obj)
    facts['preview_has_source'] = bool(obj.data.stipple.source)
    return None


def shown(_window):
    return 'preview'


def escape(window):
    window.window.event_simulate(type='ESC', value='PRESS', x=10, y=10)
    window.window.event_simulate(type='ESC', value='RELEASE', x=10, y=10)


def stopped(_window):
    obj = bpy.data.objects.get('chair Splats')
    if obj is not None:
        assert not obj.data.stipple.source, 'the work ended before Esc was seen'
        return False
    facts['objects'] = sorted(obj.name for obj in bpy.data.objects)
    facts['kept'] = sorted(path.name for path in (weights.parent / 'cache').rglob('*') if path.is_file())
    return 'stopped'


def count(obj):
    return len(obj.data.vertices) if hasattr(obj.data, 'vertices') else len(obj.data.points)


steps = [build, open_browser, wait, browse, choose, preview, wait, shown, escape, stopped]
