# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects of an image as what the native renderer is given."""

from ...binding.blur import Blur
from ...binding.structs import CameraModel, Effect

# Passes by the argument of Renderer.start that asks for them.
PASSES = {Effect.DEPTH_PASS: 'with_depth', Effect.NORMAL_PASS: 'with_normal', Effect.OBJECT_INDEX_PASS: 'with_objects'}


def is_panoramic(camera):
    """Whether a StippleCamera sees directions and not a plane."""
    return camera.model not in (CameraModel.PERSPECTIVE, CameraModel.ORTHOGRAPHIC)


def blur(scene, aperture, shutter):
    """The Blur of depth of field (an Aperture or None) and motion (a Shutter or None); None where all is sharp."""
    moves = shutter is not None and shutter.moves
    if aperture is None and not moves:
        return None
    given = {} if aperture is None else vars(aperture)
    if moves:
        given = {**given, 'cameras': shutter.cameras, 'instances': shutter.instances, 'clouds': shutter.clouds,
                 'curve': shutter.curve}
    return Blur(samples=scene.stipple.blur_samples, **given)
