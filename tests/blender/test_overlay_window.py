# SPDX-License-Identifier: GPL-3.0-or-later
"""The overlay that colours splats by what density control saw, in a window on a virtual screen."""

from pathlib import Path

import bpy
import numpy as np
import pytest

import overlay_steps
import screen


@pytest.fixture(scope='module')
def shots(tmp_path_factory):
    folder = tmp_path_factory.mktemp('window')
    pictures, facts, text = screen.run_steps(Path(overlay_steps.__file__), folder, bpy.app.binary_path, timeout=500,
                                             size=(1000, 800), options=('--enable-event-simulate',))
    assert 'Traceback' not in text, text
    return pictures, facts


def middle(shots, name):
    """Pixels [n,3] of the ball."""
    x, y = map(round, shots[1]['middle'])
    return shots[0][name][y - 60:y + 60, x - 60:x + 60].reshape(-1, 3).astype(int)


def purple_to_yellow(pixels):
    """Share of pixels that have a colour of the map: no red without green, as the ball's own halves have."""
    red, green, blue = pixels.T
    on_map = (np.abs(red - green) < 140) & ~((red > 150) & (green < 90)) & (np.ptp(pixels, axis=1) > 40)
    return on_map.mean()


def test_a_fit_that_runs_shows_what_splats_contribute(shots):
    assert shots[1]['is_running']
    # Splats of the first previews are faint, so that the grey behind dims their colors; the ball's own have 0.05.
    assert purple_to_yellow(middle(shots, 'live')) > 0.3


@pytest.mark.parametrize('name', ('age', 'score', 'contribution', 'axis', 'densified'))
def test_every_kind_colors_the_splats(shots, name):
    own, picture = middle(shots, 'own'), middle(shots, name)
    assert (np.abs(own - picture).max(axis=1) > 30).mean() > 0.8
    if name != 'axis':
        assert purple_to_yellow(picture) > 0.5


def test_kinds_differ(shots):
    names = ('age', 'score', 'contribution', 'axis')
    for i, one in enumerate(names):
        for other in names[i + 1:]:
            assert (middle(shots, one) != middle(shots, other)).any()


def test_without_overlays_splats_have_their_own_colors(shots):
    own, hidden = middle(shots, 'own'), middle(shots, 'hidden')
    assert (np.abs(own - hidden).max(axis=1) > 8).mean() < 0.02


def test_a_legend_and_the_popover_are_there(shots):
    pictures, _ = shots
    # The bar of the legend is at the lower edge: its ends are the darkest purple and yellow.
    lower = pictures['contribution'][-260:].reshape(-1, 3).astype(int)
    for end in ((68, 1, 84), (253, 231, 37)):
        assert (np.abs(lower - end).max(axis=1) < 16).sum() > 20
    assert (pictures['popover'] != pictures['densified']).any(-1).sum() > 20_000
