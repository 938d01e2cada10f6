# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh takes another shape in a window on a virtual screen: preview, Esc, one undo step."""

from pathlib import Path

import bpy
import pytest

import screen

STEPS = Path(__file__).resolve().parent / 'adapting_steps.py'


@pytest.fixture(scope='module')
def shots(tmp_path_factory):
    folder = tmp_path_factory.mktemp('window')
    return screen.run_steps(STEPS, folder, bpy.app.binary_path, size=(1280, 1060),
                            options=('--enable-event-simulate',))


def differ(pictures, a, b):
    """Pixels in the middle of the 3D view that two pictures differ in, without menus and panels at its sides."""
    height, width = pictures[a].shape[:2]
    view = (slice(height // 5, height * 6 // 10), slice(width * 3 // 10, width * 5 // 10))
    return int((pictures[a][view] != pictures[b][view]).any(-1).sum())


def test_the_template_is_shown_on_its_way(shots):
    pictures, facts, text = shots
    assert 'Traceback' not in text
    assert facts['before'] == [] and facts['started'] == ['RUNNING_MODAL']
    assert 'STIPPLE_OT_mesh_adapt' not in facts['while_running']
    assert differ(pictures, 'ball', 'running') > 3000


def test_escape_keeps_the_shape_so_far(shots):
    pictures, facts, _ = shots
    assert facts['ended'] == ['Basis', 'Adapted to Head'] and facts['value'] == 1.0
    assert differ(pictures, 'ball', 'kept') > 3000


def test_undo_takes_all_of_it_back_at_once(shots):
    pictures, facts, _ = shots
    assert facts['undone'] == [] and differ(pictures, 'ball', 'undone') < 500


def test_evening_out_runs_beside_the_window_too(shots):
    _, facts, _ = shots
    assert facts['evening'] == ['RUNNING_MODAL'] and facts['evened'] == ['Basis', 'Evened Out']


def test_images_are_chosen_in_a_file_browser(shots):
    pictures, facts, _ = shots
    assert facts['taught'] == ['Basis', 'Adapted to set']
    assert differ(pictures, 'ball', 'from_images') > 3000 and 'browser' in pictures


def test_the_menu_and_the_settings_are_shown(shots):
    pictures, _, _ = shots
    height, width = pictures['ball'].shape[:2]
    whole = {name: picture[:height * 95 // 100, :width * 7 // 10] for name, picture in pictures.items()}
    # Both cover a good part of the 3D view.
    for before, after in (('ball', 'menu'), ('kept', 'settings')):
        assert (whole[before] != whole[after]).any(-1).sum() > 30_000
