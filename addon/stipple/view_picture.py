# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine Stipple's picture of a 3D view, by the native renderer."""

import numpy as np

from .binding.renderer import Renderer
from .binding.structs import JobState
from .scene import cameras, facts, instances, sources

# While the view moves, pictures have one pixel for this many of the region's along each side.
COARSE = 4


class ViewPicture:
    """The picture of one 3D view: coarse at once, fine when the job behind it has ended."""

    def __init__(self):
        self._instances = []
        self._version = 0
        self._key = None
        self._fine = None   # RenderTask that is being made
        self._shown = None  # (texture, whether it is fine)

    def update(self, depsgraph, warn):
        """Takes what the view shows now. Errors: StippleError."""
        self._instances = instances.gather(depsgraph, 'VIEWPORT', warn)
        self._version += 1

    def draw(self, engine, context, depsgraph):
        """Draws, and asks for another call while a finer picture is on its way. Errors: StippleError."""
        region = context.region
        camera = cameras.from_view(context.region_data, region.width, region.height)
        scene = depsgraph.scene
        key = (self._version, bytes(camera), facts.blend_space(scene), scene.render.film_transparent)
        if key != self._key:
            self.close()
            self._key = key
            small = cameras.from_view(context.region_data, max(region.width // COARSE, 1),
                                      max(region.height // COARSE, 1))
            task = self._start(scene, small)
            task.job.wait()
            self._shown = (_texture(task.colour), False)
            self._fine = self._start(scene, camera)
        if self._fine is not None:
            state = self._fine.job.poll()[0]
            if state == JobState.RUNNING:
                engine.tag_redraw()
            else:
                self._fine.job.wait()
                self._shown = (_texture(self._fine.colour), True)
                self._fine = None
        _draw_texture(engine, scene, self._shown[0], region)

    def close(self):
        if self._fine is not None:
            self._fine.job.close()
            self._fine = None

    def _start(self, scene, camera):
        renderer = Renderer(sources.context())
        background = None if scene.render.film_transparent else facts.world_colour(scene.world)
        options = renderer.options(blend_space=facts.blend_space(scene), background=background)
        return renderer.start(self._instances, camera, options, with_depth=False)


def _texture(pixels):
    import gpu  # not there in every background Blender
    flat = np.ascontiguousarray(pixels[::-1]).reshape(-1)
    height, width = pixels.shape[:2]
    return gpu.types.GPUTexture((width, height), format='RGBA16F', data=gpu.types.Buffer('FLOAT', flat.size, flat))


def _draw_texture(engine, scene, texture, region):
    import gpu
    from gpu_extras.presets import draw_texture_2d
    gpu.state.blend_set('ALPHA_PREMULT')
    engine.bind_display_space_shader(scene)
    draw_texture_2d(texture, (0, 0), region.width, region.height)
    engine.unbind_display_space_shader()
    gpu.state.blend_set('NONE')
