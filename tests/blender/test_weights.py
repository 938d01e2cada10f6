# SPDX-License-Identifier: GPL-3.0-or-later
"""The weights folder in Preferences, with the small networks of a golden."""

import sys
from pathlib import Path

import bpy
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import pipeline_weights  # noqa: E402


@pytest.fixture
def chosen(stipple, tmp_path):
    pipeline_weights.split(tmp_path)
    chosen = stipple.preferences.get()
    chosen.weights_folder = str(tmp_path)
    yield chosen
    chosen.weights_folder = ''


def states(stipple):
    return [row['state'].name for row in stipple.scene.generate.weights_table.rows()]


def test_choosing_a_folder_shows_what_it_has(stipple, chosen, tmp_path):
    table = stipple.scene.generate.weights_table
    assert states(stipple) == ['OTHER_SIZE'] * 4
    assert table.is_complete() and not table.notes()
    (tmp_path / 'flow.safetensors').unlink()
    assert bpy.ops.stipple.weights_refresh() == {'FINISHED'}
    assert states(stipple) == ['OTHER_SIZE', 'OTHER_SIZE', 'MISSING', 'OTHER_SIZE']
    assert not table.is_complete()
    assert 'huggingface.co' in table.source()


def test_checked_hashes_stay_known_until_a_file_changes(stipple, chosen, tmp_path):
    table = stipple.scene.generate.weights_table
    assert bpy.ops.stipple.weights_check() == {'FINISHED'}
    hashes = [row['sha256'] for row in table.rows()]
    assert all(len(value) == 64 for value in hashes)
    table.refresh()
    assert [row['sha256'] for row in table.rows()] == hashes
    decoder = tmp_path / 'decoder.safetensors'
    decoder.write_bytes(decoder.read_bytes() + b' ')
    table.refresh()
    assert [row['sha256'] for row in table.rows()] == [*hashes[:3], '']


def test_states_follow_size_and_hash(stipple, chosen):
    table = stipple.scene.generate.weights_table
    row = {'path': 'x', 'size': 5, 'published_size': 5, 'sha256': '', 'published_sha256': 'ab'}
    assert table._state_of(row).name == 'UNCHECKED'
    assert table._state_of(dict(row, sha256='ab')).name == 'PUBLISHED'
    assert table._state_of(dict(row, sha256='cd')).name == 'OTHER_CONTENT'
    assert table._state_of(dict(row, size=4)).name == 'OTHER_SIZE'


def test_without_a_folder_the_operators_are_grey(stipple):
    stipple.preferences.get().weights_folder = ''
    assert stipple.scene.generate.weights_table.rows() == ()
    assert not bpy.ops.stipple.weights_refresh.poll()
    assert not bpy.ops.stipple.weights_check.poll()


def test_a_folder_that_is_gone_is_a_note_and_a_table_of_nonsense_is_empty(stipple, chosen):
    table = stipple.scene.generate.weights_table
    chosen.weights_folder = '/nowhere/at/all'
    assert table.rows() == () and 'cannot be read' in table.notes()[0]
    chosen.weights_table = '[1, 2'
    assert table.rows() == () and table.notes() == ()
