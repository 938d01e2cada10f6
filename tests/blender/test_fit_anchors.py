# SPDX-License-Identifier: GPL-3.0-or-later
"""Anchors with features, of a scene that stands still and at key frames of a long shot: from the operator to an object
with a budget that plays."""

import importlib

import bpy
import numpy as np
import pytest

import moving_scene
import scenes


@pytest.fixture
def fitting(stipple):
    return importlib.import_module('.scene.fit.fitting', stipple.__name__)


@pytest.fixture
def times(stipple):
    return importlib.import_module('.scene.fit.view_times', stipple.__name__)


def positions(stipple, obj, frame):
    bpy.context.scene.frame_set(frame)
    return stipple.scene.source.splat_data.read(obj.data).positions


def test_a_ball_becomes_anchors_with_a_budget(stipple, fitting, tmp_path):
    scenes.two_coloured_ball(tmp_path)
    chosen = bpy.context.scene.stipple.fit
    for name, value in {'view_count': 10, 'view_size': 48, 'engine': 'WORKBENCH', 'max_splats': 4000, 'quality': 'FAST',
                        'model': 'SCAFFOLD'}.items():
        setattr(chosen, name, value)
    assert bpy.ops.stipple.splats_fit() == {'FINISHED'}
    obj = next(o for o in bpy.data.objects if o.name.endswith(' Fit'))
    assert obj.data.stipple.source_kind == 'MODEL'
    assert fitting.state.figures.best_psnr > 20
    splats = stipple.scene.source.splat_data.read(obj.data)
    distance = np.abs(np.linalg.norm(splats.positions, axis=1) - 1)
    weight = splats.opacities / splats.opacities.sum()
    assert weight[distance < 0.25].sum() > 0.8  # 0.88
    obj.data.stipple.anchors = obj.data.stipple.anchors // 4
    fewer = stipple.scene.source.splat_data.read(obj.data)
    assert 0 < len(fewer.positions) < len(splats.positions)
    # More than there are shows all of them.
    obj.data.stipple.anchors = 10_000_000
    np.testing.assert_array_equal(stipple.scene.source.splat_data.read(obj.data).positions, splats.positions)


@pytest.mark.parametrize('times_of,spacing,wanted', [
    ((0, 0.5, 1, 1.5, 2), 1, (0.5, 1.5)), ((0, 0.5, 1, 1.5, 2, 2.5), 1, (0, 1, 2)), ((0, 1), 5, (0,)), ((3,), 1, (0,)),
    ((0, 0.1, 0.2), 0.01, (0, 0.1)), ((0, 0.25, 0.5, 0.75, 1, 1.25, 1.5), 1, (0.25, 1.25)), ((0, 1, 2, 3), 9, (1,))])
def test_key_frames_stand_where_the_library_has_them(times, times_of, spacing, wanted):
    assert times.key_frame_seconds(times_of, spacing) == pytest.approx(wanted)


def test_a_long_shot_plays_and_has_markers(stipple, tmp_path):
    ball, box = moving_scene.build(tmp_path)
    judge = moving_scene.Judge(stipple, tmp_path, ball, box)
    chosen = moving_scene.settings(model='RELAY', quality='FAST', image_count=96, key_frame_spacing=0.5)
    assert chosen.model == 'RELAY'
    shot = moving_scene.fitted()
    scene = bpy.context.scene
    rate = scene.render.fps / scene.render.fps_base
    marked = sorted(marker.frame for marker in scene.timeline_markers)
    assert marked[0] - moving_scene.FIRST == pytest.approx(moving_scene.LAST - marked[-1], abs=1)
    assert np.diff(marked) == pytest.approx(0.5 * rate, abs=1)
    assert all(marker.name.startswith(shot.name) for marker in scene.timeline_markers)
    first, middle = (positions(stipple, shot, frame)
                     for frame in (moving_scene.FIRST, (moving_scene.FIRST + moving_scene.LAST) // 2))
    assert len(first) > 50
    assert len(first) != len(middle) or np.abs(first - middle).max() > 0.01
    assert shot.data.stipple.frame_start == moving_scene.FIRST
    right = [judge.psnr(shot, frame) for frame in (moving_scene.FIRST, 14.5, moving_scene.LAST)]
    swapped = judge.psnr(shot, moving_scene.FIRST, moving_scene.LAST)
    print('long shot', right, swapped)
    assert min(right) > swapped + 2
