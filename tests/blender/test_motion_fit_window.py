# SPDX-License-Identifier: GPL-3.0-or-later
"""A fit of splats that move in a window: what the panel says before it, Esc while views are rendered, the preview at
the present frame, the clip that plays."""

from pathlib import Path

import bpy
import numpy as np
import pytest

import motion_fit_steps
import screen


@pytest.fixture(scope='module')
def shots(tmp_path_factory):
    folder = tmp_path_factory.mktemp('window')
    return screen.run_steps(Path(motion_fit_steps.__file__), folder, bpy.app.binary_path, timeout=500,
                            size=(1280, 1060), options=('--enable-event-simulate',))


def ball_column(picture):
    """Where on the screen the ball is: the middle of what is red or blue and of no other colour."""
    colours = picture.reshape(picture.shape[0], picture.shape[1], -1)[..., :3].astype(int)
    # Not the axes, which are thin: their colours are less pure.
    pure = (np.abs(colours[..., 0] - colours[..., 2]) > 150) & (colours[..., 1] < 60)
    return np.median(np.argwhere(pure)[:, 1])


def test_escape_while_views_are_rendered_leaves_everything_as_it_was(shots):
    _, facts, text = shots
    assert facts['said'].startswith('Rendering view 2') and facts['said'].endswith('of 96')
    assert facts['was_elsewhere'] and facts['as_before'] and 'Traceback' not in text


def test_the_preview_is_of_the_present_frame(shots):
    pictures, _, _ = shots
    assert ball_column(pictures['preview_first']) < ball_column(pictures['preview_last']) - 100


def test_the_clip_plays_when_it_is_accepted(shots):
    pictures, facts, _ = shots
    assert facts['problem'] == '' and facts['psnr'] > 14 and 100 < facts['count'] <= 4000
    assert facts['clip'][0].endswith(' Fit') and facts['clip'][1:] == [3, 1.0, 'HOLD'] and facts['hidden']
    # The ball goes from -0.9 to 0.9; the fit was stopped early.
    assert facts['at 3'] < -0.3 and facts['at 26'] > 0.3
    assert ball_column(pictures['at_3']) < ball_column(pictures['at_26']) - 100


def test_the_panel_changes_with_what_is_known(shots):
    pictures, _, _ = shots
    for a, b in (('panel', 'rendering'), ('panel', 'told')):
        assert (pictures[a] != pictures[b]).any()
