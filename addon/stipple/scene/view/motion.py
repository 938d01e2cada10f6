# SPDX-License-Identifier: GPL-3.0-or-later
"""What moves while the shutter is open: cameras, splat objects, and splats that move or follow meshes, at sub-frames,
as Cycles has them."""

import math
from dataclasses import dataclass

import bpy
import numpy as np

from ... import version
from .. import instances
from . import cameras

# 2^n + 1 with Cycles' most steps (7), and what the native library takes at most.
MOST_STEPS = 129
# Matrices differ by more than this, metres and sines, where something moves.
STANDS_STILL = 1e-9


@dataclass(frozen=True)
class Shutter:
    """Matrices at times that lie evenly over the time that the shutter is open."""

    cameras: object    # [steps,4,4] world to camera, or None where it stands still
    instances: object  # [steps,count,4,4] object to world, or None where all stand still
    clouds: object     # [steps][count] of Cloud, None where the splats are those of the image; None for all
    curve: object      # [n] how far it is open, or None for evenly
    frames: float      # that it is open
    moving_count: int  # of instances

    @property
    def moves(self):
        return self.cameras is not None or self.instances is not None or self.clouds is not None


def is_wanted(scene, view_layer):
    """Whether Blender's settings ask for motion blur."""
    return scene.render.use_motion_blur and scene.render.motion_blur_shutter > 0 and getattr(
        view_layer, 'use_motion_blur', True)


def sample(scene, depsgraph, camera_object, entries, set_frame):
    """The Shutter of an image. entries: of instances.gather_keyed, whose splats are decoded.

    set_frame: called with (frame, sub-frame) to evaluate the depsgraph there; it is back at the scene's own frame at
    the end, whatever happens. Errors: StippleError for a mesh that splats cannot follow there.
    """
    keys = [entry[0] for entry in entries]
    changing = {i: entry[4] for i, entry in enumerate(entries) if entry[4] is not None and _deforms(entry[2])}
    frame, subframe = scene.frame_current, scene.frame_subframe
    count = max([_steps(camera_object)] + [_steps(scene_object) for scene_object in _objects(keys)])
    cameras_at, placed_at, moments_at = [], [], []
    try:
        for time in times(scene, count):
            set_frame(math.floor(time), time - math.floor(time))
            # References to evaluated things do not outlive a change of frame.
            cameras_at.append(cameras.world_to_camera(camera_object.evaluated_get(depsgraph).matrix_world))
            placed_at.append(instances.matrices(depsgraph))
            moments_at.append({i: splats.moment(depsgraph) for i, splats in changing.items()})
    finally:
        set_frame(frame, subframe)
    here = instances.matrices(depsgraph)
    still = {key for key, obj in zip(keys, _objects(keys)) if not _blurs(obj)}
    moved = np.array([[here[key] if key in still else placed.get(key, here[key]) for key in keys]
                      for placed in placed_at]).reshape(count, len(keys), 4, 4)
    cameras_at = np.array(cameras_at)
    moving = np.abs(moved - moved[:1]).max(axis=(0, 2, 3)) > STANDS_STILL if keys else np.zeros(0, bool)
    camera_moves = _blurs(camera_object) and np.abs(cameras_at - cameras_at[0]).max() > STANDS_STILL
    blurred = [i for i in changing if len({moments[i].key for moments in moments_at}) > 1]
    clouds = [[changing[i].cloud_at(moments[i]) if i in blurred else None for i in range(len(keys))]
              for moments in moments_at] if blurred else None
    moved = moved if moving.any() else None
    moving[blurred] = True
    return Shutter(cameras_at if camera_moves else None, moved, clouds, _curve(scene),
                   scene.render.motion_blur_shutter, int(moving.sum()))


def times(scene, count):
    """Frames, evenly from the shutter's opening to its end."""
    length = scene.render.motion_blur_shutter
    begin = {'START': 0.0, 'CENTER': -0.5, 'END': -1.0}[version.motion_blur_position(scene)] * length
    frame = scene.frame_current + scene.frame_subframe
    return [frame + begin + length * step / (count - 1) for step in range(count)]


def _objects(keys):
    """The objects whose settings count: instancers', as their matrices are what moves."""
    return [bpy.data.objects.get(key[0]) for key in keys]


def _blurs(obj):
    settings = getattr(obj, 'cycles', None)
    return getattr(settings, 'use_motion_blur', True)


def _deforms(obj):
    """Whether an object's splats are blurred as they change; Cycles' own setting, of splats that are meshes."""
    return _blurs(obj) and getattr(getattr(obj, 'cycles', None), 'use_deform_motion', True)


def _steps(obj):
    """As Cycles: an uneven number of times."""
    if obj is None or not _blurs(obj):
        return 3
    steps = getattr(getattr(obj, 'cycles', None), 'motion_steps', 1)
    return min((2 << (max(steps, 1) - 1)) + 1, MOST_STEPS)


def _curve(scene):
    """How far the shutter is open, at even times, or None where it is open all the while."""
    mapping = scene.render.motion_blur_shutter_curve
    mapping.initialize()
    curve = mapping.curves[0]
    values = np.array([max(mapping.evaluate(curve, x), 0.0) for x in np.linspace(0.0, 1.0, 65)])
    return None if np.ptp(values) < 1e-4 or values.max() <= 0 else values
