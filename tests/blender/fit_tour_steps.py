# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of make_pictures.py for docs/fitting_in_blender.md: from a mesh to a field and its budgets, then from pictures
of a data set; window.py runs them."""

import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler, Vector

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import photo_set  # noqa: E402
import scenes  # noqa: E402
import tour_steps  # noqa: E402
from fit_steps import module  # noqa: E402

VIEW_COUNT = 40
BUDGETS = (128, 512, 4096)
PICTURE_SIDE = 320
PHOTO_COUNT, PHOTO_SIDE = 40, 256
TAB_PX = (12, 78)  # from the sidebar's upper right corner to the middle of its second tab
GREY = 0.22  # behind pictures without a world, display


def folder():
    return tour_steps.folder()


def fit():
    return bpy.context.scene.stipple.fit


def state():
    return module('.scene.fit.fitting').state


def few_tabs(window, opened='STIPPLE_PT_fit_advanced'):
    """Leaves one tab before ours in the sidebar, which Blender itself has, and so a place to click on. Opens a panel of
    ours."""
    others = [panel for panel in bpy.types.Panel.__subclasses__()
              if getattr(panel, 'bl_space_type', '') == 'VIEW_3D' and getattr(panel, 'bl_region_type', '') == 'UI'
              and getattr(panel, 'is_registered', False) and getattr(panel, 'bl_category', '') != 'Stipple']
    for panel in sorted(others, key=lambda panel: not getattr(panel, 'bl_parent_id', '')):
        bpy.utils.unregister_class(panel)
    panel = getattr(module('.panels.fit'), opened)
    bpy.utils.unregister_class(panel)
    panel.bl_options = set()  # open
    bpy.utils.register_class(panel)
    window.space.show_region_ui = True


def open_tab(window):
    """A click on the second tab: before 4.0 no property says which is open."""
    region = next(r for r in window.area.regions if r.type == 'UI')
    x, y = region.x + region.width - TAB_PX[0], region.y + region.height - TAB_PX[1]
    window.window.event_simulate(type='MOUSEMOVE', value='NOTHING', x=x, y=y)
    for value in ('PRESS', 'RELEASE'):
        window.window.event_simulate(type='LEFTMOUSE', value=value, x=x, y=y)


def build(window):
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    few_tabs(window)
    scenes.suzanne()
    camera = scenes.camera(location=(0.0, -4.3, 0.2), rotation=(1.524, 0.0, 0.0), width=PICTURE_SIDE,
                           height=PICTURE_SIDE)
    camera.hide_set(True)
    window.space.shading.type = 'SOLID'
    window.space.shading.color_type = 'TEXTURE'
    window.space.overlay.show_relationship_lines = False
    view = window.region_data
    view.view_perspective = 'PERSP'
    view.view_distance, view.view_location = 6.0, (0.0, 0.0, 0.0)
    view.view_rotation = Euler((1.35, 0.0, 0.45)).to_quaternion()
    next(obj for obj in bpy.data.objects if obj.type == 'LIGHT').hide_set(True)
    fit().view_count, fit().samples = VIEW_COUNT, 32
    fit().model, fit().quality = 'FIELD', 'FAST'


def panel(window):
    tour_steps.show_tab(window, 'DATA')
    return 'fit_start'


def start(window):
    with window.context():
        assert bpy.ops.stipple.splats_fit('INVOKE_DEFAULT') == {'RUNNING_MODAL'}


def running(_window):
    assert state().is_running, state().problem
    figures = state().figures
    if figures is None or figures.iteration < 0.6 * figures.iterations or not figures.psnr > 0:
        return False
    return 'fit_panel'


def ended(_window):
    assert not state().problem, state().problem
    return False if state().is_running else None


def proposal(_window):
    return 'fit_proposal'


def report(_window):
    image = module('.scene.fit.fit_proposal').find(bpy.context).data.stipple.fit_report
    image.filepath_raw, image.file_format = str(folder() / 'fit_report.png'), 'PNG'
    image.save()


def accept(window):
    with window.context():
        assert bpy.ops.stipple.fit_accept() == {'FINISHED'}


def budgets(_window):
    """The same field at three budgets, by the engine Stipple."""
    scene = bpy.context.scene
    scene.render.engine, scene.render.film_transparent = 'STIPPLE', True
    obj = bpy.context.view_layer.objects.active
    pictures = []
    for anchors in BUDGETS:
        obj.data.stipple.anchors = anchors
        scene.render.filepath = str(folder() / f'budget_{anchors}')
        bpy.ops.render.render(write_still=True)
        pictures.append(over_grey(scene.render.filepath + '.png'))
        Path(scene.render.filepath + '.png').unlink()
    photo_set.save(np.concatenate(pictures, axis=1), folder() / 'fit_budgets.png')


def budget(window):
    bpy.context.view_layer.objects.active.data.stipple.anchors = BUDGETS[1]
    window.space.show_region_ui = False
    return 'fit_budget'


def over_grey(path):
    image = bpy.data.images.load(path)
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    pixels = pixels.reshape(height, width, 4)
    return pixels[..., :3] * pixels[..., 3:] + GREY * (1 - pixels[..., 3:])


def photographs(_window):
    capture = module('.scene.fit.view_capture')
    source = bpy.data.objects['Suzanne']
    source.hide_set(False)
    source.hide_render = False
    photo_set.write(module('.scene.fit.view_rigs'), capture, source, folder() / 'photos', PHOTO_COUNT,
                    capture.CaptureSettings('CYCLES', PHOTO_SIDE, 32))
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)


def import_cameras(window):
    window.space.show_region_ui = True
    fit().views_from, fit().dataset = 'DATASET', str(folder() / 'photos')
    fit().model, fit().quality = 'EXPLICIT', 'FAST'
    bpy.context.scene.render.engine = 'STIPPLE'
    assert bpy.ops.stipple.cameras_import(filepath=fit().dataset) == {'FINISHED'}
    window.region_data.view_distance = 20.0
    return 'fit_photos'


def through_a_camera(window):
    with window.context():
        assert bpy.ops.stipple.fit_accept() == {'FINISHED'}
    cameras = [obj for obj in bpy.data.objects if obj.type == 'CAMERA']
    towards = Vector((0.4, -1.0, 0.25)).normalized()
    bpy.context.scene.camera = max(cameras, key=lambda obj: obj.matrix_world.translation.normalized().dot(towards))
    window.space.show_region_ui = False
    window.space.overlay.show_extras = False
    window.region_data.view_perspective = 'CAMERA'
    return 'fit_photo_view'


steps = [build, open_tab, panel, start, running, ended, proposal, report, accept, budgets, budget, photographs,
         import_cameras, start, ended, through_a_camera]
