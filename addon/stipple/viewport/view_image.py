# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine Stipple's image of a 3D view, by the native renderer.

A view that changes gets a coarse image, one that rests a fine one, and through a camera with depth of field then
averages of more and more images, until they are as many as a render has. All are made by jobs; the view shows the
last image until the next is there, so rotating it never waits for more than a moment.
"""

import dataclasses
import time

import numpy as np

from .. import binding
from ..binding import cloud_edit, structs
from ..scene import instances
from ..scene.source import sources
from ..scene.view import cameras, effects, facts, mattes, picture_options, quality, view_mattes, viewed
from . import view_world

# Coarse images have one pixel for this many of the region's along each side: the least, the first and the most.
# Beyond the most, ordering the splats takes the time and not their pixels.
COARSE = (2, 4, 8)
# Seconds that a coarse image should take: above, the next is coarser; far below, finer.
COARSE_SECONDS = 0.04
# Seconds that a redraw waits for a coarse image before it shows the last one instead.
PATIENCE = 0.02
# Samples of meshes' edges along each side of a pixel of a fine image; a coarse one has one.
MATTE_SIDE = 2
# Levels of quality that coarse images have too; others take their time.
QUICK_LEVELS = {'DRAFT', 'PREVIEW'}
# Seconds without a change after which a view rests.
REST_SECONDS = 0.15
# An average is of so many times the images of the one shown before it: all of them together take a third longer
# than the last alone.
MORE_SAMPLES = 4


@dataclasses.dataclass(frozen=True)
class ViewCamera:
    """What a 3D view sees by."""

    camera: object       # StippleCamera over the region
    border: object       # facts.Border, the part of it that is drawn, or None for nothing
    aperture: object = None  # apertures.Aperture, or None where all is sharp

    @property
    def is_panoramic(self):
        return picture_options.is_panoramic(self.camera)


def view_camera(context, depsgraph):
    """The ViewCamera of a 3D view. Errors: StippleError for panoramas that have no model here."""
    region, data = context.region, context.region_data
    through = cameras.looked_through(context)
    aperture = effects.aperture_of(through, depsgraph) if through is not None else None
    if through is not None and through.data.type == 'PANO':
        return ViewCamera(*cameras.panorama_of_view(context, region, through, depsgraph), aperture)
    if aperture is not None:
        # From where the image is drawn.
        behind = cameras.step_back(data.window_matrix)
        aperture = dataclasses.replace(aperture, focus_distance=aperture.focus_distance + behind)
    return ViewCamera(cameras.from_view(data, region.width, region.height), cameras.view_border(context, region),
                      aperture)


class ViewImage:
    """The image of one 3D view: coarse at once, fine when the view rests."""

    def __init__(self):
        self._instances = []
        self._mattes = view_mattes.ViewMattes()
        self._version = 0
        self._coarse = COARSE[1]
        self._renderer = None
        self._clipped = {}
        self._world = None     # view_world.Picture, or None for a single colour
        self._key = None       # of what the view shows now
        self._changed = 0.0    # when that was last another
        self._task = None      # _Making, or None
        self._shown = None     # _Shown, or None
        self._sample_count = None  # images of the last average of what the view shows, where it is known
        self._surface = None   # Surface of the meshes that hide splats in fine images of it, or None

    def update(self, depsgraph, warn):
        """Takes what the view shows now. Errors: StippleError."""
        viewed.note_changes(depsgraph)
        self._instances = instances.gather_owned(depsgraph, 'VIEWPORT', warn)
        self._mattes.update(depsgraph, 'ALL' if depsgraph.scene.stipple.meshes_as_mattes else 'HOLDOUTS')
        self._version += 1

    def draw(self, engine, context, depsgraph):
        """Draws, and asks for another call while a finer image is on its way. Errors: StippleError."""
        space, scene = context.space_data, depsgraph.scene
        seen = view_camera(context, depsgraph)
        if seen.border is None:
            return
        planes = viewed.clip_planes(context.region_data)
        entries = [entry for entry in self._instances if viewed.shows(space, depsgraph, *entry[:2])]
        # Nothing projects meshes into panoramas: there they hide nothing, as in renders.
        hiding = [] if not entries or seen.is_panoramic else [
            entry for entry in self._mattes.placed if viewed.shows(space, depsgraph, *entry[:2])]
        world = view_world.picture(depsgraph)
        key = (self._version, tuple(id(entry) for entry in entries + hiding), bytes(seen.camera), seen.border,
               seen.aperture, planes.tobytes(), facts.blend_space(scene), scene.render.film_transparent, id(world),
               quality.key_of(scene.stipple.quality_viewport), effects.choices_of(scene), scene.stipple.blur_samples)
        now = time.perf_counter()
        if key != self._key:
            self._key, self._changed, self._sample_count, self._surface = key, now, None, None
        self._world = world
        self._take()
        if self._task is not None and self._task.is_fine and self._task.key != key:
            self._task.close()
            self._task = None
        if self._task is None and (self._shown is None or self._shown.key != key):
            self._start(scene, depsgraph, seen, entries, hiding, planes, self._coarse)
            self._take(PATIENCE)
        if (self._task is None and self._shown is not None and self._shown.key == key and not self._is_done(seen)
                and now - self._changed >= REST_SECONDS):
            samples = self._shown.samples * MORE_SAMPLES if self._shown.is_fine else 1
            self._start(scene, depsgraph, seen, entries, hiding, planes, 1, samples)
        if self._task is not None or self._shown is None or self._shown.key != key or not self._is_done(seen):
            engine.tag_redraw()
        if self._shown is not None:
            _draw_texture(engine, scene, self._shown.texture, self._shown.border)

    def _is_done(self, seen):
        """Whether nothing finer than what is shown follows."""
        if not self._shown.is_fine or seen.aperture is None:
            return self._shown.is_fine
        return self._sample_count is not None and self._shown.samples >= self._sample_count

    def close(self):
        if self._task is not None:
            self._task.close()
            self._task = None

    def _start(self, scene, depsgraph, seen, entries, hiding, planes, coarse, samples=1):
        """Starts the image of the border's pixels with one pixel for coarse x coarse of them, the average of so many
        images at most."""
        if self._renderer is None:
            self._renderer = binding.renderer.Renderer(sources.context())
        is_plain = self._world is None and not scene.render.film_transparent
        background = facts.world_colour(scene.world) if is_plain else None
        around = None if self._world is None else self._world.pixels
        placed, part = self._placed(entries, planes), cameras.part_of(seen.camera, seen.border, coarse)
        options = self._renderer.options(blend_space=facts.blend_space(scene), background=background,
                                         accuracy=self._accuracy(scene, depsgraph, seen, coarse),
                                         object_order=effects.object_order(scene, placed))
        blur = None
        if samples > 1:
            blur = picture_options.blur(scene, seen.aperture, None)
            if self._sample_count is None:
                self._sample_count = self._renderer.sample_count(placed, part, options, blur)
            blur.samples = samples = min(samples, self._sample_count)

        def begin(surface):
            return self._renderer.start(placed, part, options, with_depth=False, surface=surface, blur=blur,
                                        surroundings=around)

        side = MATTE_SIDE if coarse == 1 else 1
        meshes = None
        if hiding and samples == 1:
            meshes = mattes.start_samples([matte for _, _, matte in hiding], part, side)
        self._task = _Making(begin, meshes, self._surface, self._key, seen.border, coarse, samples)

    def _accuracy(self, scene, depsgraph, seen, coarse):
        """How exact an image is. While the view rotates nothing slow is done, whatever a resting one asks for."""
        settings, library = scene.stipple.quality_viewport, self._renderer.library
        if coarse > 1 and settings.level not in QUICK_LEVELS:
            # Panoramas are not there but along rays.
            return binding.accuracy.accuracy(library, structs.AccuracyLevel.FINAL,
                                             projection=int(structs.Projection.RAY)) if seen.is_panoramic else None
        rows = effects.plan(library, scene, depsgraph.view_layer, depsgraph, None)
        return quality.accuracy_of(library, settings, rows, seen.is_panoramic)

    def _placed(self, entries, planes):
        """Instances for the renderer: what the clipping planes leave."""
        if not len(planes):
            self._clipped.clear()
            return [placed for _, _, placed in entries]
        placed, used = [], {}
        for _, _, (cloud, matrix, is_holdout) in entries:
            local = planes @ matrix
            key = (id(cloud), local.tobytes())
            used[key] = self._clipped.get(key) or (cloud, _clipped(cloud, local))
            placed.append((used[key][1], matrix, is_holdout))
        self._clipped = used
        return placed

    def _take(self, patience=0.0):
        """Shows the image in the making if it is done, or gets done within some seconds."""
        if self._task is None:
            return
        until = time.perf_counter() + patience
        while self._task.is_running():
            if time.perf_counter() >= until:
                return
            time.sleep(0.001)
        task, self._task = self._task, None
        task.wait()
        if not task.is_fine:
            self._adapt(time.perf_counter() - task.begun)
        elif task.key == self._key:
            self._surface = task.surface
        self._shown = _Shown(_texture(task.colour), task.key, task.is_fine, task.border, task.samples)

    def _adapt(self, seconds):
        """Chooses how coarse the next image is by what the last one took."""
        if seconds > COARSE_SECONDS:
            self._coarse = min(2 * self._coarse, COARSE[2])
        elif seconds < COARSE_SECONDS / 6:
            # Twice the pixels along both sides take four times as long at most.
            self._coarse = max(self._coarse // 2, COARSE[0])


class _Making:
    """An image that a job makes, after another has drawn the depth of meshes where there are any."""

    def __init__(self, begin, meshes, surface, key, border, coarse, samples):
        """begin: starts the image's job behind a Surface, or None. meshes: of mattes.start_samples, or None for those
        of `surface`."""
        self._begin, self._meshes = begin, meshes
        self.surface = surface if coarse == 1 else None
        self._task = begin(self.surface) if meshes is None else None
        self.key, self.border, self.samples = key, border, samples
        self.is_fine = coarse == 1
        self.begun = time.perf_counter()

    @property
    def colour(self):
        return self._task.colour

    def is_running(self):
        if self._task is None:
            if self._meshes.job.poll()[0] == structs.JobState.RUNNING:
                return True
            self._meshes.job.wait()
            self.surface = mattes.surface_of(self._meshes)
            self._task = self._begin(self.surface)
        return self._task.job.poll()[0] == structs.JobState.RUNNING

    def wait(self):
        self._task.job.wait()

    def close(self):
        (self._meshes if self._task is None else self._task).job.close()


class _Shown:
    def __init__(self, texture, key, is_fine, border, samples):
        self.texture, self.key, self.is_fine, self.border, self.samples = texture, key, is_fine, border, samples


def _clipped(cloud, planes):
    """The cloud, with its grade where it has one, without what lies above planes of its own space."""
    plain = getattr(cloud, 'cloud', cloud)
    kept = cloud_edit.clipped(plain, planes)
    return kept if plain is cloud else binding.grade.GradedCloud(kept, cloud.settings)


def _texture(pixels):
    import gpu  # not there in every background Blender
    flat = np.ascontiguousarray(pixels[::-1]).reshape(-1)
    height, width = pixels.shape[:2]
    return gpu.types.GPUTexture((width, height), format='RGBA16F', data=gpu.types.Buffer('FLOAT', flat.size, flat))


def _draw_texture(engine, scene, texture, border):
    import gpu
    from gpu_extras.presets import draw_texture_2d
    gpu.state.blend_set('ALPHA_PREMULT')
    engine.bind_display_space_shader(scene)
    draw_texture_2d(texture, (border.x, border.y), border.width, border.height)
    engine.unbind_display_space_shader()
    gpu.state.blend_set('NONE')
