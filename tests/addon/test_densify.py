# SPDX-License-Identifier: GPL-3.0-or-later
"""Density control of finished splats through the binding."""

import numpy as np
import pytest
from test_fit import options, views  # noqa: F401

from stipple.binding.cloud import Cloud
from stipple.binding.densify import densify_start
from stipple.binding.errors import StippleError
from stipple.binding.fit import Fit


@pytest.fixture
def few(context, views):  # noqa: F811
    """The start of a fit: points that hardly move."""
    fit = Fit.start(context, views, options(context, iterations=1, start_splats=20))
    fit.wait()
    return fit.result()


def test_adds_splats_up_to_the_cap_and_keeps_the_others(context, views, few):  # noqa: F811
    job = densify_start(context, few, views, 'adaptive(threshold=1e-9)', max_splats=25)
    job.wait()
    before, after = few.read(), Cloud.of_job(job).read()
    assert len(before.positions) == 20
    assert len(after.positions) == 25
    # At least 15 neither multiply nor go; their bits are as they were.
    assert np.isin(after.scales[:, 0], before.scales[:, 0]).sum() >= 15


def test_unknown_names_are_errors(context, views, few):  # noqa: F811
    with pytest.raises(TypeError, match="no option 'events'"):
        densify_start(context, few, views, events=3)
    with pytest.raises(StippleError, match="strategy is 'best'; there is adaptive"):
        densify_start(context, few, views, 'best')
