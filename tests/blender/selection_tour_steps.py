# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of make_pictures.py for the page on selecting splats; window.py runs them."""

import json
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
import picture_steps  # noqa: E402
import scenes  # noqa: E402
import selection_steps  # noqa: E402

HEIGHT = 1150  # of the screen, pixels
# Parts of the screen: from the left, from the top, width, height.
PARTS = {'select_brush': (0, 28, 680, 420), 'panel_select': (1092, 640, 188, 485)}


def build(window):
    """A terrain, of splats of a file."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    window.obj = picture_steps.splats_of('terrain.blend')
    scenes.select(window.obj)
    assert bpy.ops.stipple.use_as_new_source() == {'FINISHED'}
    for obj in list(bpy.data.objects):
        if obj != window.obj:
            bpy.data.objects.remove(obj)
    view = window.region_data
    view.view_distance = 7.0
    view.view_rotation = picture_steps.Euler((0.6, 0.0, 0.5)).to_quaternion()
    view.view_location = (0.0, 0.0, 0.0)
    overlay = window.space.overlay
    overlay.show_floor = overlay.show_axis_x = overlay.show_axis_y = overlay.show_cursor = False
    window.space.show_region_toolbar = True
    window.space.show_gizmo_navigate = overlay.show_text = False
    selection_steps.open_panels()
    for area in window.window.screen.areas:
        if area.type == 'PROPERTIES':
            area.spaces.active.context = 'DATA'


STROKE = ((-220, 170), (-190, 200), (-150, 216), (-110, 210), (-60, 190), (-20, 186), (20, 200))


def parts(_window):
    for name, (left, top, width, height) in PARTS.items():
        (selection_steps.folder() / f'{name}.json').write_text(json.dumps((left, HEIGHT - top - height, width, height)))


steps = [build, selection_steps.tool('stipple.select_brush'), *selection_steps.drag(STROKE), parts,
         lambda _window: 'select_brush', lambda _window: 'panel_select']
