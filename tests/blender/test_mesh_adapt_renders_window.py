# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh takes the shape of renders in a window on a virtual screen: dialog, Esc while views are rendered and later, undo,
once more."""

from pathlib import Path

import bpy
import pytest

import screen

STEPS = Path(__file__).resolve().parent / 'adapting_renders_steps.py'


@pytest.fixture(scope='module')
def shots(tmp_path_factory):
    folder = tmp_path_factory.mktemp('window')
    return screen.run_steps(STEPS, folder, bpy.app.binary_path, size=(1280, 1060),
                            options=('--enable-event-simulate',))


def differ(pictures, a, b):
    """Pixels of the 3D view that two pictures differ in, without the panels at its right."""
    height, width = pictures[a].shape[:2]
    view = (slice(height // 20, height * 95 // 100), slice(0, width * 7 // 10))
    return int((pictures[a][view] != pictures[b][view]).any(-1).sum())


def test_the_menu_and_the_settings_are_shown(shots):
    pictures, _, text = shots
    assert 'Traceback' not in text
    assert differ(pictures, 'ball', 'menu') > 30_000 and differ(pictures, 'ball', 'dialog') > 30_000


def test_escape_while_views_are_rendered_changes_nothing(shots):
    _, facts, _ = shots
    names, _, hidden, engine, *_, keys = facts['while_rendering']
    assert 'Stipple View' in names and hidden == ['Ball'] and engine == 'STIPPLE_CAPTURE' and keys == []
    assert facts['cancelled'] == facts['before'] and facts['finished_after_cancel'] == 0


def test_escape_while_it_adapts_keeps_the_shape_so_far(shots):
    pictures, facts, _ = shots
    assert facts['camera_is_gone'] and facts['ended'] == ['Basis', 'Adapted to Flat']
    assert differ(pictures, 'ball', 'adapting') > 20_000 and differ(pictures, 'ball', 'ended') > 20_000


def test_undo_takes_all_of_it_back_at_once(shots):
    assert shots[1]['undone'] == []


def test_the_operator_can_be_repeated(shots):
    """One that is in Blender's list of what was done must not be put there again when it ends: that crashes."""
    facts = shots[1]
    assert facts['once'] == ['Basis', 'Adapted to Flat']
    assert facts['twice'] == ['Basis', 'Adapted to Flat', 'Adapted to Flat.001'] and facts['in_list'] == 1
