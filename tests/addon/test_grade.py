# SPDX-License-Identifier: GPL-3.0-or-later
"""Colour grades through the C header."""

import numpy as np
import pytest

from stipple.binding import cloud_edit
from stipple.binding.cloud import Cloud, SplatArrays
from stipple.binding.errors import StippleError
from stipple.binding.grade import GradeSettings, graded
from stipple.binding.renderer import instance_array
from stipple.binding.structs import ColourSpace

C0 = 0.28209479177387814


def one_splat(context, colour, space=ColourSpace.DISPLAY):
    sh = ((np.array(colour) - 0.5) / C0).reshape(1, 1, 3)
    return Cloud.create(context, SplatArrays(np.zeros((1, 3)), np.array([[1.0, 0, 0, 0]]), np.full((1, 3), 0.1),
                                             np.array([0.8]), sh, space))


def colour_of(cloud):
    return cloud.read().sh[0, 0].astype(np.float64) * C0 + 0.5


def test_neutral_settings_give_the_cloud_itself(context):
    cloud = one_splat(context, (0.2, 0.4, 0.6))
    assert graded(cloud, GradeSettings()) is cloud
    assert not instance_array([(cloud, np.eye(4))])[0].grade


def test_one_stop_doubles_the_light(context):
    cloud = one_splat(context, (0.2, 0.4, 0.6))
    brighter = colour_of(graded(cloud, GradeSettings(exposure=1.0)))
    light = ((np.array((0.2, 0.4, 0.6)) + 0.055) / 1.055) ** 2.4
    # Harmonics are float32: 6e-8 of about 1.
    np.testing.assert_allclose(brighter, 1.055 * (2 * light) ** (1 / 2.4) - 0.055, atol=3e-7)
    linear = colour_of(graded(one_splat(context, (0.2, 0.4, 0.6), ColourSpace.LINEAR), GradeSettings(exposure=1.0)))
    np.testing.assert_allclose(linear, (0.4, 0.8, 1.2), atol=3e-7)


def test_merging_bakes_and_the_cloud_stays(context):
    cloud = one_splat(context, (0.9, 0.3, 0.1))
    grey = graded(cloud, GradeSettings(saturation=0.0, opacity=0.5))
    joined = cloud_edit.merge([(grey, np.eye(4)), (cloud, np.eye(4))]).read()
    luma = np.dot((0.2126, 0.7152, 0.0722), (0.9, 0.3, 0.1))
    np.testing.assert_allclose(joined.sh[0, 0] * C0 + 0.5, np.full(3, luma), atol=3e-7)
    np.testing.assert_allclose(joined.opacities, (0.4, 0.8), rtol=1e-6)
    np.testing.assert_allclose(colour_of(cloud), (0.9, 0.3, 0.1), atol=3e-7)


def test_settings_outside_their_range_are_refused(context):
    cloud = one_splat(context, (0.2, 0.4, 0.6))
    with pytest.raises(StippleError, match='saturation is -1'):
        graded(cloud, GradeSettings(saturation=-1.0))
