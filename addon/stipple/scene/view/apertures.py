# SPDX-License-Identifier: GPL-3.0-or-later
"""The aperture of a camera, from Blender's depth of field settings, as Cycles has it."""

from dataclasses import dataclass

import numpy as np

# Blender's f-stop may be 0.
LEAST_FSTOP = 1e-5


@dataclass(frozen=True)
class Aperture:
    aperture_radius: float  # metres
    focus_distance: float   # metres, along the view
    blades: int             # 0: round
    rotation: float         # radians
    ratio: float            # height over width


def aperture_of(camera_object, depsgraph):
    """The Aperture of a camera at the depsgraph's time, or None where all is sharp."""
    evaluated = camera_object.evaluated_get(depsgraph)
    camera = evaluated.data
    if not camera.dof.use_dof:
        return None
    dof = camera.dof
    stop = max(dof.aperture_fstop, LEAST_FSTOP)
    # The opening's diameter is the focal length over the f-stop; orthographic cameras have none and count as one metre.
    length = 1.0 if camera.type == 'ORTHO' else 1e-3 * camera.lens
    blades = dof.aperture_blades if dof.aperture_blades >= 3 else 0
    return Aperture(length / (2 * stop), focus_distance(evaluated, depsgraph), blades, dof.aperture_rotation,
                dof.aperture_ratio)


def focus_distance(evaluated, depsgraph):
    """Metres along the view of an evaluated camera to what it is focused on."""
    dof = evaluated.data.dof
    target = dof.focus_object
    if target is None:
        return dof.focus_distance
    target = target.evaluated_get(depsgraph)
    matrix = np.array(target.matrix_world, np.float64)
    bone = target.pose.bones.get(dof.focus_subtarget) if target.pose and dof.focus_subtarget else None
    if bone is not None:
        matrix = matrix @ np.array(bone.matrix, np.float64)
    camera = np.array(evaluated.matrix_world, np.float64)
    back = camera[:3, 2] / np.linalg.norm(camera[:3, 2])
    return abs(float(back @ (camera[:3, 3] - matrix[:3, 3])))
