#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures what an artist waits for, and prints it against its target.

    python3 tests/blender/run.py tests/blender/bench_addon.py -s

Not a test of the suite: the names of its functions keep it out. Best of several runs, one process.
"""

import time

import bpy
import numpy as np
import pytest

import scenes

pytestmark = pytest.mark.filterwarnings('ignore')


def best_of(runs, action):
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return min(times)


def report(name, seconds, target):
    print(f'{name}: {seconds * 1e3:.0f} ms, target {target * 1e3:.0f} ms, ratio {target / seconds:.2f}x', flush=True)


def textured_sphere(triangles):
    """A UV sphere of about this many triangles with a 1024 px texture."""
    rings = int((triangles / 4) ** 0.5)
    obj = scenes.sphere('Ball', segments=2 * rings, rings=rings)
    image = bpy.data.images.new('noise', 1024, 1024)
    image.pixels.foreach_set(np.random.default_rng(0).random(1024 * 1024 * 4, np.float32))
    scenes.image_material('noise', image, obj)
    obj.data.polygons.foreach_set('use_smooth', np.ones(len(obj.data.polygons), np.bool_))
    return obj


def test_slider_and_surface(stipple, tmp_path):
    ball = textured_sphere(500_000)
    ball.data.calc_loop_triangles()
    print(f'\n{len(ball.data.loop_triangles):,} triangles, Blender {bpy.app.version_string}')
    path = str(tmp_path / 'ball.stipple.safetensors')

    def make():
        scenes.make_splats(ball, anchors=100_000, hide_source=False, source_path=path)

    report('100 k anchors from 500 k triangles, with the transfer', best_of(3, make), 1.0)
    settings = bpy.context.object.data.stipple
    budgets = iter(range(50_001, 60_000))

    def move():
        settings.anchors = next(budgets)

    report('slider move at 50 k anchors', best_of(10, move), 0.1)
