# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats that move, fitted to a scene of Blender: which views are taken when, and that the clip plays as the scene
does."""

import importlib
import math

import bpy
import numpy as np
import pytest

import moving_scene
import scenes
from moving_scene import FIRST, LAST, fitted, settings


def module(stipple, name):
    return importlib.import_module(name, stipple.__name__)


@pytest.fixture
def fitting(stipple):
    return module(stipple, '.scene.fit.fitting')


@pytest.fixture
def times(stipple):
    return module(stipple, '.scene.fit.view_times')


def steps_of(task):
    while task.is_running:
        task.poll()
        yield task


def positions(stipple, obj, frame):
    bpy.context.scene.frame_set(int(frame), subframe=frame % 1)
    return stipple.scene.source.splat_data.read(obj.data).positions


@pytest.mark.parametrize('time_count,camera_count,image_count', [
    (24, 12, 24), (24, 12, 96), (24, 12, 288), (60, 16, 240), (7, 3, 20), (7, 1, 7), (50, 2, 99), (5, 60, 240),
    (9, 10, 45), (11, 13, 60)])
def test_images_are_spread_evenly_over_times_and_cameras(times, time_count, camera_count, image_count):
    pairs = times.spread(time_count, camera_count, image_count)
    assert len(set(pairs)) == len(pairs) == image_count and list(pairs) == sorted(pairs, key=lambda pair: pair[0])
    for which, count in ((0, time_count), (1, camera_count)):
        taken = np.bincount([pair[which] for pair in pairs], minlength=count)
        assert len(taken) == count and np.ptp(taken) <= 1
    cameras = [{camera for when, camera in pairs if when == t} for t in range(time_count)]
    for one, next_one in zip(cameras, cameras[1:]):
        if len(one) + len(next_one) <= camera_count:
            assert not one & next_one


def test_the_panel_says_what_is_rendered(fitting, tmp_path):
    moving_scene.build(tmp_path)
    chosen = settings(view_count=16, image_count=240, scene_range=False, range_start=1, range_end=60)
    assert str(fitting.plan_of(bpy.context, chosen)) == '16 cameras × 60 frames = 960 images; 240 are rendered'
    chosen.frame_step, chosen.range_end, chosen.image_count = 0.5, 5, 1000
    plan = fitting.plan_of(bpy.context, chosen)
    assert plan.frames == tuple(1 + i / 2 for i in range(9))
    assert str(plan) == '16 cameras × 9 times = 144 images; all are rendered'
    chosen.held_out_cameras = 4
    assert fitting.plan_of(bpy.context, chosen).held_out == {2, 6, 10, 14}
    chosen.model = 'EXPLICIT'
    assert fitting.plan_of(bpy.context, chosen) is None


def test_the_clip_plays_as_the_scene_does(stipple, tmp_path, fitting):
    ball, box = moving_scene.build(tmp_path)
    scene = bpy.context.scene
    judge = moving_scene.Judge(stipple, tmp_path, ball, box)
    scene.frame_set(14, subframe=0.5)
    settings(quality='BALANCED', image_count=288)
    moving = fitted()
    # Everything is as it was, and the clip is in place.
    assert (scene.frame_current, scene.frame_subframe, scene.camera) == (14, 0.5, judge.camera)
    stored = moving.data.stipple
    assert (stored.frame_start, stored.frame_offset, stored.frame_speed, stored.time_mode) == (FIRST, 0, 1.0, 'HOLD')
    assert stored.source.startswith('//') and 100 < stipple.scene.source.splat_data.count(moving.data) <= 2000
    known = stipple.scene.source.source_settings.of(stored)
    assert known.has_time and known.time_begin == 0
    assert known.time_end == pytest.approx((LAST - FIRST) / 24, rel=1e-6)
    # What was written at the end is of the present time.
    shown = stipple.scene.source.splat_data.read(moving.data).positions
    assert not np.allclose(positions(stipple, moving, FIRST), shown)
    np.testing.assert_array_equal(positions(stipple, moving, 14.5), shown)

    scene.frame_set(FIRST)
    scenes.select(ball, box)
    settings(model='EXPLICIT', quality='BALANCED')
    still = fitted()
    found = {name: [judge.psnr(obj, frame) for frame in (FIRST, 14.5, LAST)]
             for name, obj in (('moving', moving), ('still', still))}
    swapped = [judge.psnr(moving, frame, shown_at) for frame, shown_at in ((FIRST, LAST), (LAST, FIRST))]
    print(found, swapped)
    # Measured: moving 15.1, 16.4 and 17.2 dB, still 19.3 at its own frame and 9.8 at the last; at the wrong end of the
    # clip 9.5.
    assert min(found['moving']) > 13
    assert found['moving'][2] > found['still'][2] + 4 and found['still'][0] > 17
    assert max(swapped) < 11
