# SPDX-License-Identifier: GPL-3.0-or-later
"""One 3D view's splats as sorted ellipses over Blender's own image.

Blender's overlay target encodes sRGB by itself, so blending in it would be linear: splats are blended
in display space in an image of their own, against the scene's depth, and laid over the view as a whole.
"""

import gpu
import numpy as np

from ..binding.errors import StippleError
from ..scene.source import sync
from ..scene.view import cameras, viewed
from .splat_drawing import ShownSplats, SplatView
from .splat_shader import ShaderError, Shaders

__all__ = ('ShaderError', 'Shaders', 'ViewEllipses')


class ViewEllipses:
    def __init__(self, context):
        self._sorted = SplatView(context)
        self._target = None

    def draw(self, shaders, context, depsgraph, entries, with_depth, overlay=None):
        """Draws viewed splats; returns whether a new order is on its way. overlay: gives them other colours. Errors:
        StippleError."""
        x, y, width, height = gpu.state.viewport_get()
        region_data = context.region_data
        camera = cameras.from_view(region_data, width, height)
        with_selection = _shows_outlines(context.space_data)
        shown = _shown(overlay or viewed, entries, depsgraph, context.view_layer if with_selection else None)
        with_selection = any(entry.selected for entry in shown)
        is_sorting = self._sorted.update(shown, camera)
        depth = _scene_depth(x, y, width, height) if with_depth else None
        if self._target is None or self._target.size != (width, height):
            self._target = Target(width, height)
        with self._target.bound(depth, with_selection):
            self._sorted.draw(shaders, shown, camera, region_data.window_matrix,
                              cameras.step_back(region_data.window_matrix), viewed.clip_planes(region_data),
                              with_selection)
        self._target.show(shaders, (x, y), _outline_colour(context) if with_selection else None)
        return is_sorting

    def is_sorting(self):
        return self._sorted.is_sorting()

    def has_new_order(self):
        return self._sorted.has_new_order()

    def close(self):
        self._sorted.close()
        self._target = None


class Target:
    """An image of splats alone: premultiplied display values, and where selected splats cover it."""

    def __init__(self, width, height):
        self.size = (width, height)
        self._colour = gpu.types.GPUTexture(self.size, format='RGBA16F')
        self._selection = None
        self._framebuffer = None
        self._depth = None

    def bound(self, depth, with_selection):
        """Binds it, empty, with the scene's depth (texture or None) for a `with` block."""
        colours = [self._colour]
        if with_selection:
            if self._selection is None:
                self._selection = gpu.types.GPUTexture(self.size, format='RGBA16F')
            colours.append(self._selection)
        for texture in colours:
            texture.clear(format='FLOAT', value=(0.0, 0.0, 0.0, 0.0))
        self._depth = depth
        self._framebuffer = gpu.types.GPUFrameBuffer(depth_slot=depth, color_slots=colours)
        return self._framebuffer.bind()

    def show(self, shaders, origin, outline=None):
        """Lays it over the bound framebuffer. outline: display colour around what is selected."""
        shader = shaders.show(outline is not None)
        shader.bind()
        shader.uniform_sampler('picture', self._colour)
        if outline is not None:
            shader.uniform_sampler('selection', self._selection)
            shader.uniform_float('outline', tuple(outline))
        shader.uniform_int('origin', tuple(int(v) for v in origin))
        gpu.state.blend_set('ALPHA_PREMULT')
        gpu.state.depth_test_set('NONE')
        gpu.state.depth_mask_set(False)
        shaders.draw_screen(shader)
        gpu.state.blend_set('NONE')

    def read(self):
        """[H,W,4] bottom row first."""
        width, height = self.size
        values = self._colour.read()
        values.dimensions = width * height * 4
        return np.array(values, np.float32).reshape(height, width, 4)


def _shown(clouds, entries, depsgraph, view_layer):
    """clouds: has cloud_of(). view_layer: whose selection is shown, None for no selection."""
    shown = []
    for entry in entries:
        try:
            cloud, info = clouds.cloud_of(entry, depsgraph)
        except StippleError as error:
            sync.problems[entry.obj.data.name] = str(error)
            continue
        selected = view_layer is not None and entry.owner.select_get(view_layer=view_layer)
        shown.append(ShownSplats(entry.key, cloud, entry.count, info.antialias, entry.matrix, selected))
    return shown


def _shows_outlines(space):
    return space.overlay.show_overlays and space.overlay.show_outline_selected


def _outline_colour(context):
    theme = context.preferences.themes[0].view_3d
    active = context.view_layer.objects.active
    return theme.object_active if active is not None and active.select_get() else theme.object_selected


def _scene_depth(x, y, width, height):
    """What Blender has drawn, as a depth texture: the only way in Python is through main memory."""
    values = gpu.state.active_framebuffer_get().read_depth(x, y, width, height)
    values.dimensions = width * height
    return gpu.types.GPUTexture((width, height), format='DEPTH_COMPONENT32F', data=values)
