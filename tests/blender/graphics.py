# SPDX-License-Identifier: GPL-3.0-or-later
"""A graphics context in background Blender, and pictures drawn into it."""

import bpy
import numpy as np
import pytest

_state = {'ready': False}


def require():
    """Brings graphics up, or skips the test where this machine has none."""
    import gpu
    if _state['ready']:
        return
    try:
        if hasattr(gpu, 'init'):
            gpu.init()
        else:
            _render_one_tile()  # before 5.x only a render of Blender's own makes the context
        gpu.platform.renderer_get()
    except Exception as error:
        pytest.skip(f'no graphics context in background Blender: {error}')
    _state['ready'] = True


def _render_one_tile():
    scene = bpy.data.scenes.new('graphics')
    scene.render.engine = 'BLENDER_WORKBENCH'
    scene.render.resolution_x = scene.render.resolution_y = 16
    camera = bpy.data.objects.new('graphics', bpy.data.cameras.new('graphics'))
    scene.collection.objects.link(camera)
    scene.camera = camera
    bpy.ops.render.render(scene=scene.name)
    bpy.data.scenes.remove(scene)
    bpy.data.objects.remove(camera)


def window_matrix(camera):
    """Blender's projection of a perspective or orthographic StippleCamera."""
    w, h, n, f = camera.width, camera.height, camera.near_plane, camera.far_plane
    matrix = np.zeros((4, 4))
    matrix[0, 0], matrix[1, 1] = 2 * camera.fx / w, 2 * camera.fy / h
    if camera.model == 0:
        matrix[0, 2], matrix[1, 2] = 1 - 2 * camera.cx / w, 2 * camera.cy / h - 1
        matrix[2, 2], matrix[2, 3], matrix[3, 2] = -(f + n) / (f - n), -2 * f * n / (f - n), -1
    else:
        matrix[0, 3], matrix[1, 3] = 2 * camera.cx / w - 1, 1 - 2 * camera.cy / h
        matrix[2, 2], matrix[2, 3], matrix[3, 3] = -2 / (f - n), -(f + n) / (f - n), 1
    return matrix


def depth_texture(camera, depth):
    """The scene's depth as Blender's buffer has it. depth: [H,W] metres along the view, bottom row first."""
    import gpu
    matrix = window_matrix(camera)
    clip = -depth * matrix[2, 2] + matrix[2, 3]
    values = np.clip(0.5 + 0.5 * (clip / depth if camera.model == 0 else clip), 0, 1).astype(np.float32).reshape(-1)
    return gpu.types.GPUTexture((camera.width, camera.height), format='DEPTH_COMPONENT32F',
                                data=gpu.types.Buffer('FLOAT', values.size, values))
