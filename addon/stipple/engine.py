# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine Stipple: F12, animation and background.

It decodes from the evaluated settings into native memory and never writes a datablock.
"""

import time

import bpy
import numpy as np

from . import binding, cycles_world, version
from .binding import structs
from .binding.errors import CancelledError, StippleError
from .scene import instances
from .scene.source import sources
from .scene.view import cameras, effects, facts, mattes, motion, picture_options, quality, steady_effects
from .viewport import view_image

# How often a render looks whether it was cancelled.
POLL_SECONDS = 0.01


class NativeWork:
    """What the engines share: native jobs that Blender can cancel, and one message for what goes wrong."""

    _stats = ''  # what the status says beside the stage of the work

    def _wait(self, job):
        """Until the job ends; a cancel in Blender cancels it."""
        while True:
            state, fraction, stage = job.poll()
            self._say(fraction, stage)  # also of what has ended before it was looked at
            if state != structs.JobState.RUNNING:
                job.wait()
                return
            if self._cancelled():
                job.cancel()
            time.sleep(POLL_SECONDS)

    def _decode_instances(self):
        """Decodes what is not decoded yet: not while the views of the window wait, as they do for update(). Returns
        whether the render goes on."""
        try:
            self._instances = instances.decode_later(self._instances, self._wait_decoding)
        except CancelledError as error:
            self.report({'INFO'}, str(error))
            return False
        except StippleError as error:
            self._fail(error)
            return False
        return True

    def _wait_decoding(self, name, job):
        """Until the splats of an object are decoded, or what they need is read."""
        self._stats = f"Decoding the splats of '{name}'"
        try:
            self._wait(job)
        except CancelledError:
            raise CancelledError(f"The render was cancelled while the splats of '{name}' were decoded; nothing has "
                                 "changed.") from None
        finally:
            self._stats = ''

    def _cancelled(self):
        return self.test_break()

    def _say(self, fraction, stage):
        self.update_stats(self._stats, stage)
        self.update_progress(fraction)

    def _say_memory(self, renderer, placed, camera):
        """What drawing these instances takes at most, in Blender's status."""
        count = sum(entry[0].info().count for entry in placed)
        mebibytes = renderer.memory_bound(placed, camera) / 2 ** 20
        self._stats = f'{count:,} splats, at most {mebibytes:,.0f} MiB'
        self.update_memory_stats(memory_used=mebibytes, memory_peak=mebibytes)

    def _take_instances(self, depsgraph):
        """Reads what the view layer shows of splats. Errors: StippleError."""
        found = instances.gather_keyed(depsgraph, 'RENDER', self._warn, self._wait_decoding)
        self._entries = found
        self._instances = [entry[3] for entry in found]
        # By what the object index pass of the renderer has: 0 for none, then the instances.
        self._indices = np.array([0] + [entry[2].pass_index for entry in found], np.float32)

    def _camera_object(self, depsgraph):
        """The original camera object of the image. Errors: StippleError where there is none."""
        return cameras.required(self.camera_override or depsgraph.scene.camera).original

    def _shutter(self, depsgraph, camera_object):
        """What moves while the shutter is open, or None without motion blur."""
        if not motion.is_wanted(depsgraph.scene, depsgraph.view_layer):
            return None
        return motion.sample(depsgraph.scene, depsgraph, camera_object, self._entries, self.frame_set)

    def _blur(self, depsgraph, camera_object, shutter):
        return picture_options.blur(depsgraph.scene, effects.aperture_of(camera_object, depsgraph), shutter)

    def _passes(self, view_layer):
        return {'with_normal': view_layer.use_pass_normal, 'with_objects': view_layer.use_pass_object_index}

    def _accuracy(self, depsgraph, camera_object, camera, placed, shutter, meshes):
        """How exact the image is: the render's quality, and what its effects ask for."""
        context, scene = sources.context(), depsgraph.scene
        seen = effects.look(context, scene, placed, camera, camera_object, shutter, meshes)
        rows = effects.plan(context.library, scene, depsgraph.view_layer, depsgraph, seen, camera_object)
        if self.is_animation:
            rows = steady_effects.kept(scene, rows)
        return quality.accuracy_of(context.library, scene.stipple.quality_render, rows,
                                   picture_options.is_panoramic(camera))

    def _warn(self, message):
        self.report({'WARNING'}, message)

    def _fail(self, error):
        """One message; the render ends without an image."""
        self.error_set(str(error))
        self.report({'ERROR'}, str(error))


class STIPPLE_RE_engine(NativeWork, bpy.types.RenderEngine):
    bl_idname = 'STIPPLE'
    bl_label = "Stipple"
    bl_use_preview = False
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False

    def update_render_passes(self, scene=None, renderlayer=None):
        self.register_pass(scene, renderlayer, 'Combined', 4, 'RGBA', 'COLOR')
        if renderlayer.use_pass_z:
            self.register_pass(scene, renderlayer, 'Depth', 1, 'Z', 'VALUE')
        if renderlayer.use_pass_normal:
            self.register_pass(scene, renderlayer, 'Normal', 3, 'XYZ', 'VECTOR')
        if renderlayer.use_pass_object_index:
            self.register_pass(scene, renderlayer, version.OBJECT_INDEX_PASS, 1, 'X', 'VALUE')

    def update(self, data=None, depsgraph=None):
        """Reads what the view layer shows, from the evaluated settings."""
        self._instances = None
        try:
            facts.refuse_stereo(depsgraph.scene.render)
            wanted = 'ALL' if depsgraph.scene.stipple.meshes_as_mattes else 'HOLDOUTS'
            self._mattes = mattes.gather(depsgraph, wanted)
            self._take_instances(depsgraph)
        except CancelledError as error:
            self.report({'INFO'}, str(error))
        except StippleError as error:
            self._fail(error)

    def render(self, depsgraph):
        if self._instances is None or not self._decode_instances():
            return
        scene = depsgraph.scene
        try:
            picture = facts.picture_facts(scene, depsgraph.view_layer)
            camera_object = self._camera_object(depsgraph)
            camera = cameras.camera_of(camera_object.evaluated_get(depsgraph), scene.render, picture.border)
            shutter = self._shutter(depsgraph, camera_object)
            accuracy = self._accuracy(depsgraph, camera_object, camera, self._instances, shutter, len(self._mattes))
            blur = self._blur(depsgraph, camera_object, shutter)
            world = None
            if cycles_world.is_needed(depsgraph):
                world = cycles_world.image(self, depsgraph, picture.border, blur is not None)
                if world is None:
                    return
            renderer = binding.renderer.Renderer(sources.context())
            self._say_memory(renderer, self._instances, camera)
            options = renderer.options(blend_space=picture.blend_space,
                                       background=picture.background if world is None else None, accuracy=accuracy,
                                       object_order=effects.object_order(scene, self._instances), solid_depth=True)
            task = renderer.start(self._instances, camera, options, picture.with_depth, surface=self._matte(camera),
                                  blur=blur, background_image=None if world is None else world[::-1],
                                  **self._passes(depsgraph.view_layer))
            self._wait(task.job)
        except CancelledError:
            return
        except StippleError as error:
            self._fail(error)
            return
        self._deliver(task, picture, depsgraph.view_layer.name)

    def view_update(self, context, depsgraph):
        """Something in the scene of a 3D view has changed."""
        if getattr(self, '_view', None) is None:
            self._view = view_image.ViewImage()
        self._guarded(self._view.update, depsgraph, self._warn)

    def view_draw(self, context, depsgraph):
        if getattr(self, '_view', None) is None:
            self.view_update(context, depsgraph)
        if self._guarded(self._view.draw, self, context, depsgraph):
            self.update_stats('', '')

    def _guarded(self, call, *arguments):
        """A view has nobody to raise to: what goes wrong is shown at its top."""
        try:
            call(*arguments)
        except StippleError as error:
            self.update_stats('', str(error))
            return False
        return True

    def _matte(self, camera):
        """The meshes as this camera sees them, or None for none."""
        if not self._mattes:
            return None
        if picture_options.is_panoramic(camera):
            self._warn('Meshes hide no splats from panoramic cameras; render them with Cycles + Stipple.')
            return None
        return mattes.surface(self._mattes, camera, self._wait)

    def _deliver(self, task, picture, layer_name):
        """Hands the image over; Blender's first row is the bottom one."""
        result = self.begin_result(0, 0, picture.border.width, picture.border.height, layer=layer_name)
        passes = result.layers[0].passes
        version.fill_pass(passes['Combined'], task.colour[::-1])
        if task.depth is not None and 'Depth' in passes:
            version.fill_pass(passes['Depth'], task.depth[::-1])
        if task.normal is not None and 'Normal' in passes:
            version.fill_pass(passes['Normal'], task.normal[::-1])
        if task.objects is not None and version.OBJECT_INDEX_PASS in passes:
            version.fill_pass(passes[version.OBJECT_INDEX_PASS], self._indices[task.objects[::-1]])
        self.end_result(result)


classes = (STIPPLE_RE_engine,)
