#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures what a stroke over a million splats costs, in parts, and prints it against its target.

    python3 tests/blender/run.py tests/blender/bench_selection.py -s

Not a test of the suite: its name keeps it out. Best of several runs; processor seconds stand beside them, for machines
that have other work.
"""

import importlib
import time

import bpy
import numpy as np
import pytest

import scenes
from bench_addon import best_of, report
from drawn_views import View, path
from test_edits import import_arrays
from test_splat_data import make_arrays

COUNT = 1_000_000
RUNS = 9
TARGET = 0.05


def cloud(stipple, tmp_path, degree):
    arrays = make_arrays(stipple, count=COUNT, degree=degree)
    arrays.scales[:] = 0.01
    return import_arrays(stipple, tmp_path, arrays)


def tree(stipple, tmp_path):
    obj = cloud(stipple, tmp_path, 0)
    assert bpy.ops.stipple.add_budget() == {'FINISHED'}
    return obj


def mesh(_stipple, tmp_path):
    ball = scenes.sphere()
    return scenes.make_splats(ball, anchors=COUNT, source_path=str(tmp_path / 'ball.stipple.safetensors'))


@pytest.mark.parametrize('name,make', [('file, degree 0', lambda s, t: cloud(s, t, 0)),
                                       ('file, degree 3', lambda s, t: cloud(s, t, 3)), ('tree', tree), ('mesh', mesh)])
def test_a_stroke(stipple, tmp_path, name, make):
    obj, view, rng = make(stipple, tmp_path), View(), np.random.default_rng(1)
    selecting = importlib.import_module('.scene.source.selecting', stipple.__name__)
    drawn = stipple.scene.view.drawn_regions
    previews = importlib.import_module('.operators.selection.stroke_preview', stipple.__name__)
    places = [tuple(place) for place in np.cumsum(rng.normal(0, 6, (60, 2)), axis=0) + (160, 120)]

    def stroke(**more):
        assert bpy.ops.stipple.select_brush(path=path(*places), radius=25.0, **view.given, **more) == {'FINISHED'}

    def forget():
        """As after opening the file: nothing is read, and no depths are drawn."""
        sources._whole.clear()
        sources._whole_ahead.clear()
        selecting.forget()
        drawn.forget()
        viewed._clouds.clear()

    def prepared(front_only):
        """Seconds that Blender waits for what is done when the view rests; then its threads have their time."""
        forget()
        begun = time.perf_counter()
        is_ready = selecting.prepare([obj])
        if front_only:
            drawn.start_front(bpy.context.evaluated_depsgraph_get(), drawn.camera_of(*view.given.values()))
        held = time.perf_counter() - begun
        while not is_ready:
            is_ready = selecting.prepare([obj])
        if front_only:
            next(iter(drawn._last.values())).front()
        return held

    print(f'\n{COUNT:,} splats, {name}, Blender {bpy.app.version_string}')
    sources = stipple.scene.source.sources
    viewed = stipple.scene.view.viewed
    forget()
    report('  first stroke, nothing prepared', best_of(1, stroke), TARGET)
    print(f'  preparing holds Blender for {1e3 * prepared(False):.1f} ms, with Front Only '
          f'{1e3 * prepared(True):.1f} ms')
    prepared(False)
    report('  first stroke, prepared', best_of(1, stroke), TARGET)
    report('  stroke', best_of(RUNS, stroke), TARGET)
    report('  stroke that extends', best_of(RUNS, lambda: stroke(operation='ADD')), TARGET)
    forget()
    report('  first stroke, front only, nothing prepared', best_of(1, lambda: stroke(front_only=True)), TARGET)
    prepared(True)
    report('  first stroke, front only, prepared', best_of(1, lambda: stroke(front_only=True)), TARGET)
    report('  stroke, front only', best_of(RUNS, lambda: stroke(front_only=True)), TARGET)
    stroke()
    target = selecting.targets(bpy.context, [obj])[0]
    region = drawn.brush(obj, drawn.camera_of(*view.given.values()), places, 25.0, 0)
    mask = target.after([region])
    report('  part: what is selected and hidden now', best_of(
        RUNS, lambda: selecting.targets(bpy.context, [obj])), TARGET)
    report('  part: select', best_of(RUNS, lambda: target.after([region])), TARGET)
    report('  part: pack and store', best_of(RUNS, lambda: target.keep_selected(mask, [region])), TARGET)
    shown = {}
    preview = previews.StrokePreview(bpy.context, lambda found: (shown.clear(), shown.update(found)))
    report('  first move of the mouse while drawing', best_of(1, lambda: preview.update(lambda _obj: [region])), 0.016)
    report('  a move of the mouse while drawing', best_of(RUNS, lambda: preview.update(lambda _obj: [region])), 0.016)
    report('  points to draw', best_of(RUNS, lambda: selecting.positions(obj, 200_000)), TARGET)
