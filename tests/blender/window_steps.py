# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of test_window.py inside the Blender with a window; window.py runs them."""

import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import scenes  # noqa: E402

RED, BLUE = (0.8, 0.25, 0.05), (0.05, 0.2, 0.8)
facts = {}


def splats_of(name, color, location, anchors=4000):
    quad = scenes.quad(name)
    quad.rotation_euler.x = np.pi / 2
    quad.location = location
    scenes.material(name, color, quad)
    made = scenes.make_splats(quad, anchors=anchors)
    bpy.data.objects.remove(quad)
    return made


def note(window, name, point):
    """Where a point of the world lies in the picture of the screen."""
    from bpy_extras.view3d_utils import location_3d_to_region_2d
    x, y = location_3d_to_region_2d(window.region, window.region_data, point)
    facts.setdefault(name, []).append((window.region.x + x, window.window.height - 1 - (window.region.y + y)))


def addon():
    return next(module for name, module in sys.modules.items() if name.rpartition('.')[2] == 'stipple')


def build(window):
    """Two upright squares beside each other, seen from the front; the left one half behind a cube."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    window.left = splats_of('Left', RED, (-1.5, 0, 0))
    window.right = splats_of('Right', BLUE, (1.5, 0, 0))
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(-2.0, -1.0, 0))
    bpy.context.object.name = 'Cube'
    with window.context():
        bpy.ops.view3d.view_axis(type='FRONT')
    window.region_data.view_distance = 9
    window.space.overlay.show_floor = window.space.overlay.show_axis_x = window.space.overlay.show_axis_z = False
    window.space.overlay.show_ortho_grid = window.space.overlay.show_cursor = False
    window.space.overlay.show_outline_selected = False


def points_of_interest(window):
    note(window, 'left', (-1.0, 0, 0.3))
    note(window, 'behind_cube', (-2.0, 0, 0.2))
    note(window, 'right', (1.5, 0, 0.3))
    note(window, 'clipped', (1.5, 0, 0.8))
    note(window, 'nothing', (0, 0, 0.3))
    return 'solid'


def outlined(window):
    window.space.overlay.show_outline_selected = True
    scenes.select(window.right)
    return 'outlined'


def rendered_by_another_engine(window):
    window.window.scene.render.engine = 'BLENDER_WORKBENCH'
    window.space.shading.type = 'RENDERED'
    return 'workbench'


def native(window):
    window.window.scene.render.engine = 'STIPPLE'
    window.window.scene.view_settings.view_transform = 'Standard'
    window.space.shading.type = 'RENDERED'


def rested(_window):
    return 'native'


def clipped(window):
    window.space.shading.type = 'SOLID'  # where Blender offers the operator
    region = window.region
    scale = facts['clipped'][0][1] - facts['right'][0][1]  # pixels of half a metre, downwards
    with window.context():
        bpy.ops.view3d.clip_border(xmin=0, xmax=region.width - 1, ymin=0,
                                   ymax=int(region.height / 2 + abs(scale) * 1.2))
    assert window.region_data.use_clip_planes
    return 'clipped'


def clipped_native(window):
    window.space.shading.type = 'RENDERED'


def clipped_native_shot(_window):
    return 'clipped_native'


def local(window):
    window.space.shading.type = 'SOLID'
    window.region_data.use_clip_planes = False
    scenes.select(window.right)
    with window.context():
        bpy.ops.view3d.localview(frame_selected=False)
    return 'local'


def local_native(window):
    window.space.shading.type = 'RENDERED'


def local_native_shot(_window):
    return 'local_native'


def hidden(window):
    window.space.shading.type = 'SOLID'
    with window.context():
        bpy.ops.view3d.localview(frame_selected=False)
    window.left.hide_set(True)
    return 'hidden'


def points(window):
    window.left.hide_set(False)
    bpy.context.preferences.addons['stipple'].preferences.points_above = 5000
    return 'points'


def panel(window):
    bpy.context.preferences.addons['stipple'].preferences.points_above = 1_000_000
    scenes.select(window.right)
    for area in window.window.screen.areas:
        if area.type == 'PROPERTIES':
            area.spaces.active.context = 'DATA'
    return 'panel'


def broken_shader(_window):
    """A driver that refuses the shader: one message, points instead, no exception."""
    from importlib import import_module
    name = addon().__name__
    import_module(f'{name}.viewport.splat_shader')._VERTEX = 'no shader'
    import_module(f'{name}.viewport.drawing')._forget()
    return 'broken_shader'


def finish(_window):
    viewed = addon().scene.view.viewed
    facts['problem'] = viewed.state['graphics']
    facts['off'] = viewed.state['off']


def clicked(window):
    """A click on the edge of its box selects a splat object."""
    from bpy_extras.view3d_utils import location_3d_to_region_2d
    window.left.hide_set(False)
    scenes.select(window.right)
    corner = location_3d_to_region_2d(window.region, window.region_data, (-1.5, 0, 1.0))
    with window.context():
        bpy.ops.view3d.select(location=(int(corner.x), int(corner.y)))
    facts['clicked'] = [obj.name for obj in bpy.context.view_layer.objects if obj.select_get()]
    facts['left'].append(window.left.name)


def edit_mode(window):
    """Blender draws the points of what is edited: no problem is reported, and leaving is seen."""
    if window.left.type == 'MESH':
        scenes.select(window.left)
        with window.context():
            bpy.ops.object.mode_set(mode='EDIT')
    return 'edited'


def left_edit_mode(window):
    if window.left.type == 'MESH':
        with window.context():
            bpy.ops.object.mode_set(mode='OBJECT')
    scenes.select(window.right)
    facts['problems'] = dict(addon().scene.source.sync.problems)
    return 'left_edit_mode'


steps = [build, points_of_interest, outlined, rendered_by_another_engine, native, rested, clipped, clipped_native,
         clipped_native_shot, local, local_native, local_native_shot, hidden, clicked,
         edit_mode, left_edit_mode, points, panel, broken_shader, finish]
