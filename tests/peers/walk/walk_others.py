# SPDX-License-Identifier: GPL-3.0-or-later
"""Fourth Blender of walk.py: a scan that is cleaned with the mouse and exported, and photographs that splats are fitted
to."""

import sys
from importlib import import_module
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
import walk_parts as parts  # noqa: E402
import scenes  # noqa: E402  (walk_parts says where)

# Steps of the fit after which the user presses Stop and Keep Best.
ENOUGH = 30
burger, fox = {}, {}


def note():
    parts.note(burger=burger, fox=fox)


def clear():
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)


def import_burger(window):
    clear()
    with window.context():
        bpy.ops.stipple.splats_import(filepath=str(parts.ASSETS / 'burger.splat'), up_axis='-Y')
        bpy.ops.view3d.view_selected()
    burger['imported'] = parts.count(bpy.context.object)
    note()
    return 'burger'


def front_only(_window):
    bpy.context.scene.stipple.selection.front_only = True
    bpy.context.scene.stipple.selection.radius = 60


def brush(window):
    with window.context():
        bpy.ops.wm.tool_set_by_id(name='stipple.select_brush', space_type='VIEW_3D')


def press_and_move(window):
    """Over the ground beside the plate, with the button down."""
    x, y = place(window)
    window.window.event_simulate(type='MOUSEMOVE', value='NOTHING', x=x, y=y)
    window.window.event_simulate(type='LEFTMOUSE', value='PRESS', x=x, y=y)
    for i in range(1, 26):
        window.window.event_simulate(type='MOUSEMOVE', value='NOTHING', x=x + 12 * i, y=y + i)


def place(window):
    return window.region.x + window.region.width // 3, window.region.y + window.region.height // 4


def while_drawing(_window):
    return 'burger_drawing'


def release(window):
    x, y = place(window)
    window.window.event_simulate(type='LEFTMOUSE', value='RELEASE', x=x + 300, y=y + 25)


def selected(_window):
    return 'burger_selected'


def erase(window):
    with window.context():
        bpy.ops.stipple.erase_selected()


def erased(_window):
    left = parts.count(bpy.context.object)
    if left == burger['imported']:
        return False  # not decoded yet
    burger['erased'] = left
    note()
    return 'burger_erased'


def export(window):
    with window.context():
        for ending in ('ply', 'spz'):
            bpy.ops.stipple.splats_export('EXEC_DEFAULT', filepath=str(parts.OUT / f'burger.{ending}'))


def exported(_window):
    return None if all((parts.OUT / f'burger.{ending}').exists() for ending in ('ply', 'spz')) else False


def import_again(window):
    with window.context():
        for ending in ('ply', 'spz'):
            bpy.ops.stipple.splats_import(filepath=str(parts.OUT / f'burger.{ending}'))
            burger[ending] = parts.count(bpy.context.object)
    note()
    return 'burger_again'


def cameras(window):
    clear()
    path = str(parts.ASSETS / 'fox')
    with window.context():
        bpy.ops.stipple.cameras_import(filepath=path)
    fox['cameras'] = sum(obj.type == 'CAMERA' for obj in bpy.data.objects)
    settings = bpy.context.scene.stipple.fit
    settings.views_from, settings.dataset, settings.quality, settings.max_splats = 'DATASET', path, 'FAST', 20_000
    bpy.context.scene.camera = next(obj for obj in bpy.data.objects if obj.type == 'CAMERA')
    window.region_data.view_perspective = 'CAMERA'
    note()
    return 'fox_cameras'


def fitting():
    return import_module('.scene.fit.fitting', next(
        name for name in sys.modules if name.rpartition('.')[2] == 'stipple')).state


def fit(window):
    with window.context():
        bpy.ops.stipple.splats_fit('INVOKE_DEFAULT')


def fit_enough(_window):
    figures = fitting().figures
    if fitting().is_running and (figures is None or figures.iteration < ENOUGH):
        return False
    fox['iterations'] = figures.iteration
    return 'fox_fitting'


def stop(window):
    with window.context():
        if fitting().is_running:
            bpy.ops.stipple.fit_stop()


def stopped(_window):
    return False if fitting().is_running else None


def accept(window):
    with window.context():
        bpy.ops.stipple.fit_accept(hide_source=False)
    obj = next(iter(parts.splats()))
    scenes.select(obj)
    fox['count'], fox['state'] = parts.count(obj), parts.states()[obj.name]
    note()
    return 'fox_fitted'


def look_beside_the_camera(window):
    window.region_data.view_perspective = 'PERSP'
    with window.context():
        bpy.ops.view3d.view_selected()
    return 'fox_beside'


facts = parts.facts
steps = [import_burger, front_only, brush, press_and_move, while_drawing, release, selected, erase, erased, export,
         exported, import_again, cameras, fit, fit_enough, stop, stopped, accept, look_beside_the_camera]
