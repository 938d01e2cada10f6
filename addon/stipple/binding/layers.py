# SPDX-License-Identifier: GPL-3.0-or-later
"""What another renderer drew of everything but the splats."""

from ctypes import byref

import numpy as np

from .errors import invalid
from .handle import Handle, contiguous, new_handle, pointer_to
from .renderer import Surface
from .structs import StippleLayersBuffers, StippleLayersInfo


class Layers(Handle):
    """Passes as in stipple_layers_create. Arrays are float32 and share one order of rows, whichever that is."""

    free_function = 'stipple_layers_free'

    def __init__(self, context, combined, depth, shadow=None):
        """combined [H,W,4]; depth [H,W]; shadow [H,W,3] or None."""
        self.shape = depth.shape
        height, width = self.shape
        kept = [self._array(combined, 4), self._array(depth), None if shadow is None else self._array(shadow, 3)]
        super().__init__(context.library, new_handle(context.library, 'stipple_layers_create', context.pointer, width,
                                                     height, *(pointer_to(array) for array in kept)))

    def hold_out(self, depth, opacity):
        """depth, opacity [H,W] of holdouts."""
        kept = self._array(depth), self._array(opacity)
        self._check(self.library.stipple_layers_hold_out(self.pointer, *map(pointer_to, kept)))

    def take_world(self, seen, plain=None):
        """seen [H,W,3] light of the world; plain: its colour, or None where it has many."""
        kept = self._array(seen, 3), None if plain is None else contiguous(plain)
        self._check(self.library.stipple_layers_take_world(self.pointer, *map(pointer_to, kept)))

    def take_shadow(self, shadow):
        """shadow [H,W,3] of an image with shadow catchers."""
        kept = self._array(shadow, 3)
        self._check(self.library.stipple_layers_take_shadow(self.pointer, pointer_to(kept)))

    def light_before(self, before, whole):
        """before, whole [H,W,4]: composited colours of the splats before the shadow catchers, and of all."""
        kept = self._array(before, 4), self._array(whole, 4)
        self._check(self.library.stipple_layers_light_before(self.pointer, *map(pointer_to, kept)))

    def info(self):
        info = StippleLayersInfo()
        self._check(self.library.stipple_layers_info(self.pointer, byref(info)))
        return info

    def surface(self):
        """The meshes as a Surface with colours, in the order of rows that was handed in."""
        info = self.info()
        depth, colour = np.empty(self.shape, np.float32), np.empty(self.shape + (4,), np.float32)
        light = np.empty(self.shape + (3,), np.float32) if info.has_light else None
        opacity = np.empty(self.shape, np.float32) if info.has_opacity else None
        self._read(depth=depth, colour=colour, light=light, opacity=opacity)
        return Surface(depth, colour, light, opacity)

    def matte(self, catcher_depth=None, margin=0.0):
        """What meshes and holdouts hide, as a Surface without colours, and from catcher_depth [H,W] on, `margin` metres
        nearer, everything."""
        depth, opacity = np.empty(self.shape, np.float32), np.empty(self.shape, np.float32)
        if catcher_depth is None:
            self._read(depth=depth, opacity=opacity)
        else:
            catchers = self._array(catcher_depth)
            self._check(self.library.stipple_layers_matte(self.pointer, pointer_to(catchers), margin,
                                                          pointer_to(depth), pointer_to(opacity)))
        return Surface(depth, opacity=opacity)

    def compose(self, colour, depth, transmittance):
        """(combined [H,W,4], depth [H,W]) of meshes, splats and world, as new arrays, from the splats' image."""
        colour, depth = np.array(colour, np.float32, order='C'), np.array(depth, np.float32, order='C')
        kept = self._array(colour, 4), self._array(depth), self._array(transmittance)
        self._check(self.library.stipple_layers_compose(self.pointer, *map(pointer_to, kept)))
        return kept[0], kept[1]

    def _read(self, **arrays):
        buffers = StippleLayersBuffers(**{name: pointer_to(array) for name, array in arrays.items()})
        self._check(self.library.stipple_layers_surface(self.pointer, byref(buffers)))

    def _array(self, array, channels=0):
        shape = self.shape + ((channels,) if channels else ())
        if array.shape != shape:
            raise invalid(f'An array of the layers has shape {array.shape}; allowed is {shape}.')
        return contiguous(array)
