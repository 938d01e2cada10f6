# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine Cycles + Stipple: Cycles renders meshes, lights and world; splats are put between them by depth.

Cycles is made to see another scene than the file's in the evaluated copies alone, for as long as it looks.
"""

import contextlib
import functools

import bpy
import numpy as np

from . import binding, cycles_functions, version
from .binding import structs
from .binding.errors import CancelledError, StippleError
from .cycles_functions import CyclesRender
from .engine import NativeWork
from .scene.source import sources, splat_data
from .scene.view import cameras, effects, facts, layers, mattes

_SHADOW_PASS = 'Shadow Catcher'


@contextlib.contextmanager
def _without_splats(depsgraph, without_catchers=False, is_kept=True):
    """Cycles would draw splats as the points that they are stored as: while this lasts, no ray sees them.

    The film is transparent meanwhile, so that the world's light comes apart from the meshes', and the image is made
    in one piece, so that it can be read when Cycles has ended. without_catchers: the camera does not see shadow
    catchers either. is_kept: False where the depsgraph may be gone at the end.
    """
    originals = set()
    for entry in depsgraph.object_instances:
        # Instances take their visibility from the object that is instanced.
        obj = entry.instance_object if entry.is_instance else entry.object
        if splat_data.is_splat_object(obj) or _is_cloud_of_nodes(entry):
            originals.add(obj.original)
    catchers = _shadow_catchers(depsgraph) if without_catchers else ()

    def owners():
        # References to evaluated things do not outlive what Cycles does.
        yield depsgraph.scene_eval.render, {'film_transparent': True}
        yield depsgraph.scene_eval.cycles, {'use_auto_tile': False, 'tile_size': cycles_functions.LARGEST_TILE}
        # Where the artist wants the pass, Cycles shows the catcher as a mesh; it fills the pass all the same.
        yield depsgraph.view_layer_eval.cycles, {'use_pass_shadow_catcher': False}
        for original in originals:
            yield original.evaluated_get(depsgraph), dict.fromkeys(cycles_functions.VISIBILITY, False)
        for original in catchers:
            yield original.evaluated_get(depsgraph), {'visible_camera': False, 'is_shadow_catcher': False}

    with cycles_functions.changed(owners, is_kept):
        yield


def _is_cloud_of_nodes(entry):
    """Whether nodes instance splats that Cycles would draw as points, without their object, where nothing else hangs on
    the visibility of the object that has the nodes."""
    obj = entry.object
    if not entry.is_instance or obj.type != 'POINTCLOUD' or not splat_data.is_splats(obj.data):
        return False
    own = entry.parent.data
    return not getattr(own, 'polygons', ())


def _has_shadow_catchers():
    return any(obj.is_shadow_catcher for obj in bpy.data.objects)


def _shadow_catchers(depsgraph):
    """The original objects that are marked so. An instance is one too where its instancer is, which is among them."""
    return {obj.original for obj in depsgraph.objects if obj.is_shadow_catcher}


def _make_engine():
    class STIPPLE_RE_cycles(NativeWork, cycles_functions.functions(), bpy.types.RenderEngine):
        bl_idname = 'STIPPLE_CYCLES'
        bl_label = "Cycles + Stipple"

        def update_render_passes(self, scene=None, srl=None):
            """Cycles' own passes, and those that the splats need."""
            super().update_render_passes(scene, srl)
            if not srl.use_pass_z:
                self.register_pass(scene, srl, 'Depth', 1, 'Z', 'VALUE')
            if not srl.use_pass_environment and not scene.render.film_transparent:
                self.register_pass(scene, srl, version.ENVIRONMENT_PASS, 3, 'RGB', 'COLOR')
            if not srl.cycles.use_pass_shadow_catcher and _has_shadow_catchers():
                self.register_pass(scene, srl, _SHADOW_PASS, 3, 'RGB', 'COLOR')

        def update(self, data=None, depsgraph=None):
            """Reads the splats of the view layer, then hands the rest to Cycles."""
            self._instances, self._holdouts, self._catchers, self._failed = [], [], [], False
            if self.is_preview:
                super().update(data, depsgraph)
                return
            try:
                refused = cycles_functions.denoising_problem(depsgraph.scene, depsgraph.view_layer)
                if refused:
                    raise StippleError(refused, structs.Status.ERROR_UNAVAILABLE)
                self._take_instances(depsgraph)
                if self._instances:
                    facts.refuse_stereo(depsgraph.scene.render)
                    self._camera(depsgraph, None)
                    # Cycles' passes tell nothing of what it holds out, and of shadow catchers only what falls on them.
                    self._holdouts = mattes.gather(depsgraph, 'HOLDOUTS')
                    self._catchers = mattes.gather(depsgraph, 'CATCHERS')
            except CancelledError as error:
                self._failed = True
                self.report({'INFO'}, str(error))
                return
            except StippleError as error:
                self._failed = True
                self._fail(error)
                return
            if self._catchers:
                # Cycles' copy of the last frame, where data are persistent, is one without catchers.
                cycles_functions.forget_scene(self)
            with _without_splats(depsgraph) if self._instances else contextlib.nullcontext():
                super().update(data, depsgraph)

        def render(self, depsgraph):
            if getattr(self, '_failed', False):
                return
            if not self._instances:
                super().render(depsgraph)
                return
            if not self._decode_instances():
                return
            # Cycles frees the depsgraph as soon as it has its own copy, unless data are persistent: nothing of it is
            # touched after the last image.
            scene = depsgraph.scene.original
            layer_name = depsgraph.view_layer.name
            picture = facts.picture_facts(scene, depsgraph.view_layer)
            camera = self._camera(depsgraph, picture.border)
            try:
                camera_object = self._camera_object(depsgraph)
                shutter = self._shutter(depsgraph, camera_object)
                self._spread = self._blur(depsgraph, camera_object, shutter)
                self._shown_passes = self._passes(depsgraph.view_layer)
                # Where splats show more than meshes is told by the index.
                self._shown_passes['with_objects'] |= self._shown_passes['with_normal']
                self._order = effects.object_order(scene, self._instances)
                self._exactness = self._accuracy(depsgraph, camera_object, camera, self._instances, shutter, 0)
            except StippleError as error:
                self._fail(error)
                return
            draw = functools.partial(super().render, depsgraph)
            shadow = None
            if self._catchers:
                with _without_splats(depsgraph), cycles_functions.kept_depsgraph(self):
                    passes = cycles_functions.render(self, draw, layer_name)
                if passes is None or self._cancelled():
                    return
                shadow = version.read_pass(passes[_SHADOW_PASS], picture.border.width, picture.border.height)
                # Another scene to Cycles, which does not see that evaluated objects have changed.
                cycles_functions.forget_scene(self)
                with _without_splats(depsgraph, without_catchers=True):
                    super().update(bpy.data, depsgraph)
            with _without_splats(depsgraph, bool(self._catchers), scene.render.use_persistent_data):
                passes = cycles_functions.render(self, draw, layer_name)
            if passes is None or self._cancelled():
                return
            try:
                self._insert_splats(passes, picture, camera, shadow, scene.stipple.shadow_margin)
            except CancelledError:
                return
            except StippleError as error:
                self._fail(error)

        def _camera(self, depsgraph, border):
            scene = depsgraph.scene
            return cameras.camera_of(self._camera_object(depsgraph).evaluated_get(depsgraph), scene.render, border)

        def _insert_splats(self, passes, picture, camera, shadow, shadow_margin):
            matte = mattes.surface(self._holdouts, camera, self._wait) if self._holdouts else None
            cycles = self._layers_of(passes, picture, matte)
            renderer = binding.renderer.Renderer(sources.context())
            self._say_memory(renderer, self._instances, camera)
            if shadow is not None:
                version.fill_pass(passes[_SHADOW_PASS], shadow)
                cycles.take_shadow(shadow)
                if cycles.has_shadows():
                    self._light_what_is_before_catchers(cycles, renderer, picture, camera, shadow_margin)
            options = renderer.options(blend_space=picture.blend_space, accuracy=self._exactness,
                                       object_order=self._order, solid_depth=True)
            task = renderer.start(self._instances, camera, options, surface=cycles.surface(),
                                  with_transmittance=True, blur=self._spread, **self._shown_passes)
            self._wait(task.job)
            combined, depth = cycles.picture(task)
            version.fill_pass(passes['Combined'], combined)
            version.fill_pass(passes['Depth'], depth)
            self._put_passes(passes, picture, task)

        def _put_passes(self, passes, picture, task):
            """Normals and indices of splats where one shows more than all else; Cycles' elsewhere."""
            if task.objects is None and task.normal is None:
                return
            if task.objects is not None and version.OBJECT_INDEX_PASS in passes:
                index = passes[version.OBJECT_INDEX_PASS]
                values = version.read_pass(index, picture.border.width, picture.border.height)[..., 0]
                seen = task.objects[::-1]
                version.fill_pass(index, np.where(seen > 0, self._indices[seen], values))
            if task.normal is not None and 'Normal' in passes:
                values = version.read_pass(passes['Normal'], picture.border.width, picture.border.height)
                shows = (task.objects[::-1] > 0)[..., None]
                version.fill_pass(passes['Normal'], np.where(shows, task.normal[::-1], values))

        def _light_what_is_before_catchers(self, cycles, renderer, picture, camera, margin):
            """Takes the shadows off splats that are nearer than a catcher by more than the margin."""
            options = renderer.options(blend_space=picture.blend_space, output_colour=structs.OutputColour.COMPOSITED,
                                       accuracy=self._exactness, object_order=self._order)

            def drawn(surface):
                task = renderer.start(self._instances, camera, options, with_depth=False, surface=surface,
                                      blur=self._spread)
                self._wait(task.job)
                return task.colour[::-1]

            catchers = mattes.surface(self._catchers, camera, self._wait)
            before = drawn(cycles.matte_of(catchers, margin))
            if before[..., 3].any():
                cycles.light_before_catchers(before, drawn(cycles.matte()))

        def _layers_of(self, passes, picture, matte):
            """What Cycles has drawn. matte: of its holdouts, or None."""
            def read(name):
                return version.read_pass(passes[name], picture.border.width, picture.border.height)

            cycles = layers.CyclesLayers(sources.context(), read('Combined'), read('Depth')[..., 0])
            if matte is not None:
                cycles.hold_out(matte)
            if picture.background is not None:
                cycles.take_world(read(version.ENVIRONMENT_PASS))
            return cycles

    return STIPPLE_RE_cycles


classes = () if CyclesRender is None else (_make_engine(),)
