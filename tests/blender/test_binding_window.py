# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats on a mesh in a window on a virtual screen: they follow what somebody does to it, and undo."""

from pathlib import Path

import bpy
import pytest

import screen

STEPS = Path(__file__).resolve().parent / 'binding_steps.py'


@pytest.fixture(scope='module')
def shots(tmp_path_factory):
    folder = tmp_path_factory.mktemp('window')
    return screen.run_steps(STEPS, folder, bpy.app.binary_path)


def differ(pictures, a, b):
    """Pixels of the 3D view that two pictures differ in."""
    height, width = pictures[a].shape[:2]
    view = (slice(height // 10, height * 7 // 10), slice(width // 10, width * 7 // 10))
    return int((pictures[a][view] != pictures[b][view]).any(-1).sum())


def test_splats_follow_what_somebody_changes(shots):
    pictures, facts, text = shots
    assert 'Traceback' not in text
    assert facts['rest_bound'] and not facts['unbound_bound']
    assert facts['rest'] == pytest.approx(0.0, abs=1e-5) and facts['moved'] == pytest.approx(1.5, abs=1e-5)
    assert differ(pictures, 'unbound', 'rest') < 500
    # A line of splats that is seen from its side goes up.
    assert differ(pictures, 'rest', 'moved') > 500


def test_undo_takes_the_binding_back(shots):
    pictures, facts, _ = shots
    assert not facts['undone_bound'] and facts['undone'] == pytest.approx(0.0, abs=1e-5)
    assert differ(pictures, 'undone', 'rest') < 500
    assert facts['redone_bound'] and facts['redone'] == pytest.approx(0.75, abs=1e-5)
