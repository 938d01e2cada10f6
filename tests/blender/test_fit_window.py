# SPDX-License-Identifier: GPL-3.0-or-later
"""A fit in a window on a virtual screen: panel, preview while it runs, the decision at its end."""

import json
from pathlib import Path

import bpy
import numpy as np
import pytest

import fit_steps
import screen


@pytest.fixture(scope='module')
def shots(tmp_path_factory):
    folder = tmp_path_factory.mktemp('window')
    pictures, text = screen.run_steps(Path(fit_steps.__file__), folder, bpy.app.binary_path, timeout=500,
                                     size=(1280, 1060))
    return pictures, json.loads((folder / 'facts.json').read_text()), text


def test_the_preview_shows_while_it_runs(shots):
    pictures, facts, _ = shots
    assert facts['previewed_while_running']
    # Left half red, right half blue: both are in the picture of the preview, whose mesh is hidden.
    colours = pictures['running'].reshape(-1, 3).astype(int)
    assert (colours[:, 0] - colours[:, 2] > 80).sum() > 200
    assert (colours[:, 2] - colours[:, 0] > 80).sum() > 200


def test_the_end_is_a_proposal_that_replaces_nothing_until_it_is_accepted(shots):
    _, facts, text = shots
    assert facts['problem'] == '' and facts['psnr'] > 20
    assert facts['proposed'] and facts['source_is_hidden'] and facts['kind'] == 'TREE'
    assert 'Traceback' not in text


def test_the_report_opens_in_an_image_editor(shots):
    pictures, facts, _ = shots
    assert facts['report'] == 'Sphere Fit Report' and facts['windows'] == 2
    # White paper with blue curves covers a good part of the screen.
    shown = pictures['report'].reshape(-1, 3).astype(int)
    assert (shown.min(axis=1) > 250).sum() > 100_000
    assert (np.abs(shown - (0x00, 0x72, 0xb2)).max(axis=1) < 12).sum() > 100


def test_panel_changes_with_what_happens(shots):
    pictures, _, _ = shots
    assert all(np.ptp(pictures[name]) > 100 for name in ('panel', 'running', 'proposed', 'accepted'))
    assert (pictures['panel'] != pictures['proposed']).any() and (pictures['proposed'] != pictures['accepted']).any()
