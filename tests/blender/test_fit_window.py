# SPDX-License-Identifier: GPL-3.0-or-later
"""A fit in a window on a virtual screen: panel, preview while it runs, the decision at its end."""

from pathlib import Path

import bpy
import numpy as np
import pytest

import fit_steps
import screen


@pytest.fixture(scope='module')
def shots(tmp_path_factory):
    folder = tmp_path_factory.mktemp('window')
    return screen.run_steps(Path(fit_steps.__file__), folder, bpy.app.binary_path, timeout=500,
                            size=(1280, 1060), options=('--enable-event-simulate',))


def red_pixels(picture):
    colours = picture.reshape(-1, 3).astype(int)
    return (colours[:, 0] - colours[:, 2] > 80).sum()


def test_views_are_counted_while_they_are_rendered(shots):
    _, facts, _ = shots
    assert facts['said_while_rendering'].startswith('Rendering view ')
    assert facts['said_while_rendering'].endswith('of 12')


def test_the_preview_shows_while_it_runs(shots):
    pictures, facts, _ = shots
    assert facts['previewed_while_running'] and min(facts['estimates']) > 0
    # The red half faces the view; the mesh that the preview stands for is grey in a solid view.
    assert red_pixels(pictures['running']) > 20_000
    assert facts['source_shows'] and red_pixels(pictures['source']) < 5000


def test_escape_keeps_the_best(shots):
    _, facts, text = shots
    assert facts['problem'] == '' and facts['psnr'] > 20 and 'Traceback' not in text
    assert 0 < facts['steps'] < facts['of_steps']


def test_the_end_is_a_proposal_that_replaces_nothing_until_it_is_accepted(shots):
    _, facts, _ = shots
    assert facts['proposed'] and facts['nothing_replaced'] and 100 < facts['count'] <= 3000
    assert facts['discarded'] and not facts['reports_left']
    assert facts['source_is_hidden'] and facts['kind'] == 'TREE' and facts['active'] == 'Sphere Fit'


def test_the_report_opens_in_an_image_editor(shots):
    pictures, facts, _ = shots
    assert facts['report'] == 'Sphere Fit Report' and facts['windows'] == 2
    # White paper with blue curves covers a good part of the screen.
    shown = pictures['report'].reshape(-1, 3).astype(int)
    assert (shown.min(axis=1) > 250).sum() > 100_000
    assert (np.abs(shown - (0x00, 0x72, 0xb2)).max(axis=1) < 12).sum() > 100


def test_panel_changes_with_what_happens(shots):
    pictures, _, _ = shots
    names = ('panel', 'rendering', 'running', 'source', 'proposed', 'accepted')
    assert all(np.ptp(pictures[name]) > 100 for name in names)
    assert all((pictures[a] != pictures[b]).any() for a, b in zip(names, names[1:]))
