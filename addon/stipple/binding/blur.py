# SPDX-License-Identifier: GPL-3.0-or-later
"""Aperture and shutter, over which the colours of an image are averaged."""

from ctypes import c_void_p, pointer

import numpy as np

from .errors import invalid
from .handle import contiguous, pointer_to
from .structs import StippleAperture, StippleShutter


class Blur:
    """What spreads an image's light, as in StippleRenderOptions.

    aperture_radius and focus_distance in metres, rotation in radians. cameras [steps,4,4] world to camera and instances
    [steps,count,4,4] object to world, evenly over the open time, or None for what stands still; clouds [steps][count]
    of Cloud, the splats of each instance, in the same rows as its own, or None where they are its own; curve [n] how
    far the shutter is open, or None. samples: images that are averaged, or 0 for as many as the library thinks right.
    """

    def __init__(self, aperture_radius=0.0, focus_distance=1.0, blades=0, rotation=0.0, ratio=1.0, cameras=None,
                 instances=None, curve=None, samples=0, clouds=None):
        self.samples = samples
        self.aperture = None
        if aperture_radius:
            self.aperture = StippleAperture(aperture_radius=aperture_radius, focus_distance=focus_distance,
                                            blades=blades,
                                    rotation=rotation, ratio=ratio)
        self.cameras, self.instances, self.curve = (
            None if array is None else contiguous(array, np.float64) for array in (cameras, instances, curve))
        self.clouds = clouds  # holds them while they are in use
        self.shutter = None
        moving = {name: len(steps) for name, steps in (
            ('cameras', self.cameras), ('steps of instances', self.instances), ('steps of clouds', clouds))
            if steps is not None}
        if moving:
            steps = next(iter(moving.values()))
            if any(count != steps for count in moving.values()):
                counts = ' and '.join(f'{count} {name}' for name, count in moving.items())
                raise invalid(f'The shutter has {counts}; as many of each are allowed.')
            self.shutter = StippleShutter(step_count=steps, cameras=pointer_to(self.cameras),
                                          instances=pointer_to(self.instances), curve=pointer_to(self.curve),
                                          curve_count=0 if self.curve is None else self.curve.size,
                                          clouds=self._cloud_pointers())

    def _cloud_pointers(self):
        """[steps * count] handles, or NULL."""
        if self.clouds is None:
            return None
        counts = {len(step) for step in self.clouds}
        if len(counts) != 1:
            raise invalid(f'The steps of the shutter have {min(counts)} to {max(counts)} clouds; each has one for each '
                          'instance, or None.')
        flat = [cloud.pointer if cloud is not None else None for step in self.clouds for cloud in step]
        return (c_void_p * len(flat))(*flat)

    def put_into(self, options):
        """A copy of the options, with this blur, which must outlive its use."""
        options = type(options).from_buffer_copy(options)
        if self.aperture is not None:
            options.aperture = pointer(self.aperture)
        if self.shutter is not None:
            options.shutter = pointer(self.shutter)
        options.samples = self.samples
        return options

