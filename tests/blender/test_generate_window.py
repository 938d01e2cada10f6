# SPDX-License-Identifier: GPL-3.0-or-later
"""Images to splats in a window on a virtual screen: preferences, the dialog, the result."""

import sys
from pathlib import Path

import bpy
import numpy as np
import pytest

import screen

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import pipeline_weights  # noqa: E402

STEPS = Path(__file__).resolve().parent / 'generate_steps.py'


@pytest.fixture(scope='module')
def shots(tmp_path_factory):
    folder = tmp_path_factory.mktemp('window')
    weights = tmp_path_factory.mktemp('networks') / 'weights'
    weights.mkdir()
    pipeline_weights.split(weights)
    return screen.run_steps(STEPS, folder, bpy.app.binary_path, size=(1900, 1100), arguments=[str(weights)],
                            options=['--enable-event-simulate'])


def test_preferences_show_the_table(shots):
    pictures, facts, text = shots
    assert 'Traceback' not in text
    x, y, width, height = facts['preferences']
    picture = pictures['preferences']
    shown = picture[len(picture) - y - height:len(picture) - y, x:x + width]
    assert np.ptp(shown) > 100


def test_the_dialog_comes_before_the_work(shots):
    pictures, _, _ = shots
    assert (pictures['dialog'] != pictures['preferences']).any(-1).sum() > 20_000


def test_the_result_stands_in_place_of_what_was_rendered(shots):
    _, facts, _ = shots
    assert facts['count'] == 64 * 32 and facts['cube_hidden']
    assert facts['location'] == pytest.approx((0.0, 0.0, -1.0))
