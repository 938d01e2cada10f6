# SPDX-License-Identifier: GPL-3.0-or-later
"""What each effect of an image takes: its time with it less that without it, for the present view."""

import time

from ...binding.renderer import Renderer
from ...binding.structs import Effect, ObjectOrder, Projection, Sampling, SplatOrder
from ...jobs import Task
from ..source import sources
from . import effects, mattes, picture_options, quality

# Images with and without an effect are drawn alternately: this many of each at least, and more of them, up to the
# larger number, for as long as they do not agree.
FEWEST_REPETITIONS, MOST_REPETITIONS = 3, 9
# A blurred image's time is that of its samples: so many are drawn, the rest is counted.
BLUR_SAMPLES = 8
# No further turn of an effect begins after its share of this.
MOST_SECONDS = 60.0


def difference(images, without):
    """What an effect takes, from seconds of images with and without it, or None where they do not agree on it.

    What else runs on the machine only ever makes an image slower, so the fastest of each kind are compared. They agree
    where the fastest two of each kind lie nearer to each other than the two kinds do; an only pair is believed.
    """
    images, without = sorted(images), sorted(without)
    noise = max(kind[:2][-1] - kind[0] for kind in (images, without))
    found = images[0] - without[0]
    return found if found > noise else None


def start(scene, view):
    """A Task whose result is {Effect: seconds} of the active effects of a RenderedView. Errors: StippleError."""
    context = sources.context()
    settings = scene.stipple.quality_render
    active = {row.effect for row in view.rows if row.is_on}
    renderer = Renderer(context)

    def options(left_out=None):
        accuracy = quality.accuracy_of(context.library, settings, view.rows, picture_options.is_panoramic(view.camera))
        if left_out == Effect.VIEW_COLOUR:
            accuracy.sh_degree_limit = 0
        elif left_out == Effect.EXACT_PROJECTION:
            accuracy.projection = int(Projection.AFFINE)
        elif left_out == Effect.ZOOM_ANTIALIASING:
            accuracy.antialiasing = int(Sampling.AS_TRAINED)
        background = view.picture.background
        if left_out == Effect.TRANSPARENT_FILM:
            background = (0.0, 0.0, 0.0)
        order = effects.object_order(scene, view.placed)
        if left_out == Effect.GLOBAL_ORDER:
            order = ObjectOrder.APART
        options = renderer.options(blend_space=view.picture.blend_space, background=background, accuracy=accuracy,
                                   object_order=order)
        blur = picture_options.blur(scene, None if left_out == Effect.DEPTH_OF_FIELD else view.aperture,
                                    None if left_out == Effect.MOTION_BLUR else view.shutter)
        scale = 1.0
        if blur is not None:
            samples = renderer.sample_count(view.placed, view.camera, options, blur)
            blur.samples = min(samples, BLUR_SAMPLES)
            scale = samples / blur.samples
        return options, blur, scale

    everything = options()
    is_panoramic = picture_options.is_panoramic(view.camera)
    has_meshes = Effect.MESH_OCCLUSION in active and not is_panoramic
    needed = set()  # nothing can be drawn without
    if is_panoramic:
        needed.add(Effect.EXACT_PROJECTION)
    if has_meshes or everything[0].accuracy.contents.order == SplatOrder.PIXEL:
        needed.add(Effect.GLOBAL_ORDER)
    measured = [effect for effect in effects.MEASURABLE if effect in active - needed]
    without = {effect: options(effect) for effect in measured}

    def work(task):
        def run(chosen, left_out=None):
            begin = time.perf_counter()
            surface = None
            if has_meshes and left_out != Effect.MESH_OCCLUSION:
                surface = mattes.surface(view.meshes, view.camera, task.run)
            begun_picture = time.perf_counter()
            passes = {name for effect, name in picture_options.PASSES.items() if effect in active
                      and effect != left_out}
            task.run(renderer.start(view.placed, view.camera, chosen[0], surface=surface, blur=chosen[1],
                                    **{name: name in passes for name in picture_options.PASSES.values()}).job)
            return begun_picture - begin + chosen[2] * (time.perf_counter() - begun_picture)

        run(everything)  # clouds are merged, memory is taken
        seconds = {}
        for done, effect in enumerate(measured):
            pairs, found = [], None
            begin = time.perf_counter()
            while len(pairs) < MOST_REPETITIONS and time.perf_counter() - begin < MOST_SECONDS / len(measured):
                task.advance(done / len(measured), effects.NAMES[effect])
                pairs.append((run(everything), run(without[effect], effect)))
                found = difference(*zip(*pairs))
                if found is not None and len(pairs) >= FEWEST_REPETITIONS:
                    break
            seconds[effect] = found or 0.0
        return seconds

    return Task(work)
