# SPDX-License-Identifier: GPL-3.0-or-later
"""Accuracy in a window on a virtual screen: figures and plot in the panels, comparisons, what ends when."""

from pathlib import Path

import bpy
import numpy as np
import pytest

import quality_steps
import screen


@pytest.fixture(scope='module')
def shots(tmp_path_factory):
    folder = tmp_path_factory.mktemp('window')
    return screen.run_steps(Path(quality_steps.__file__), folder, bpy.app.binary_path, size=(1500, 1700))


def panels(shots, name):
    """[H,W,3] of the Properties editor."""
    pictures, facts, _ = shots
    x, y, width, height = facts['panels']
    picture = pictures[name]
    return picture[len(picture) - y - height:len(picture) - y, x:x + width].astype(int)


def test_the_panel_shows_figures_and_plot(shots):
    before, after = panels(shots, 'fresh'), panels(shots, 'figures')
    assert (before != after).any(-1).sum() > 5000
    # The plot is white paper: nothing else in the panels is.
    assert (before.min(axis=-1) > 250).sum() < 2000 < 10_000 < (after.min(axis=-1) > 250).sum()


def test_comparisons_end_and_say_what_they_found(shots):
    """The first opens a window. Blender never ends a modal operator that opens one by itself."""
    _, _, text = shots
    assert 'Traceback' not in text
    assert text.count(' dB)') == 2


def test_pictures_are_shown_in_one_window(shots):
    pictures, facts, _ = shots
    assert facts['windows'] == 2 and facts['shown'] == 'Quality Plot'
    assert np.ptp(pictures['compared']) > 100 and (pictures['compared'] != pictures['plotted']).any()
