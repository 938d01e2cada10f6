# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects of a picture as what the native renderer is given."""

from ..binding.structs import CameraModel, Effect

# Passes by the argument of Renderer.start that asks for them.
PASSES = {Effect.DEPTH_PASS: 'with_depth'}


def is_panoramic(camera):
    """Whether a StippleCamera sees directions and not a plane."""
    return camera.model not in (CameraModel.PERSPECTIVE, CameraModel.ORTHOGRAPHIC)


def blur(scene, lens, shutter):
    """Arguments of Renderer.options for depth of field and motion blur."""
    return {}
