# SPDX-License-Identifier: GPL-3.0-or-later
"""Collect for Training in a window on a virtual screen: Esc, once more, and that the window is as before."""

from pathlib import Path

import bpy
import pytest

import screen

STEPS = Path(__file__).resolve().parent / 'collect_steps.py'


@pytest.fixture(scope='module')
def shots(tmp_path_factory):
    folder = tmp_path_factory.mktemp('window')
    return screen.run_steps(STEPS, folder, bpy.app.binary_path, options=('--enable-event-simulate',)), folder


def test_escape_leaves_everything_and_what_was_rendered(shots):
    (pictures, facts, text), _ = shots
    assert 'Traceback' not in text
    assert facts['rendering_after_undo'] and facts['cancelled'] == facts['before']
    assert facts['files_after_cancel'] == ['images', 'unfinished.json']
    height = pictures['before'].shape[0]
    status = slice(height - 20, height)
    assert (pictures['before'][status] != pictures['rendering'][status]).any(-1).sum() > 100


def test_the_menu_shows_it(shots):
    pictures = shots[0][0]
    assert (pictures['before'] != pictures['menu']).any(-1).sum() > 10_000


def test_the_next_one_ends_and_leaves_the_file_as_it_was(shots):
    (_, facts, _), folder = shots
    assert facts['done'] == facts['before'] and facts['folder_done'] == facts['before']
    assert sorted(path.name for path in (folder / 'out').iterdir()) == ['Armature', 'Quad', 'rigged']
    for asset in (folder / 'out').iterdir():
        assert len(list((asset / 'images').iterdir())) == 8
