# SPDX-License-Identifier: GPL-3.0-or-later
"""Light that falls off across a filled hole: images of the ground as it was against those with the hole filled."""

import numpy as np
import pytest

from stipple.binding import regions
from stipple.binding.cloud import Cloud, SplatArrays
from stipple.binding.regions import FillSettings
from stipple.binding.renderer import Renderer
from stipple.binding.structs import OutputColour, StippleCamera

C0 = 0.28209479177387814
COUNT, HALF, TEXTURE = 40000, 3.0, 0.05
SIDE, TILE = 240, 16          # pixels of the image, and of the squares that colours are averaged over
PIXELS_PER_METRE = 80.0
CENTRE = (0.1, -0.2)
LIGHTS = {'even': lambda u: np.full(len(u), 0.5),
          'slope': lambda u: 0.5 + 0.1 * u[:, 0] + 0.05 * u[:, 1],
          'bowl': lambda u: 0.4 + 0.04 * (u ** 2).sum(axis=1)}


def ground(light):
    """Flat splats over a square with noise of deviation 0.05, under a light."""
    rng = np.random.default_rng(4)
    u = rng.uniform(-HALF, HALF, (COUNT, 2))
    spacing = 2 * HALF / np.sqrt(COUNT)
    shown = light(u)[:, None] * (1, 0.9, 0.8) + TEXTURE * rng.normal(size=(COUNT, 1))
    return SplatArrays(np.c_[u, np.zeros(COUNT)].astype(np.float32),
                       np.tile(np.float32((1, 0, 0, 0)), (COUNT, 1)),
                       np.tile(np.float32((0.7, 0.6, 0.05)) * np.float32(spacing), (COUNT, 1)),
                       np.full(COUNT, 0.9, np.float32), ((shown - 0.5) / C0).astype(np.float32).reshape(-1, 1, 3))


def seen_from_above(context, *parts):
    camera = StippleCamera(width=SIDE, height=SIDE, fx=3 * PIXELS_PER_METRE, fy=3 * PIXELS_PER_METRE, cx=SIDE / 2,
                           cy=SIDE / 2, near_plane=0.01, far_plane=100.0)
    camera.world_to_camera[:] = [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 3, 0, 0, 0, 1]
    renderer = Renderer(context)
    placed = [(Cloud.create(context, part), np.eye(4)) for part in parts]
    task = renderer.start(placed, camera, renderer.options(output_colour=OutputColour.COMPOSITED))
    task.job.wait()
    return task.colour[..., :3].astype(np.float64)


def chosen(given, mask):
    return SplatArrays(*(getattr(given, name)[mask] for name in ('positions', 'rotations', 'scales', 'opacities', 'sh')))


def psnr(squares):
    return -10 * np.log10(np.mean(squares))


def quality(context, light, radius):
    """(PSNR in the hole, the same of means over squares of 0.2 m), display values."""
    given = ground(LIGHTS[light])
    hole = np.linalg.norm(given.positions[:, :2] - np.float32(CENTRE), axis=1) < radius
    task = regions.fill_start(Cloud.create(context, given), hole, FillSettings())
    task.job.wait()
    off = seen_from_above(context, given) - seen_from_above(context, chosen(given, ~hole), task.cloud().read())
    y, x = np.mgrid[:SIDE, :SIDE] + 0.5
    inside = np.hypot((x - SIDE / 2) / PIXELS_PER_METRE - CENTRE[0],
                      (SIDE / 2 - y) / PIXELS_PER_METRE - CENTRE[1]) < radius
    tiles = (SIDE // TILE, TILE, SIDE // TILE, TILE)
    count = inside.reshape(tiles).sum(axis=(1, 3))
    means = (off * inside[..., None]).reshape(*tiles, 3).sum(axis=(1, 3)) / np.maximum(count, 1)[..., None]
    return psnr(off[inside] ** 2), psnr(means[count > TILE * TILE // 2] ** 2)


@pytest.mark.parametrize('light,radius,least', [('slope', 0.5, 31.5), ('slope', 0.8, 31.0), ('bowl', 0.5, 32.5),
                                                ('bowl', 0.8, 28.5)])
def test_light_goes_on_through_a_hole(context, light, radius, least):
    """Noise of other places limits both: under even light squares have 33.6 dB and pixels 22.3. Copies of colours as
    they are had 29.6, 28.6, 31.2 and 27.3 dB; the limits are half a decibel below what was measured."""
    pixels, squares = quality(context, light, radius)
    assert squares > least
    assert pixels > 21.2


def test_even_light_stays_even(context):
    pixels, squares = quality(context, 'even', 0.8)
    assert squares > 33.0 and pixels > 22.0


def test_copies_are_never_blacker_than_black(context):
    """A slope that goes on below black, where colours are clipped."""
    given = ground(lambda u: np.maximum(0.15 * u[:, 0], 0.0))
    given.sh[:] = np.maximum(given.sh, -0.5 / C0)
    hole = np.linalg.norm(given.positions[:, :2], axis=1) < 0.7
    task = regions.fill_start(Cloud.create(context, given), hole, FillSettings())
    task.job.wait()
    assert task.cloud().read().sh.min() >= np.float32(-0.5 / C0)
