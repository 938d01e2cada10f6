# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene of our own with an even white light, in which Cycles renders an asset. It goes again with all it brought."""

import bpy
from mathutils import Matrix

from ... import version
from ...binding.errors import StippleError
from ...binding.structs import Status
from ...cycles_functions import CyclesRender
from . import sphere, surface
from .assets import LeftOutError

_NAME = 'Stipple Studio'
_RESULT = 'Render Result'


class Studio:
    """
        with Studio(size, samples) as studio, asset.within(studio.scene):
            surface = studio.surface()
            studio.render(path, pose, surface)

    The asset stays where it is, and the cameras go there: images are the same as if it were moved. Errors:
    StippleError.
    """

    def __init__(self, size, samples):
        if CyclesRender is None or not hasattr(bpy.types.Scene, 'cycles'):
            raise StippleError('Cycles renders the images, and this Blender has it not enabled.',
                               Status.ERROR_UNAVAILABLE)
        self._size, self._samples = size, samples
        self.scene = None

    def __enter__(self):
        self._had_result = _RESULT in bpy.data.images
        self.scene = bpy.data.scenes.new(_NAME)
        try:
            self._world = bpy.data.worlds.new(_NAME)
            self._camera = bpy.data.objects.new(_NAME, bpy.data.cameras.new(_NAME))
            self._prepare()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        self.scene.render.use_persistent_data = False  # Cycles forgets its copy
        for owner, name in ((bpy.data.cameras, '_camera'), (bpy.data.worlds, '_world')):
            data = getattr(self, name, None)
            if data is not None:
                owner.remove(data.data if name == '_camera' else data)  # a camera's object goes with it
        bpy.data.scenes.remove(self.scene)
        result = bpy.data.images.get(_RESULT)
        if result is not None and not self._had_result:
            result.user_clear()  # Blender has it in use for its own
            bpy.data.images.remove(result)

    def surface(self):
        return surface.read(self.scene)

    def render(self, path, pose, asset):
        """An image of an asset's Surface by a pose of sphere.poses(): PNG, RGBA of 8 bits."""
        place = Matrix(pose.tolist())
        place.translation = asset.centre + asset.size * pose[:3, 3]
        self._camera.matrix_world = place
        camera = self._camera.data
        camera.clip_start, camera.clip_end = sphere.NEAR * asset.size, sphere.FAR * asset.size
        scene = self.scene
        scene.render.filepath = path
        with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
            try:
                bpy.ops.render.render(write_still=True, scene=scene.name)
            except RuntimeError as error:
                said = '; '.join(line.removeprefix('Error: ') for line in str(error).strip().splitlines())
                raise LeftOutError(f'it could not be rendered: {said}') from None

    def _prepare(self):
        scene, render = self.scene, self.scene.render
        self._world.color = (1.0, 1.0, 1.0)
        for node in self._world.node_tree.nodes if version.has_nodes(self._world) else ():
            if node.type == 'BACKGROUND':
                node.inputs['Color'].default_value, node.inputs['Strength'].default_value = (1.0, 1.0, 1.0, 1.0), 1.0
        scene.world = self._world
        camera = self._camera.data
        camera.sensor_fit, camera.angle = 'HORIZONTAL', sphere.ANGLE
        scene.collection.objects.link(self._camera)
        scene.camera = self._camera
        render.engine = 'CYCLES'
        cycles = scene.cycles
        cycles.device, cycles.samples, cycles.seed = 'CPU', self._samples, 0
        cycles.use_denoising = cycles.use_adaptive_sampling = False  # not every build has a denoiser
        render.resolution_x = render.resolution_y = self._size
        render.resolution_percentage = 100
        render.film_transparent = render.use_persistent_data = True
        render.use_file_extension = render.use_compositing = render.use_sequencer = False
        render.dither_intensity = 0.0
        scene.display_settings.display_device = 'sRGB'
        scene.view_settings.view_transform, scene.view_settings.look = 'Standard', 'None'
        scene.view_settings.exposure, scene.view_settings.gamma = 0.0, 1.0
        if version.VERSION >= (5, 0, 0):
            render.image_settings.media_type = 'IMAGE'
        render.image_settings.file_format, render.image_settings.color_mode = 'PNG', 'RGBA'
        render.image_settings.color_depth = '8'
