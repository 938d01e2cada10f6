# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of make_pictures.py for docs/fitting_in_blender.md: from a mesh to a field and its budgets, then from pictures of a
data set; window.py runs them."""

import json
import math
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import scenes  # noqa: E402
import tour_steps  # noqa: E402
from fit_steps import module  # noqa: E402

BUDGETS = (64, 512, 4096)
PICTURE_SIDE = 320
PHOTO_COUNT, PHOTO_SIDE = 40, 256
GREY = 0.22  # behind pictures without a world, display


def folder():
    return tour_steps.folder()


def fit():
    return bpy.context.scene.stipple.fit


def state():
    return module('.scene.fitting').state


def first_tab():
    """Our panels come first in the sidebar, which then opens with them."""
    others = [panel for panel in bpy.types.Panel.__subclasses__()
              if getattr(panel, 'bl_space_type', '') == 'VIEW_3D' and getattr(panel, 'bl_region_type', '') == 'UI'
              and getattr(panel, 'is_registered', False)]
    parents_last = sorted(others, key=lambda panel: not getattr(panel, 'bl_parent_id', ''))
    for panel in parents_last:
        bpy.utils.unregister_class(panel)
    for panel in sorted(reversed(parents_last), key=lambda panel: getattr(panel, 'bl_category', '') != 'Stipple'):
        bpy.utils.register_class(panel)


def build(window):
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    scenes.suzanne()
    camera = scenes.camera(location=(0.0, -6.2, 0.5), rotation=(1.49, 0.0, 0.0), width=PICTURE_SIDE, height=PICTURE_SIDE)
    camera.hide_set(True)
    first_tab()
    window.space.show_region_ui = True
    window.space.shading.type = 'SOLID'
    window.space.shading.color_type = 'TEXTURE'
    window.space.overlay.show_relationship_lines = False
    view = window.region_data
    view.view_perspective = 'PERSP'
    view.view_distance, view.view_location = 6.0, (0.0, 0.0, 0.0)
    view.view_rotation = Euler((1.35, 0.0, 0.45)).to_quaternion()
    fit().model, fit().quality = 'FIELD', 'FAST'
    tour_steps.show_tab(window, 'DATA')


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
    image = module('.scene.fit_proposal').find(bpy.context).data.stipple.fit_report
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
    save(np.concatenate(pictures, axis=1), folder() / 'fit_budgets.png')


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


def save(colours, path, alpha=None):
    """In: colours [H,W,3] display, row 0 = bottom."""
    height, width = colours.shape[:2]
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = colours
    if alpha is not None:
        pixels[..., 3] = alpha
    image = bpy.data.images.new('saved', width, height, alpha=True)
    image.pixels.foreach_set(pixels.reshape(-1))
    image.filepath_raw, image.file_format = str(path), 'PNG'
    image.save()
    bpy.data.images.remove(image)


def photographs(_window):
    """A data set as nerfstudio and NeRF-synthetic have it: pictures, and where their cameras stood."""
    rigs, capture = module('.scene.view_rigs'), module('.scene.view_capture')
    source = bpy.data.objects['Suzanne']
    source.hide_set(False)
    source.hide_render = False
    graph = bpy.context.evaluated_depsgraph_get()
    poses = rigs.around(bpy.context.scene, graph, rigs.bounds_of([source], graph), PHOTO_COUNT, seed=3)
    data = folder() / 'photos'
    data.mkdir()
    frames = []
    settings = capture.CaptureSettings('CYCLES', PHOTO_SIDE, 32)
    with capture.Capture(bpy.context, [source], settings) as views:
        for i, pose in enumerate(poses):
            seen = views.pose(f'{i:03d}', pose).linear[::-1]
            alpha = np.maximum(seen[..., 3:], 1e-6)
            straight = np.clip(seen[..., :3] / alpha, 0, 1)
            shown = np.where(straight <= 0.0031308, 12.92 * straight, 1.055 * straight ** (1 / 2.4) - 0.055)
            save(shown, data / f'{i:03d}.png', seen[..., 3])
            frames.append({'file_path': f'{i:03d}.png', 'transform_matrix': [list(row) for row in pose.matrix]})
    angle = poses[0].angle
    length = 0.5 * PHOTO_SIDE / math.tan(0.5 * angle)
    centre = 0.5 * PHOTO_SIDE
    (data / 'transforms.json').write_text(json.dumps(
        {'w': PHOTO_SIDE, 'h': PHOTO_SIDE, 'fl_x': length, 'fl_y': length, 'cx': centre, 'cy': centre, 'frames': frames}))
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)


def import_cameras(window):
    window.space.show_region_ui = True
    fit().views_from, fit().dataset = 'DATASET', str(folder() / 'photos')
    fit().model, fit().quality = 'EXPLICIT', 'FAST'
    bpy.context.scene.render.engine = 'STIPPLE'
    assert bpy.ops.stipple.cameras_import(filepath=fit().dataset) == {'FINISHED'}
    window.region_data.view_distance = 11.0
    return 'fit_photos'


def through_a_camera(window):
    with window.context():
        assert bpy.ops.stipple.fit_accept() == {'FINISHED'}
    window.region_data.view_perspective = 'CAMERA'
    return 'fit_photo_view'


steps = [build, start, running, ended, proposal, report, accept, budgets, budget, photographs, import_cameras, start, ended,
         through_a_camera]
