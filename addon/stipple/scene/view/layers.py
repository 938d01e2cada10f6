# SPDX-License-Identifier: GPL-3.0-or-later
"""What Cycles drew of everything but the splats, as a surface between the splats, and the image of both.

Arrays are float32 and scene linear, colours premultiplied; rows as Blender has them, bottom row first. The library
has the first row at the top: what goes to its renderer and comes back is turned over.
"""

from ...binding.layers import Layers
from ...binding.renderer import Surface


class CyclesLayers:
    """Passes of an image whose film was transparent."""

    def __init__(self, context, combined, depth):
        """combined [H,W,4]; depth [H,W] of one sample of each pixel; neither has anything of shadow catchers."""
        self._layers = Layers(context, combined, depth)

    def take_world(self, seen):
        """seen [H,W,3]: the pass of the world."""
        self._layers.take_world(seen)

    def take_shadow(self, shadow):
        """After take_world. shadow [H,W,3]: factors of the light of what is behind shadow catchers."""
        self._layers.take_shadow(shadow)

    def hold_out(self, matte):
        """Before take_world. matte: a Surface of the holdouts, of which Cycles' passes show nothing but what they leave
        of the rest."""
        self._layers.hold_out(matte.depth[::-1], matte.opacity[::-1])

    def surface(self):
        """The meshes, to stand between the splats."""
        return _turned_over(self._layers.surface())

    def has_shadows(self):
        return bool(self._layers.info().has_shadows)

    def matte(self):
        """The meshes as a matte: what is left of an image is the splats' part of it."""
        return _turned_over(self._layers.matte())

    def matte_of(self, catchers, margin):
        """The same with shadow catchers, each a margin nearer than it is. catchers: a Surface of their depth."""
        return _turned_over(self._layers.matte(catchers.depth[::-1], margin))

    def light_before_catchers(self, before, whole):
        """Leaves shadows to the splats at and behind catchers. before, whole [H,W,4]: composited colours of the splats
        before the catchers, and of all."""
        self._layers.light_before(before, whole)

    def picture(self, task):
        """(combined [H,W,4], depth [H,W]) of meshes, splats and world, from the splats' finished task."""
        return self._layers.compose(task.colour[::-1], task.depth[::-1], task.transmittance[::-1])


def _turned_over(surface):
    return Surface(*(None if array is None else array[::-1]
                     for array in (surface.depth, surface.colour, surface.light, surface.opacity)))
