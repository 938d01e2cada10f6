# SPDX-License-Identifier: GPL-3.0-or-later
"""Detail for splats through the binding: what is refused; tests/cli/test_detail.py trains a network."""

import pytest
from test_fit import options, views  # noqa: F401

from stipple.binding.detail import detail_start
from stipple.binding.errors import StippleError
from stipple.binding.fit import Fit


@pytest.fixture
def few(context, views):  # noqa: F811
    """The start of a fit: points that hardly move."""
    fit = Fit.start(context, views, options(context, iterations=1, start_splats=20))
    fit.wait()
    return fit.result()


def test_weights_that_are_none_are_refused_at_once(context, views, few, tmp_path):  # noqa: F811
    with pytest.raises(StippleError, match='missing.safetensors'):
        detail_start(context, few, views, tmp_path / 'missing.safetensors')
    wrong = tmp_path / 'wrong.safetensors'
    wrong.write_bytes(b'nothing at all')
    with pytest.raises(StippleError, match='wrong.safetensors'):
        detail_start(context, few, views, wrong)
    # One of a network, but of nobody's training.
    wrong.write_bytes((2).to_bytes(8, 'little') + b'{}')
    with pytest.raises(StippleError, match='was not written by a training of ours'):
        detail_start(context, few, views, wrong)
    assert few.info().count == 20
