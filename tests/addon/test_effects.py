# SPDX-License-Identifier: GPL-3.0-or-later
"""The plan of effects through the C header."""

import ctypes
import math

import numpy as np
import pytest

from stipple.binding import effects
from stipple.binding.blur import Blur
from stipple.binding.cloud import Cloud, SplatArrays
from stipple.binding.errors import StippleError
from stipple.binding.renderer import Renderer, Surface
from stipple.binding.structs import (CameraModel, Effect, EffectChoice, ObjectOrder, StippleCamera, StippleEffectRow,
                                     StippleEffectsSurvey)


@pytest.fixture
def cloud(context):
    """A hundred splats of degree 1 about the origin; red is brighter from +x than from -x."""
    random = np.random.default_rng(3)
    n = 100
    sh = np.zeros((n, 4, 3), np.float32)
    sh[:, 3, 0] = -0.4
    return Cloud.create(context, SplatArrays(random.uniform(-1, 1, (n, 3)), np.tile([1.0, 0, 0, 0], (n, 1)),
                                             np.full((n, 3), 0.02), np.full(n, 0.9), sh))


def camera(focal=100.0):
    matrix = (ctypes.c_double * 16)(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 4, 0, 0, 0, 1)
    return StippleCamera(model=int(CameraModel.PERSPECTIVE), width=200, height=200, fx=focal, fy=focal, cx=100, cy=100,
                         world_to_camera=matrix, near_plane=0.01, far_plane=100)


def test_a_plan_from_splats_to_reasons(context, cloud):
    seen = effects.survey(context, [(cloud, np.eye(4)), (cloud, np.eye(4))], camera())
    assert (seen.splat_count, seen.object_count, seen.mixed_count, seen.sh_degree) == (200, 2, 2, 1)
    assert seen.view_change[1] == pytest.approx(0.4 / math.sqrt(4 * math.pi * 3), rel=1e-5)
    given = effects.facts(context.library, seen, seconds={Effect.VIEW_COLOUR: 0.25}, motion_blur=1,
                          exact_projection=int(EffectChoice.ON))
    rows = effects.plan(context.library, given)
    assert [row.effect for row in rows] == list(Effect)
    assert {row.effect for row in rows if row.is_on} == {
        Effect.VIEW_COLOUR, Effect.EXACT_PROJECTION, Effect.GLOBAL_ORDER, Effect.ZOOM_ANTIALIASING}
    assert rows[Effect.VIEW_COLOUR].sh_degree == 1 and rows[Effect.VIEW_COLOUR].seconds == 0.25
    assert rows[Effect.MOTION_BLUR].reason == 'Motion Blur is on, but nothing moves while the shutter is open'
    assert not rows[Effect.MOTION].is_measured
    assert all(row.reason and not row.reason.endswith('.') for row in rows)


def test_wide_angles_and_distance_change_the_plan(context, cloud):
    # A tenth of the size: splats of 0.2 px, 19 times as large with the low-pass.
    small = [(cloud, np.diag([0.2, 0.2, 0.2, 1.0]))]
    rows = effects.plan(context.library, effects.facts(context.library, effects.survey(context, small, camera())))
    assert rows[Effect.ZOOM_ANTIALIASING].is_on
    assert not rows[Effect.EXACT_PROJECTION].is_on
    large = [(cloud, np.diag([8.0, 8.0, 8.0, 1.0]))]
    rows = effects.plan(context.library, effects.facts(context.library, effects.survey(context, large, camera())))
    assert rows[Effect.EXACT_PROJECTION].is_on, rows[Effect.EXACT_PROJECTION].reason
    assert 'field of view 109' in rows[Effect.EXACT_PROJECTION].reason


def test_panoramas_are_looked_at_and_follow_rays(context, cloud):
    for model in (CameraModel.EQUIRECTANGULAR, CameraModel.FISHEYE_EQUIDISTANT):
        view = camera(100.0)  # 115 degrees
        view.model = int(model)
        seen = effects.survey(context, [(cloud, np.eye(4)), (cloud, np.eye(4))], view)
        assert (seen.seen_count, seen.mixed_count, seen.affine_error_px, seen.field_of_view) == (200, 2, 0.0, 0.0)
        rows = effects.plan(context.library, effects.facts(context.library, seen, camera_model=int(model)))
        assert rows[Effect.EXACT_PROJECTION].is_on and 'Panoramic' in rows[Effect.EXACT_PROJECTION].reason


def test_bad_facts_are_refused(context):
    library = context.library
    for field, value, text in (('view_colour', 3, 'facts->view_colour is 3; 0 to 2'),
                               ('motion_blur', 2, 'motion_blur is 2'), ('camera_model', 99, 'camera_model is 99'),
                               ('view_share', 2.0, 'view_share is 2'),
                               ('largest_widening', 0.5, 'largest_widening is 0.5; 1 to')):
        with pytest.raises(StippleError, match=text.replace('>', '.')):
            effects.plan(library, effects.facts(library, **{field: value}))
    broken = StippleEffectsSurvey(sh_degree=9)
    with pytest.raises(StippleError, match='sh_degree is 9'):
        effects.plan(library, effects.facts(library, broken))
    given = effects.facts(library)
    rows = (StippleEffectRow * 2)(StippleEffectRow(), StippleEffectRow())
    status = library.stipple_effects_plan(ctypes.byref(given), rows, 2)
    assert status != 0 and b'capacity is 2; 12 rows' in library.stipple_last_error_message()


def test_objects_are_drawn_together_or_apart(context):
    random = np.random.default_rng(4)
    cloud = Cloud.create(context, SplatArrays(random.uniform(-1, 1, (50, 3)), np.tile([1.0, 0, 0, 0], (50, 1)),
                                              np.full((50, 3), 0.3), np.full(50, 0.9),
                                              random.uniform(-1, 1, (50, 1, 3))))
    renderer = Renderer(context)

    def picture(placed, order, **given):
        task = renderer.start(placed, camera(), renderer.options(object_order=order), with_depth=False, **given)
        task.job.wait()
        return task.colour

    moved = np.eye(4)
    moved[2, 3] = 0.1
    inside = [(cloud, np.eye(4)), (cloud, moved)]
    assert np.abs(picture(inside, ObjectOrder.APART) - picture(inside, ObjectOrder.TOGETHER)).max() > 0.01
    moved[2, 3] = 3.0
    behind = [(cloud, moved), (cloud, np.eye(4))]
    np.testing.assert_array_equal(picture(behind, ObjectOrder.APART), picture(behind, ObjectOrder.TOGETHER))
    surface = Surface(np.full((200, 200), 4.0, np.float32))
    with pytest.raises(StippleError, match='without global ordering no mesh can hide splats'):
        picture(behind, ObjectOrder.APART, surface=surface)
    with pytest.raises(StippleError, match='object_order is 2'):
        picture(behind, 2)


def test_the_pictures_of_an_average_are_known_before(context, cloud):
    renderer = Renderer(context)
    placed, options = [(cloud, np.eye(4))], renderer.options()
    assert renderer.sample_count(placed, camera(), options, Blur()) == 1
    assert renderer.sample_count(placed, camera(), options, Blur(0.1, 4.0, samples=7)) == 7
    assert renderer.sample_count(placed, camera(), options, Blur(1e-4, 4.0)) == 16
    assert renderer.sample_count(placed, camera(), options, Blur(1.0, 2.0)) == 256
