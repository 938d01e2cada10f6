# SPDX-License-Identifier: GPL-3.0-or-later
"""Series of files inside the .blend: all files or none."""

import os
import shutil

import bpy
import pytest

import scenes
import series
from test_source_travel import reopen, save

COUNT = 4


@pytest.fixture
def swarm(stipple, tmp_path):
    """A series in a saved file; its folder is `frames`, two folders up from anywhere the tests save."""
    save(tmp_path / 'a' / 'shot.blend')
    return series.load(series.write(stipple, tmp_path / 'frames', range(1, COUNT + 1)))


def shown(stipple, name='swarm'):
    """Which frame of the series each frame of the scene shows, read from its files."""
    found = []
    for frame in range(1, COUNT + 1):
        stipple.scene.sequence.sequences.forget()
        bpy.context.scene.frame_set(frame)
        found.append(series.centre(stipple, bpy.data.objects[name]) + 1)
    return found


def packed():
    return sorted(file.name for file in bpy.data.images if file.packed_file is not None)


NAMES = [f'.swarm_{i:04d}.ply' for i in range(1, COUNT + 1)]
EVERY = list(range(1, COUNT + 1))


def test_a_packed_series_needs_none_of_its_files(stipple, tmp_path, swarm):
    assert bpy.ops.stipple.pack_series() == {'FINISHED'}
    assert packed() == NAMES
    assert bpy.ops.stipple.pack_series() == {'FINISHED'}  # nothing is left to do
    assert packed() == NAMES
    save(tmp_path / 'b' / 'c' / 'shot.blend')
    shutil.rmtree(tmp_path / 'frames')
    reopen(tmp_path / 'b' / 'c' / 'shot.blend')
    assert stipple.scene.source.sources.state(bpy.data.objects['swarm'].data) == 'FINE'
    assert shown(stipple) == EVERY
    save(tmp_path / 'd' / 'shot.blend')  # without the files nothing is lost
    assert packed() == NAMES
    reopen(tmp_path / 'd' / 'shot.blend')
    assert shown(stipple) == EVERY


@pytest.mark.parametrize('method', ['WRITE_LOCAL', 'WRITE_ORIGINAL'])
def test_unpack_brings_every_file_back(stipple, tmp_path, swarm, method):
    bpy.ops.stipple.pack_series()
    save(tmp_path / 'b' / 'shot.blend')
    contents = [path.read_bytes() for path in sorted((tmp_path / 'frames').iterdir())]
    shutil.rmtree(tmp_path / 'frames')
    reopen(tmp_path / 'b' / 'shot.blend')
    bpy.ops.file.unpack_all(method=method)
    folder = tmp_path / 'b' / 'textures' if method == 'WRITE_LOCAL' else tmp_path / 'frames'
    assert [path.read_bytes() for path in sorted(folder.iterdir())] == contents
    save(tmp_path / 'b' / 'shot.blend')
    assert not packed() and not bpy.data.objects['swarm'].data.stipple.series_files
    reopen(tmp_path / 'b' / 'shot.blend')
    assert shown(stipple) == EVERY
    assert [file.name for file in bpy.data.images if file.name.startswith('.')] == NAMES[:1]


def test_pack_resources_never_packs_a_part(stipple, tmp_path, swarm):
    bpy.ops.file.pack_all()
    assert not packed()
    bpy.ops.file.unpack_all(method='WRITE_LOCAL')
    assert shown(stipple) == EVERY


def test_a_file_that_packs_by_itself_packs_series(stipple, tmp_path, swarm):
    bpy.ops.file.autopack_toggle()
    try:
        save(tmp_path / 'a' / 'shot.blend')
    finally:
        bpy.data.use_autopack = False
    shutil.rmtree(tmp_path / 'frames')
    reopen(tmp_path / 'a' / 'shot.blend')
    bpy.data.use_autopack = False
    assert packed() == NAMES and shown(stipple) == EVERY


def test_files_of_versions_that_packed_the_first(stipple, tmp_path, swarm):
    """The rest is packed when the file is saved, as long as it is there."""
    swarm.data.stipple.source_file.source = stipple.scene.source.source_paths.FILE
    bpy.ops.file.pack_all()
    assert packed() == NAMES[:1]
    save(tmp_path / 'a' / 'shot.blend')
    shutil.rmtree(tmp_path / 'frames')
    reopen(tmp_path / 'a' / 'shot.blend')
    assert packed() == NAMES and shown(stipple) == EVERY


def test_files_that_came_after_packing_are_packed_by_the_next_save(stipple, tmp_path, swarm):
    os.rename(tmp_path / 'frames' / 'swarm_0004.ply', tmp_path / 'later.ply')
    bpy.ops.stipple.pack_series()
    assert packed() == NAMES[:3]
    os.rename(tmp_path / 'later.ply', tmp_path / 'frames' / 'swarm_0004.ply')
    save(tmp_path / 'a' / 'shot.blend')
    assert packed() == NAMES


def test_objects_of_one_series_share_what_is_packed(stipple, tmp_path, swarm):
    copy = scenes.link(swarm.copy())
    copy.data = swarm.data.copy()
    copy.name = 'copy'
    bpy.ops.stipple.pack_series()
    assert packed() == NAMES
    save(tmp_path / 'a' / 'shot.blend')
    shutil.rmtree(tmp_path / 'frames')
    reopen(tmp_path / 'a' / 'shot.blend')
    assert shown(stipple) == EVERY and shown(stipple, 'copy') == EVERY


@pytest.mark.parametrize('link', [False, True])
def test_a_packed_series_of_another_file(stipple, tmp_path, swarm, link):
    bpy.ops.stipple.pack_series()
    save(tmp_path / 'a' / 'shot.blend')
    shutil.rmtree(tmp_path / 'frames')
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    save(tmp_path / 'x' / 'shot.blend')
    operator = bpy.ops.wm.link if link else bpy.ops.wm.append
    folder = str(tmp_path / 'a' / 'shot.blend' / 'Object')
    operator(filepath=f'{folder}/swarm', directory=folder + '/', filename='swarm')
    bpy.context.view_layer.update()
    save(tmp_path / 'x' / 'shot.blend')
    reopen(tmp_path / 'x' / 'shot.blend')
    data = bpy.data.objects['swarm'].data
    assert len(stipple.scene.source.source_paths.packed_files(data)) == COUNT
    assert stipple.scene.source.sources.state(data) == 'FINE'
    if not link:
        assert shown(stipple) == EVERY


def test_what_cannot_be_packed_is_refused_whole(stipple, tmp_path, swarm, monkeypatch):
    packing = stipple.scene.source.source_packing
    monkeypatch.setattr(packing, '_MAX_FILE_BYTES', 100)
    scenes.refuses(bpy.ops.stipple.pack_series, 'has 4 files, one of them has')
    monkeypatch.undo()
    monkeypatch.setattr(packing, '_memory', lambda: 100)
    scenes.refuses(bpy.ops.stipple.pack_series, 'choose Collect Splat Sources instead')
    monkeypatch.undo()
    assert not packed() and shown(stipple) == EVERY
    sog = tmp_path / 'sog_0001'
    sog.mkdir()
    scenes.select(swarm)
    bpy.ops.stipple.splats_export(filepath=str(sog / 'meta.json'))
    swarm.data.stipple.source = str(sog / 'meta.json')
    scenes.refuses(bpy.ops.stipple.pack_series, 'files in several folders')
    assert not packed()


def test_without_a_series_nothing_is_packed():
    scenes.refuses(bpy.ops.stipple.pack_series, 'come from a series')
