# SPDX-License-Identifier: GPL-3.0-or-later
"""Cycles for engines of our own that let it draw."""

import inspect

import bpy
import numpy as np

from . import version

try:
    from cycles import CyclesRender
except ImportError:  # a Blender that was built without Cycles
    CyclesRender = None

# Depth of pixels that Cycles has not reached: its own is never negative.
_UNTOUCHED = -1.0


def functions():
    """A base class with Cycles' functions.

    Registering a subclass of a registered class takes the latter's Python away from Blender: Cycles itself would
    render no more. So this is not derived from it.
    """
    found = {name: value for name, value in vars(CyclesRender).items()
             if name.startswith('bl_use_') or name != '__init__' and inspect.isfunction(value)}

    def __init__(self, *args, **kwargs):
        super(base, self).__init__(*args, **kwargs)
        self.session = None  # Cycles' own

    base = type('CyclesFunctions', (), {**found, '__init__': __init__})
    return base


def denoising_problem(scene, view_layer):
    """Why Cycles would refuse to denoise this view layer after it has rendered it, or ''."""
    wanted = scene.cycles.use_denoising and view_layer.cycles.use_denoising
    if not wanted or version.CYCLES_PASSES_OVER_DENOISING or _has_denoiser(scene.cycles):
        return ''
    return ('This Blender was built without OpenImageDenoise, so Cycles cannot denoise; turn Denoise off in Render > '
            'Gaussian Splats, or under Sampling.')


def _has_denoiser(settings):
    """Whether Cycles offers one: OpenImageDenoise, or OptiX where a graphics card has it."""
    from cycles import properties
    offered = getattr(properties, 'enum_denoiser', None)
    return offered is None or bool(offered(settings, bpy.context))


def render(engine, draw, layer_name):
    """Lets Cycles draw a view layer that has a depth pass. Returns its passes {name: RenderPass}, or None where Cycles
    has failed, which it says itself.

    engine: the RenderEngine that draws. draw: Cycles' own function, without arguments.

    A failed render leaves its passes without memory, and Blender before 4.0 reads them all the same, from address 0. So
    they get memory beforehand, and the depth tells whether Cycles has drawn.
    """
    begun = engine.begin_result(0, 0, engine.resolution_x, engine.resolution_y, layer=layer_name)
    depth = next(entry for entry in begun.layers[0].passes if entry.name == 'Depth')
    version.fill_pass(depth, np.full((begun.resolution_y, begun.resolution_x), _UNTOUCHED, np.float32))
    engine.end_result(begun)
    draw()
    result = engine.get_result()
    layer = next(layer for layer in result.layers if layer.name == layer_name)
    passes = {entry.name: entry for entry in layer.passes}
    drawn = version.read_pass(passes['Depth'], result.resolution_x, result.resolution_y)
    return None if (drawn == _UNTOUCHED).all() else passes
