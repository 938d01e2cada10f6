# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats from an image in a window on a virtual screen: the file browser, a preview, Esc."""

import sys
from pathlib import Path

import bpy
import numpy as np
import pytest

import screen

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import pipeline_weights  # noqa: E402
from test_from_image import save_image  # noqa: E402

STEPS = Path(__file__).resolve().parent / 'from_image_steps.py'


@pytest.fixture(scope='module')
def shots(tmp_path_factory):
    folder = tmp_path_factory.mktemp('window')
    weights = tmp_path_factory.mktemp('networks') / 'weights'
    weights.mkdir()
    pipeline_weights.split(weights)
    width, height, rgba = pipeline_weights.image()
    image = save_image(weights.parent / 'chair.png', np.frombuffer(rgba, np.uint8).reshape(height, width, 4))
    return screen.run_steps(STEPS, folder, bpy.app.binary_path, size=(1600, 1000),
                            arguments=[str(weights), str(image)], options=['--enable-event-simulate'])


def test_a_preview_is_shown_while_the_networks_work(shots):
    pictures, facts, text = shots
    assert 'Traceback' not in text
    assert facts['preview'] > 0 and not facts['preview_has_source']
    assert (pictures['preview'] != pictures['stopped']).any(-1).sum() > 2_000


def test_escape_takes_the_preview_away_and_keeps_what_was_done(shots):
    _, facts, _ = shots
    assert facts['objects'] == ['Camera', 'Light']
    assert any(name.startswith('generation_') for name in facts['kept'])
