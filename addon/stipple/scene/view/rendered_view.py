# SPDX-License-Identifier: GPL-3.0-or-later
"""The image that a render of the present frame would make: its splats, camera and settings, for measuring it."""

from dataclasses import dataclass

from ...binding.errors import StippleError
from ...binding.structs import Status
from .. import instances
from ..source import sources
from . import cameras, effects, facts, mattes, motion


@dataclass
class RenderedView:
    placed: list          # as of instances.gather
    camera: object        # StippleCamera
    picture: object       # facts.PictureFacts
    meshes: list          # as of mattes.gather
    shutter: object       # motion.Shutter, or None
    aperture: object          # apertures.Aperture, or None
    rows: list            # [EffectRow]
    seen: object          # effects.Look


def gather(context, mode='RENDER'):
    """Of the scene's camera and the present frame; remembers what was seen for panels. Errors: StippleError."""
    scene, view_layer, depsgraph = context.scene, context.view_layer, context.evaluated_depsgraph_get()
    camera_object = cameras.required(scene.camera).evaluated_get(depsgraph)
    camera = cameras.camera_of(camera_object, scene.render, None)
    found = instances.gather_keyed(depsgraph, mode)
    placed = [entry[3] for entry in found]
    if not placed:
        raise StippleError('The view layer shows no splats; there is nothing to look at.',
                           Status.ERROR_INVALID_ARGUMENT)
    shutter = None
    if motion.is_wanted(scene, view_layer):
        shutter = motion.sample(scene, depsgraph, scene.camera, found,
                                lambda frame, subframe: scene.frame_set(frame, subframe=subframe))
        depsgraph = context.evaluated_depsgraph_get()
    wanted = 'ALL' if scene.stipple.meshes_as_mattes and scene.render.engine == 'STIPPLE' else 'HOLDOUTS'
    meshes = mattes.gather(depsgraph, wanted)
    seen = effects.look(sources.context(), scene, placed, camera, scene.camera, shutter, len(meshes))
    rows = effects.plan(sources.context().library, scene, view_layer, depsgraph, seen)
    aperture = effects.aperture_of(scene.camera, depsgraph)
    return RenderedView(placed, camera, facts.picture_facts(scene, view_layer), meshes, shutter, aperture, rows, seen)
