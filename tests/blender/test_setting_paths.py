# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths among a scene's settings stay right where the .blend goes, as those of sources do."""

import os

import bpy
import pytest

from test_source_travel import reopen, save

NAMES = ('dataset', 'report', 'checkpoint')
AT_HOME = ('//photos', '//fit.json', '//fit.safetensors')
FROM_BESIDE = ('//../a/photos', '//../a/fit.json', '//../a/fit.safetensors')


def texts():
    return tuple(getattr(bpy.context.scene.stipple.fit, name) for name in NAMES)


@pytest.fixture
def places(stipple, tmp_path):
    """Asserts where the paths lead."""
    absolute = stipple.scene.source.setting_paths.absolute

    def check(folder='a', base=tmp_path):
        fit = bpy.context.scene.stipple.fit
        assert [absolute(fit, name) for name in NAMES] == [
            str(base / folder / name) for name in ('photos', 'fit.json', 'fit.safetensors')]
    return check


@pytest.fixture
def shot(tmp_path):
    """A saved file with paths from its folder, and what they name."""
    save(tmp_path / 'a' / 'shot.blend')
    (tmp_path / 'a' / 'photos').mkdir()
    (tmp_path / 'a' / 'fit.safetensors').write_bytes(b'state')
    (tmp_path / 'a' / 'fit.json').write_text('{}')
    for name, path in zip(NAMES, AT_HOME):
        setattr(bpy.context.scene.stipple.fit, name, path)
    return tmp_path


def test_save_as_into_another_folder(shot, places):
    save(shot / 'b' / 'other.blend')
    assert texts() == FROM_BESIDE
    places()
    reopen(shot / 'b' / 'other.blend')
    assert texts() == FROM_BESIDE
    places()


def test_save_copy_changes_the_copy_alone(shot, places):
    save(shot / 'b' / 'copy.blend', copy=True)
    assert texts() == AT_HOME
    places()
    reopen(shot / 'b' / 'copy.blend')
    assert texts() == FROM_BESIDE
    places()


def test_paths_are_left_where_remapping_is_off(shot, places):
    save(shot / 'b' / 'other.blend', relative_remap=False)
    assert texts() == AT_HOME
    places('b')
    reopen(shot / 'b' / 'other.blend')
    assert texts() == AT_HOME
    places('b')


def test_a_folder_that_moves_as_a_whole(shot, places):
    save(shot / 'a' / 'shot.blend')
    os.rename(shot / 'a', shot / 'moved')
    reopen(shot / 'moved' / 'shot.blend')
    assert texts() == AT_HOME
    places('moved')


def test_the_first_save_and_absolute_paths(tmp_path, places):
    fit = bpy.context.scene.stipple.fit
    fit.dataset, fit.report, fit.checkpoint = (str(tmp_path / 'a' / path[2:]) for path in AT_HOME)
    save(tmp_path / 'b' / 'shot.blend')  # Blender makes paths relative in a file that had no folder
    assert texts() == FROM_BESIDE
    bpy.ops.file.make_paths_absolute()
    places()
    save(tmp_path / 'c' / 'd' / 'shot.blend')
    assert texts() == tuple(str(tmp_path / 'a' / path[2:]) for path in AT_HOME)
    places()


@pytest.mark.parametrize('link', [False, True])
def test_a_scene_of_another_file(shot, places, link):
    bpy.context.scene.name = 'Taken'
    save(shot / 'a' / 'shot.blend')
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    save(shot / 'x' / 'y' / 'other.blend')
    with bpy.data.libraries.load(str(shot / 'a' / 'shot.blend'), link=link, relative=True) as (_, wanted):
        wanted.scenes = ['Taken']
    bpy.context.window.scene = next(scene for scene in bpy.data.scenes if scene.name == 'Taken')
    places()
    save(shot / 'z' / 'other.blend')
    places()
    if not link:
        assert texts() == FROM_BESIDE
    reopen(shot / 'z' / 'other.blend')
    places()


def test_undo_after_save_as(shot, places):
    bpy.ops.ed.undo_push(message='paths')
    bpy.context.scene.frame_start = 3
    bpy.ops.ed.undo_push(message='frame')
    save(shot / 'b' / 'shot.blend')
    bpy.ops.ed.undo_push(message='saved')
    for _ in range(2):
        bpy.ops.ed.undo()
    assert bpy.context.scene.frame_start != 3
    places()
    assert texts() == FROM_BESIDE


def test_files_of_versions_that_kept_texts_alone(stipple, shot, places, monkeypatch):
    fit = bpy.context.scene.stipple.fit
    for name in NAMES:
        setattr(fit, stipple.scene.source.setting_paths.file_name(name), None)
    monkeypatch.setattr(stipple.scene.source.source_travel, 'follow_texts', lambda: None)
    save(shot / 'a' / 'shot.blend')
    monkeypatch.undo()
    reopen(shot / 'a' / 'shot.blend')
    save(shot / 'b' / 'shot.blend')
    assert texts() == FROM_BESIDE
    places()


def test_nothing_that_a_fit_reads_or_writes_is_packed(shot):
    bpy.ops.file.pack_all()
    assert all(file.packed_file is None for file in bpy.data.images)
    assert not any(file.is_dirty for file in bpy.data.images)


def test_a_path_that_is_cleared_leaves_nothing(shot):
    for name in NAMES:
        setattr(bpy.context.scene.stipple.fit, name, '')
    save(shot / 'b' / 'shot.blend')
    reopen(shot / 'b' / 'shot.blend')
    assert texts() == ('', '', '') and not [file for file in bpy.data.images if file.name.startswith('.')]
