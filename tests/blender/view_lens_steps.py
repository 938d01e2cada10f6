# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of test_view_lens.py inside the Blender with a window; window.py runs them."""

import gc
import sys
from importlib import import_module
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import scenes  # noqa: E402
from window_steps import BLUE, RED, addon, splats_of  # noqa: E402

facts = {'frames': {}, 'drawn': {}}
_log = []


def folder():
    return Path(sys.argv[sys.argv.index('--') + 2])


def view_image():
    kind = import_module(f'{addon().__name__}.viewport.view_image').ViewImage
    return next((thing for thing in gc.get_objects() if type(thing) is kind), None)


def note_drawn(picture):
    """What the view shows after a redraw, where that is another picture than before."""
    shown = picture._shown
    if shown is None:
        return
    now = (shown.is_fine, shown.samples, hash(shown.key))
    if not _log or _log[-1] != now:
        _log.append(now)


def build(window):
    """Two upright squares that face the camera, one behind the other."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    splats_of('Near', RED, (-0.8, 0, 0))
    splats_of('Far', BLUE, (1.2, 4, 0))
    window.camera = scenes.camera((0, -6, 0), (np.pi / 2, 0, 0), width=400, height=300, lens=50.0)
    scene = window.window.scene
    scene.render.engine = 'STIPPLE'
    scene.view_settings.view_transform = 'Standard'
    scene.render.dither_intensity = 0
    window.space.overlay.show_overlays = False
    window.space.show_gizmo = False
    window.region_data.view_perspective = 'CAMERA'
    window.space.shading.type = 'RENDERED'


def watch(window):
    """From now on every picture that is shown is noted."""
    window.picture = view_image()
    if window.picture is None:
        return False
    bpy.types.SpaceView3D.draw_handler_add(note_drawn, (window.picture,), 'WINDOW', 'POST_PIXEL')
    return None


def is_settled(window):
    """Whether nothing finer follows."""
    picture = window.picture
    shown = picture._shown
    if picture._task is not None or shown is None or shown.key != picture._key or not shown.is_fine:
        return False
    return picture._key[4] is None or shown.samples == picture._sample_count


def taken(name):
    """A step that waits until the view is as good as it gets, and takes its picture."""
    def step(window):
        if not is_settled(window):
            return False
        cameras = addon().scene.view.cameras
        with window.context():
            edges = cameras._camera_frame(bpy.context, window.region, window.camera)
        left, right, bottom, top = (round(edge) for edge in edges)
        height = window.window.height
        facts['frames'][name] = (window.region.x + left, height - window.region.y - top, right - left, top - bottom)
        # Of what the view shows now; keys change for reasons of Blender's own too.
        facts['drawn'][name] = [drawn[:2] for drawn in _log if drawn[2] == hash(window.picture._key)]
        _log.clear()
        return name
    return step


def rendered(name):
    """A step that renders what the view has shown, at the same size."""
    def step(window):
        render = window.window.scene.render
        kept = render.resolution_x, render.resolution_y
        render.resolution_x, render.resolution_y = facts['frames'][name][2:]
        pixels = scenes.render_pixels(folder(), name)
        np.save(folder() / f'{name}.npy', pixels[::-1])
        render.resolution_x, render.resolution_y = kept
        _log.clear()
    return step


def open_lens(window):
    dof = window.camera.data.dof
    dof.use_dof, dof.focus_distance, dof.aperture_fstop = True, 6.0, 0.1


def turn(window):
    window.camera.rotation_euler.z = 0.1


def leave_camera(window):
    window.region_data.view_perspective = 'PERSP'


def panorama(window):
    window.region_data.view_perspective = 'CAMERA'
    data = window.camera.data
    data.dof.use_dof = False
    data.type = 'PANO'
    settings = import_module(f'{addon().__name__}.version').panorama_settings(data)
    settings.panorama_type = 'EQUIRECTANGULAR'
    window.camera.location.y = -2.0


def fisheye(window):
    settings = import_module(f'{addon().__name__}.version').panorama_settings(window.camera.data)
    settings.panorama_type, settings.fisheye_fov = 'FISHEYE_EQUIDISTANT', 3.0


def mirror_ball(window):
    settings = import_module(f'{addon().__name__}.version').panorama_settings(window.camera.data)
    settings.panorama_type = 'MIRRORBALL'


def refused(window):
    picture = import_module(f'{addon().__name__}.viewport.view_image')
    with window.context():
        try:
            picture.view_camera(bpy.context, bpy.context.evaluated_depsgraph_get())
        except addon().binding.errors.StippleError as error:
            facts['refusal'] = str(error)
    return 'refused'


steps = [build, watch, taken('sharp'), rendered('sharp'), open_lens, taken('blurred'), rendered('blurred'), turn,
         taken('turned'), leave_camera, taken('outside'), panorama, taken('panorama'), rendered('panorama'), fisheye,
         taken('fisheye'), rendered('fisheye'), mirror_ball, refused]
