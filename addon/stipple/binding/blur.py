# SPDX-License-Identifier: GPL-3.0-or-later
"""Aperture and shutter, over which the colours of an image are averaged."""

from ctypes import pointer

import numpy as np

from .errors import invalid
from .handle import contiguous, pointer_to
from .structs import StippleAperture, StippleShutter


class Blur:
    """What spreads an image's light, as in StippleRenderOptions.

    aperture_radius and focus_distance in metres, rotation in radians. cameras [steps,4,4] world to camera and instances
    [steps,count,4,4] object to world, evenly over the open time, or None for what stands still; curve [n] how far the
    shutter is open, or None. samples: images that are averaged, or 0 for as many as the library thinks right.
    """

    def __init__(self, aperture_radius=0.0, focus_distance=1.0, blades=0, rotation=0.0, ratio=1.0, cameras=None,
                 instances=None, curve=None, samples=0):
        self.samples = samples
        self.aperture = None
        if aperture_radius:
            self.aperture = StippleAperture(aperture_radius=aperture_radius, focus_distance=focus_distance,
                                            blades=blades,
                                    rotation=rotation, ratio=ratio)
        self.cameras, self.instances, self.curve = (
            None if array is None else contiguous(array, np.float64) for array in (cameras, instances, curve))
        self.shutter = None
        moving = [array for array in (self.cameras, self.instances) if array is not None]
        if moving:
            steps = len(moving[0])
            if any(len(array) != steps for array in moving):
                raise invalid(f'The shutter has {len(moving[0])} cameras and {len(moving[1])} steps of instances; '
                              'as many of both are allowed.')
            self.shutter = StippleShutter(step_count=steps, cameras=pointer_to(self.cameras),
                                          instances=pointer_to(self.instances), curve=pointer_to(self.curve),
                                          curve_count=0 if self.curve is None else self.curve.size)

    def put_into(self, options):
        """A copy of the options, with this blur, which must outlive its use."""
        options = type(options).from_buffer_copy(options)
        if self.aperture is not None:
            options.aperture = pointer(self.aperture)
        if self.shutter is not None:
            options.shutter = pointer(self.shutter)
        options.samples = self.samples
        return options

