# SPDX-License-Identifier: GPL-3.0-or-later
"""A small scene that moves, and how well splats show it at its frames."""

import importlib

import bpy
import numpy as np

import scenes

FIRST, LAST = 3, 26


def build(folder):
    """A ball of two colours that goes from one side to the other and turns, on a standing box; 24 frames. Returns
    (ball, box)."""
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = FIRST, LAST
    scene.render.fps, scene.render.fps_base = 24, 1.0
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0.0, 0.0, -0.8))
    box = bpy.context.object
    box.scale = (2.4, 1.0, 0.4)
    scenes.material('Green', (0.1, 0.5, 0.2), box)
    ball = scenes.two_coloured_ball(folder)
    ball.scale = (0.6, 0.6, 0.6)
    for frame, x, angle in ((FIRST, -0.9, 0.0), (LAST, 0.9, 1.5)):
        ball.location, ball.rotation_euler = (x, 0.0, 0.0), (0.0, angle, 0.0)
        ball.keyframe_insert('location', frame=frame)
        ball.keyframe_insert('rotation_euler', frame=frame)
    straighten(ball)
    scene.frame_set(FIRST)
    scenes.select(ball, box)
    return ball, box


def fcurves(owner):
    """The curves of an animated datablock, in any version."""
    action = owner.animation_data.action
    if bpy.app.version < (5, 0, 0):
        return list(action.fcurves)
    return [curve for layer in action.layers for strip in layer.strips for bag in strip.channelbags
            for curve in bag.fcurves]


def straighten(owner):
    """An animated datablock changes evenly."""
    for curve in fcurves(owner):
        for point in curve.keyframe_points:
            point.interpolation = 'LINEAR'


def settings(**values):
    """Few small views without light: seconds."""
    chosen = bpy.context.scene.stipple.fit
    for name, value in {'model': 'MOTION', 'view_count': 12, 'view_size': 48, 'engine': 'WORKBENCH',
                        'max_splats': 2000, 'quality': 'FAST', 'image_count': 96, **values}.items():
        setattr(chosen, name, value)
    return chosen


def fitted():
    before = set(bpy.data.objects)
    assert bpy.ops.stipple.splats_fit() == {'FINISHED'}
    return next(obj for obj in bpy.data.objects if obj not in before)


class Judge:
    """Compares what splats show with the meshes themselves, from a camera that no fit has."""

    def __init__(self, stipple, folder, *meshes, size=64):
        self._capture = importlib.import_module('.scene.fit.view_capture', stipple.__name__)
        self._folder, self._meshes, self._size = folder, meshes, size
        self.camera = scenes.camera((0.7, -3.3, 1.2), (1.25, 0.0, 0.21), width=size, height=size)

    def truth(self, frame):
        """[H,W,3] display colours before black, row 0 = bottom."""
        scene = bpy.context.scene
        scene.frame_set(int(frame), subframe=frame % 1)
        chosen = self._capture.CaptureSettings(engine='WORKBENCH', size=self._size)
        with self._capture.Capture(bpy.context, self._meshes, chosen) as capture:
            return before_black(capture.camera(self.camera).linear[::-1])

    def shown(self, obj, frame, engine='STIPPLE'):
        """The same of splats, by F12."""
        scene = bpy.context.scene
        scene.frame_set(int(frame), subframe=frame % 1)
        hidden = [(mesh, mesh.hide_render) for mesh in bpy.data.objects if mesh.type not in {'CAMERA', 'LIGHT'}]
        before = scene.render.engine, scene.render.film_transparent
        try:
            for mesh, _ in hidden:
                mesh.hide_render = mesh != obj
            scene.render.engine, scene.render.film_transparent = engine, True
            scene.camera = self.camera
            scenes.write_exact_pictures()
            return before_black(scenes.render_pixels(self._folder, 'shown'))
        finally:
            scene.render.engine, scene.render.film_transparent = before
            for mesh, was_hidden in hidden:
                mesh.hide_render = was_hidden

    def psnr(self, obj, frame, shown_at=None):
        error = self.shown(obj, frame if shown_at is None else shown_at) - self.truth(frame)
        return float(-10 * np.log10((error ** 2).mean()))


def before_black(linear):
    """Display colours [H,W,3] of premultiplied scene linear ones [H,W,4]."""
    alpha = linear[..., 3:]
    straight = np.clip(linear[..., :3] / np.maximum(alpha, 1e-6), 0.0, 1.0)
    return alpha * np.where(straight <= 0.0031308, straight * 12.92, 1.055 * straight ** (1 / 2.4) - 0.055)
