# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of make_pictures.py for docs/splats_that_move.md: a head that nods while a ball flies past, fitted and played;
window.py runs them."""

import math
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import photo_set  # noqa: E402
import scenes  # noqa: E402
import tour_steps  # noqa: E402
from fit_tour_steps import accept, ended, few_tabs, fit, folder, open_tab, over_grey, start, state  # noqa: E402

FIRST, LAST = 1, 24
FRAMES = (1, 9, 17, 24)
PICTURE_SIDE = 240


def build(window):
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    few_tabs(window)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = FIRST, LAST
    head = scenes.suzanne()
    ball = scenes.sphere(segments=24, rings=12, radius=0.35)
    scenes.material('Blue', (0.05, 0.2, 0.7), ball)
    for share in np.linspace(0.0, 1.0, 5):
        frame = FIRST + share * (LAST - FIRST)
        head.rotation_euler = (0.35 * math.sin(2 * math.pi * share), 0.0, 0.5 * (share - 0.5))
        head.keyframe_insert('rotation_euler', frame=frame)
        ball.location = (2.4 * share - 1.2, -1.3, 1.5 - 4.0 * (share - 0.5) ** 2)
        ball.keyframe_insert('location', frame=frame)
    scenes.camera(location=(0.0, -6.2, 0.7), rotation=(1.5, 0.0, 0.0), width=PICTURE_SIDE, height=PICTURE_SIDE)
    scene.camera.hide_set(True)
    next(obj for obj in bpy.data.objects if obj.type == 'LIGHT').hide_set(True)
    scenes.select(head, ball)
    window.space.shading.type = 'SOLID'
    window.space.overlay.show_relationship_lines = False
    view = window.region_data
    view.view_perspective = 'PERSP'
    view.view_distance, view.view_location = 8.0, (0.0, 0.0, 0.3)
    view.view_rotation = Euler((1.4, 0.0, 0.3)).to_quaternion()
    fit().model, fit().engine, fit().samples, fit().view_size = 'MOTION', 'CYCLES', 16, 160
    fit().view_count, fit().image_count, fit().max_splats, fit().quality = 16, 192, 12000, 'BALANCED'
    scene.frame_set(12)


def panel(window):
    tour_steps.show_tab(window, 'DATA')
    return 'moving_start'


def running(_window):
    assert state().is_running, state().problem
    figures = state().figures
    return 'moving_panel' if figures is not None and figures.iteration > 0.6 * figures.iterations else False


def figures(_window):
    print('MOVING', state().figures.best_psnr, state().figures.seconds, state().kept_count, flush=True)


def clip(window):
    window.space.show_region_ui = False
    bpy.context.scene.frame_set(17)
    return 'moving_clip'


def strip(_window):
    """Above what Cycles renders of the meshes, below the splats at the same frames, by the engine Stipple."""
    scene, splats = bpy.context.scene, bpy.context.view_layer.objects.active
    scene.render.film_transparent = True
    scene.cycles.samples, scene.cycles.use_denoising = 32, False
    meshes = [obj for obj in bpy.data.objects if obj.type == 'MESH' and obj != splats]
    rows = []
    for engine in ('CYCLES', 'STIPPLE'):
        for obj in meshes:
            obj.hide_render = engine == 'STIPPLE'
        splats.hide_render = engine == 'CYCLES'
        scene.render.engine = engine
        pictures = []
        for frame in FRAMES:
            scene.frame_set(frame)
            scene.render.filepath = str(folder() / f'at_{frame}')
            bpy.ops.render.render(write_still=True)
            pictures.append(over_grey(scene.render.filepath + '.png'))
            Path(scene.render.filepath + '.png').unlink()
        rows.append(np.concatenate(pictures, axis=1))
    photo_set.save(np.concatenate(rows[::-1], axis=0), folder() / 'moving_frames.png')


steps = [build, open_tab, panel, start, running, ended, accept, figures, clip, strip]
