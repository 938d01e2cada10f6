# SPDX-License-Identifier: GPL-3.0-or-later
"""The world as the camera sees it, for the engine Stipple: an image by Cycles, of a scene without objects.

Cycles evaluates every node tree, and the image has the camera's own lens, border and blur.
"""

import contextlib
import functools

import bpy

from . import cycles_functions, version
from .scene.view import facts

# Samples of a pixel. The world has no noise: they are for its edges, and for all of it where aperture or motion blurs.
SAMPLES = 8
BLURRED_SAMPLES = 32
# What of a scene would draw something else, or take longer for the same.
_CYCLES_SETTINGS = {'use_adaptive_sampling': False, 'use_denoising': False, 'time_limit': 0.0,
                    'film_exposure': 1.0, 'device': 'CPU', 'use_auto_tile': False,
                    'tile_size': cycles_functions.LARGEST_TILE, 'use_layer_samples': 'IGNORE'}


def is_needed(depsgraph):
    """Whether a single colour does not tell what is behind everything."""
    return (not depsgraph.scene.render.film_transparent and cycles_functions.CyclesRender is not None
            and facts.plain_world_colour(depsgraph.scene_eval.world) is None)


def image(engine, depsgraph, border, is_blurred=False):
    """The light [H,W,3] of the world in the border's pixels, bottom row first; None where Cycles has failed or was
    cancelled. engine: the RenderEngine that draws, which has a pass Combined. is_blurred: by aperture or motion."""
    render = cycles_functions.CyclesRender
    engine.session = None
    try:
        with _world_alone(depsgraph, BLURRED_SAMPLES if is_blurred else SAMPLES), cycles_functions.kept_depsgraph(engine):
            render.update(engine, bpy.data, depsgraph)
            passes = cycles_functions.render(engine, functools.partial(render.render, engine, depsgraph),
                                             depsgraph.view_layer.name, 'Combined')
    finally:
        cycles_functions.forget_scene(engine)
    if passes is None or engine.test_break():
        return None
    return version.read_pass(passes['Combined'], border.width, border.height)[..., :3]


@contextlib.contextmanager
def _world_alone(depsgraph, samples):
    """While this lasts, no ray sees an object of the evaluated scene, and Cycles takes so many samples of the rest."""
    originals = {obj.original for obj in depsgraph.objects}

    def owners():
        # References to evaluated things do not outlive what Cycles does.
        yield depsgraph.scene_eval.cycles, {**_CYCLES_SETTINGS, 'samples': samples}
        yield depsgraph.view_layer_eval, {'samples': 0}
        # Light of the world falls on nothing: no map of where it comes from.
        yield depsgraph.scene_eval.world.cycles, {'sampling_method': 'NONE'}
        for original in originals:
            yield original.evaluated_get(depsgraph), dict.fromkeys(cycles_functions.VISIBILITY, False)

    with cycles_functions.changed(owners):
        yield
