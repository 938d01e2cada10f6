# SPDX-License-Identifier: GPL-3.0-or-later
"""Cycles for engines of our own that let it draw."""

import contextlib
import inspect

import bpy
import numpy as np

from . import version

try:
    from cycles import CyclesRender
except ImportError:  # a Blender that was built without Cycles
    CyclesRender = None

# Of an object, by kind of ray; one that none sees is not in Cycles' copy of the scene.
VISIBILITY = ('visible_camera', 'visible_diffuse', 'visible_glossy', 'visible_transmission', 'visible_volume_scatter',
              'visible_shadow')
# From 5.0 on Cycles makes tiles of this size at most whatever the setting says.
LARGEST_TILE = 8192
# What pixels have that Cycles has not reached: depths and colors of its own are never negative.
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


@contextlib.contextmanager
def kept_depsgraph(engine):
    """While this lasts, Cycles leaves the engine the depsgraph that it renders, so that it can render it once more.

    It frees the depsgraph as soon as it has its own copy, unless data are persistent or the engine draws with the
    graphics card. The latter is asked for then, and not before or after, when Blender would make a context for it.
    """
    engine.bl_use_gpu_context = True
    try:
        yield
    finally:
        engine.bl_use_gpu_context = False


@contextlib.contextmanager
def changed(owners, is_kept=True):
    """Evaluated things have other values while this lasts. owners: a function that gives [(owner, {name: value})] anew;
    names that an owner lacks are passed over. is_kept: False where the depsgraph may be gone at the end."""
    kept = [{name: getattr(owner, name) for name in wanted if hasattr(owner, name)} for owner, wanted in owners()]
    try:
        for owner, wanted in owners():
            _set(owner, wanted)
        yield
    finally:
        for (owner, _), values in zip(owners() if is_kept else (), kept):
            _set(owner, values)


def _set(owner, values):
    for name, value in values.items():
        if hasattr(owner, name):
            setattr(owner, name, value)


def forget_scene(engine):
    """Frees Cycles' copy of the scene, where it has one: its `update` makes another."""
    from cycles import engine as cycles
    cycles.free(engine)
    engine.session = None


def render(engine, draw, layer_name, witness='Depth'):
    """Lets Cycles draw a view layer. Returns its passes {name: RenderPass}, or None where Cycles has failed, which it
    says itself.

    engine: the RenderEngine that draws. draw: Cycles' own function, without arguments. witness: a pass that the view
    layer has, Depth or Combined.

    A failed render leaves its passes without memory, and Blender before 4.0 reads them all the same, from address 0. So
    they get memory beforehand, and the witness tells whether Cycles has drawn.
    """
    begun = engine.begin_result(0, 0, engine.resolution_x, engine.resolution_y, layer=layer_name)
    seen = next(entry for entry in begun.layers[0].passes if entry.name == witness)
    version.fill_pass(seen, np.full((begun.resolution_y, begun.resolution_x, seen.channels), _UNTOUCHED, np.float32))
    engine.end_result(begun)
    draw()
    result = engine.get_result()
    layer = next(layer for layer in result.layers if layer.name == layer_name)
    passes = {entry.name: entry for entry in layer.passes}
    drawn = version.read_pass(passes[witness], result.resolution_x, result.resolution_y)
    return None if (drawn == _UNTOUCHED).all() else passes
