# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawing in the 3D view: splats of the engine Stipple, and coloured points under every other shading."""

import bpy
import numpy as np

from . import version
from .binding.errors import StippleError
from .binding.renderer import Renderer
from .binding.structs import JobState
from .scene import cameras, facts, instances, sources, splat_data, sync

# While the view moves, pictures have one pixel for this many of the region's along each side.
COARSE = 4
# Points that Solid shading draws of one object; more would only hide each other.
MAX_POINTS = 2_000_000
POINT_SIZE_PX = 2.0


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


# ---- coloured points ----------------------------------------------------------------------------

_batches = {}
_handler = None


def _draw_points():
    """Under Solid and Wireframe shading splat meshes would be invisible: shows their centres."""
    context = bpy.context
    space = context.space_data
    if space is None or space.shading.type == 'RENDERED' and context.engine == sync.ENGINE:
        return
    depsgraph = context.evaluated_depsgraph_get()
    drawn = []
    for entry in depsgraph.object_instances:
        obj = entry.object
        if splat_data.is_splat_object(obj) and (entry.show_self or entry.is_instance):
            drawn.append((obj.original.data, entry.matrix_world.copy()))
    if not drawn:
        _batches.clear()
        return
    import gpu
    shader = gpu.shader.from_builtin(version.FLAT_COLOR_SHADER)
    gpu.state.depth_test_set('LESS_EQUAL')
    gpu.state.depth_mask_set(True)
    gpu.state.point_size_set(POINT_SIZE_PX)
    for data, matrix in drawn:
        batch = _batch_of(data, shader)
        if batch is not None:
            with gpu.matrix.push_pop():
                gpu.matrix.multiply_matrix(matrix)
                batch.draw(shader)
    gpu.state.point_size_set(1.0)
    gpu.state.depth_mask_set(False)
    gpu.state.depth_test_set('NONE')


def _batch_of(data, shader):
    """The GPU points of a datablock; made again when its splats are."""
    key = (data.get(sync.WRITTEN_KEY), data.get(sync.FINGERPRINT_KEY), splat_data.count(data))
    known = _batches.get(data.name)
    if known is not None and known[0] == key:
        return known[1]
    batch = None
    try:
        arrays = splat_data.read(data)
        if arrays.count:
            batch = _points(arrays, shader)
    except StippleError as error:
        sync.problems[data.name] = str(error)
    _batches[data.name] = (key, batch)
    return batch


def _points(arrays, shader):
    from gpu_extras.batch import batch_for_shader
    step = -(-arrays.count // MAX_POINTS)
    colours = np.ones((len(arrays.positions[::step]), 4), np.float32)
    colours[:, :3] = facts.display_colours(arrays.sh[::step, 0])
    return batch_for_shader(shader, 'POINTS', {'pos': np.ascontiguousarray(arrays.positions[::step]),
                                               'color': colours})


def register():
    global _handler
    if not bpy.app.background:
        _handler = bpy.types.SpaceView3D.draw_handler_add(_draw_points, (), 'WINDOW', 'POST_VIEW')


def unregister():
    global _handler
    if _handler is not None:
        bpy.types.SpaceView3D.draw_handler_remove(_handler, 'WINDOW')
        _handler = None
    _batches.clear()
