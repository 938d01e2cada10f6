#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures drawing in the 3D view: sorted splats against the same quads as they lie in memory.

    python3 tests/blender/run.py tests/blender/bench_viewport.py -s

Not a test of the suite: its name keeps it out. Both orders are drawn in turn, so that they meet the same machine; best
of several runs. What one redraw costs Blender's own thread stands beside it: taking a finished order to the card, and
drawing 1 M splats.
"""

import time

import numpy as np
import pytest

import graphics
import test_view_ellipses as ellipses_test

RUNS = 5
SIZE = (1280, 720)
LIMIT = 2.0  # of the unsorted quads' time


def seconds_of(action):
    start = time.perf_counter()
    action()
    return time.perf_counter() - start


@pytest.mark.parametrize('count,degree', ((200_000, 0), (200_000, 3), (1_000_000, 0)))
def test_sorted_against_unsorted(stipple, monkeypatch, count, degree):
    graphics.require()
    import importlib

    import gpu
    splats = importlib.import_module(f'{stipple.__name__}.viewport.splat_drawing')
    shader = importlib.import_module(f'{stipple.__name__}.viewport.splat_shader')
    target_of = importlib.import_module(f'{stipple.__name__}.viewport.view_ellipses').Target
    arrays = ellipses_test.random_arrays(stipple, count, degree, size=0.5 / count ** 0.5)
    view_camera = ellipses_test.camera(stipple)
    view_camera.width, view_camera.height = SIZE
    view_camera.fx = view_camera.fy = 900.0
    view_camera.cx, view_camera.cy = SIZE[0] / 2, SIZE[1] / 2
    entry = ellipses_test.shown((splats,), stipple, arrays)
    shaders = shader.Shaders()
    view = splats.SplatView(stipple.scene.source.sources.context())
    first = seconds_of(lambda: view.update([entry], view_camera, wait=True))
    task = {}
    texture = shader.texture
    monkeypatch.setattr(shader, 'texture', lambda array, width: task.setdefault(width, array) is None
                        or texture(array, width))
    view_camera.world_to_camera[11] += 0.001
    view.update([entry], view_camera)
    view._task.job.wait()
    take = seconds_of(lambda: view.update([entry], view_camera))
    monkeypatch.undo()
    rows = task[shader.TEXTURE_SPLATS].reshape(-1, 4)
    in_memory = np.concatenate([rows[:count][np.argsort(rows[:count, 0])], rows[count:]])
    textures = {'sorted': view._order.rows, 'unsorted': shader.texture(in_memory, shader.TEXTURE_SPLATS)}
    target = target_of(*SIZE)
    best = dict.fromkeys(textures, 1e9)
    matrix = graphics.window_matrix(view_camera)

    def draw():
        with target.bound(None, False):
            view.draw(shaders, [entry], view_camera, matrix)
            # A read of one pixel waits for the card.
            gpu.state.active_framebuffer_get().read_color(0, 0, 1, 1, 4, 0, 'FLOAT')

    for _ in range(RUNS):
        for name, rows_texture in textures.items():
            view._order.rows = rows_texture
            best[name] = min(best[name], seconds_of(draw))
    view.close()
    ratio = best['sorted'] / best['unsorted']
    print(f"\n{count:,} splats of degree {degree} at {SIZE[0]}x{SIZE[1]} on {gpu.platform.renderer_get()}: sorted "
          f"{best['sorted'] * 1e3:.0f} ms, unsorted {best['unsorted'] * 1e3:.0f} ms, ratio {ratio:.2f} (limit "
          f"{LIMIT}); first picture's data {first * 1e3:.0f} ms, taking an order {take * 1e3:.1f} ms", flush=True)
