# SPDX-License-Identifier: GPL-3.0-or-later
"""What Cycles drew of everything but the splats, as a surface between the splats, and the picture of both.

Arrays are float32 and scene linear, colours premultiplied; rows as Blender has them, bottom row first.
"""

import numpy as np

from ...binding.renderer import EMPTY_DEPTH, Surface


class CyclesLayers:
    """Passes of a picture whose film was transparent."""

    def __init__(self, combined, depth, shadow=None):
        """combined [H,W,4]; depth [H,W] of one sample of each pixel; shadow [H,W,3] factors of what is behind a shadow
        catcher, or None without one."""
        self.depth = np.where(np.isnan(depth), np.float32(EMPTY_DEPTH), depth)
        # What is not finite shows as black in every picture: it must not stop this one.
        self.colour = np.nan_to_num(combined, nan=0.0, posinf=0.0, neginf=0.0)  # alpha of meshes alone
        self.colour[..., 3] = np.clip(self.colour[..., 3], 0.0, 1.0)
        self._held = None  # (depth [H,W], opacity [H,W]) of holdouts
        self.world = None  # [H,W,3] light that the camera sees of the world, or None where the film stays transparent
        self.light = self._passed = None
        if shadow is not None:
            self.light = np.clip(np.nan_to_num(shadow, nan=1.0, posinf=1.0), 0.0, None)
            # What is left of the light behind, as Cycles' alpha has it.
            self._passed = np.clip(self.light.mean(axis=2), 0.0, 1.0)
            self.colour[..., 3] = _alpha_without_shadow(self.colour[..., 3], self._passed)

    def take_world(self, seen, plain):
        """seen [H,W,3]: the pass of the world; plain: its colour, or None where it has many."""
        self.world = np.nan_to_num(seen, nan=0.0, posinf=0.0, neginf=0.0)
        if self.light is None:
            return
        # Cycles leaves out what it would show behind a shadow catcher.
        no_catcher = (self.light == 1.0).all(axis=2)
        nothing = self.depth >= EMPTY_DEPTH
        meshes = self.colour[..., 3]
        behind = plain if plain is not None else _spread(self.world, no_catcher & nothing & (meshes == 0))
        gaps = (1.0 - self._hidden())[..., None]
        known = (no_catcher & (nothing | (meshes > 0)))[..., None]
        self.world = np.where(known, self.world, gaps * np.asarray(behind, np.float32))

    def hold_out(self, matte):
        """Before take_world. matte: a Surface of the holdouts, of which Cycles' passes show nothing but what they leave of the rest."""
        self._held = matte.depth[::-1], matte.opacity[::-1]

    def surface(self):
        """The meshes, to stand between the splats."""
        depth = _depth_at_edges(self.depth, self.colour[..., 3])
        opacity = None
        if self._held is not None:
            # Where both share a pixel, one depth stands for both.
            depth = np.minimum(depth, self._held[0])
            opacity = self._hidden()[::-1]
        return Surface(depth[::-1], self.colour[::-1], None if self.light is None else self.light[::-1], opacity)

    def has_shadows(self):
        return self.light is not None and bool((self.light != 1.0).any())

    def matte(self):
        """The meshes as a matte: what is left of a picture is the splats' part of it."""
        surface = self.surface()
        return Surface(surface.depth, opacity=self._hidden()[::-1])

    def matte_of(self, catchers, margin):
        """The same with shadow catchers, each a margin nearer than it is. catchers: a Surface of their depth.

        Nothing behind a catcher is left, nor, where a mesh before it covers a pixel in part, what is between the two.
        """
        meshes = self.matte()
        return Surface(np.minimum(catchers.depth - np.float32(margin), meshes.depth),
                       opacity=np.where(catchers.depth < EMPTY_DEPTH, np.float32(1.0), meshes.opacity))

    def light_before_catchers(self, before, whole):
        """Leaves shadows to the splats at and behind catchers. before, whole [H,W,4]: composited colours of the splats
        before the catchers, and of all; each pixel's light is shared as these are."""
        # A pixel without splats has no share of either.
        share = np.divide(before[..., :3], whole[..., :3], out=np.zeros_like(before[..., :3]),
                          where=whole[..., :3] > 0)
        share = np.clip(share, 0.0, 1.0)
        self.light = share + (1.0 - share) * self.light

    def _hidden(self):
        """[H,W] how much meshes and holdouts hide: Cycles' alpha is that of what holdouts leave of meshes."""
        alpha = self.colour[..., 3]
        return alpha if self._held is None else np.minimum(alpha + self._held[1], np.float32(1.0))

    def picture(self, task):
        """(combined [H,W,4], depth [H,W]) of meshes, splats and world, from the splats' finished task."""
        colour, depth = task.colour[::-1].copy(), task.depth[::-1].copy()
        untouched = (colour == self.colour).all(axis=2)
        depth[untouched] = self.depth[untouched]
        through = task.transmittance[::-1]
        passed = np.float32(1.0) if self._passed is None else self._passed
        if self.world is None:
            # Shadows on nothing are black with an alpha, as Cycles has them.
            colour[..., 3] += through * (1 - passed)
            return colour, depth
        # Of the world's light that the meshes let pass, splats take their share.
        gaps = 1.0 - self._hidden()
        share = np.divide(through, gaps, out=np.zeros_like(through), where=gaps > 0)
        colour[..., :3] += (np.minimum(share, 1) * passed)[..., None] * self.world
        # What neither shows nor passes is held out; less than a rounding of the two is nothing.
        held = 1.0 - colour[..., 3] - through
        colour[..., 3] = np.where(held > 1e-5, 1.0 - held, 1.0)
        return colour, depth


def _alpha_without_shadow(alpha, passed):
    """Of meshes alone: Cycles' alpha is 1 - (1 - a) s where a shadow lets s pass. Where s is 0, all is black."""
    left = np.divide(1.0 - alpha, passed, out=1.0 - alpha, where=passed > 0)
    return np.clip(1.0 - left, 0.0, 1.0).astype(np.float32)


def _depth_at_edges(depth, alpha):
    """Depth for pixels that a mesh covers in part.

    Cycles' depth is that of one sample, which may have missed the mesh that the colour is of: the nearest depth among
    the pixel and its neighbours that a mesh covers.
    """
    partial = (alpha > 0) & (alpha < 1)
    if not partial.any():
        return depth
    of_meshes = np.where(alpha > 0, depth, np.float32(EMPTY_DEPTH))
    height, width = depth.shape
    padded = np.pad(of_meshes, 1, constant_values=np.float32(EMPTY_DEPTH))
    nearest = of_meshes
    for y in range(3):
        for x in range(3):
            nearest = np.minimum(nearest, padded[y:y + height, x:x + width])
    return np.where(partial, nearest, depth)


def _spread(colour, known):
    """[H,W,3] with the pixels that are not known filled from ever coarser means of those that are."""
    weight = known.astype(np.float32)
    return _pull(colour * weight[..., None], weight)


def _pull(colour, weight):
    """colour [H,W,3] times weight [H,W] -> colour, holes filled."""
    height, width = weight.shape
    own = colour / np.maximum(weight, 1e-9)[..., None]
    if height * width == 1:
        return own
    odd = ((0, height % 2), (0, width % 2))
    colours = np.pad(colour, odd + ((0, 0),)).reshape(-(-height // 2), 2, -(-width // 2), 2, 3).sum(axis=(1, 3))
    weights = np.pad(weight, odd).reshape(-(-height // 2), 2, -(-width // 2), 2).sum(axis=(1, 3))
    coarse = _pull(colours, weights).repeat(2, axis=0).repeat(2, axis=1)[:height, :width]
    return np.where(weight[..., None] > 0, own, coarse)
