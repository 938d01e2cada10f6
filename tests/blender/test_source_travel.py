# SPDX-License-Identifier: GPL-3.0-or-later
"""Sources follow their .blend: first save, Save As, Save Copy, append, link, undo, packing; nothing gets lost."""

import errno
import logging
import os
import shutil

import bpy
import numpy as np
import pytest

import scenes
import series
from test_files import write_ply
from test_splat_data import assert_equal, make_arrays

COUNT = 200


@pytest.fixture
def paths(stipple):
    return stipple.scene.source.source_paths


@pytest.fixture
def cache(paths):
    """The folder for sources of files that are not saved yet, empty."""
    folder = paths.cache_folder()
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    return folder


def imported(stipple, path, name='in'):
    """A splat object of a file of its own."""
    path.mkdir(exist_ok=True)
    write_ply(stipple, path / f'{name}.ply', make_arrays(stipple, COUNT, degree=0))
    assert bpy.ops.stipple.splats_import(filepath=str(path / f'{name}.ply'), up_axis='Z') == {'FINISHED'}
    return bpy.context.object


def all_kinds(stipple, folder):
    """Splats as they are, with a budget, and made from a mesh; the latter two in files that we write."""
    cloud = imported(stipple, folder)
    tree = imported(stipple, folder, 'tree')
    scenes.select(tree)
    assert bpy.ops.stipple.add_budget() == {'FINISHED'}
    model = scenes.make_splats(scenes.quad(), anchors=COUNT)
    return cloud.name, tree.name, model.name


def save(path, **options):
    path.parent.mkdir(parents=True, exist_ok=True)
    assert bpy.ops.wm.save_as_mainfile(filepath=str(path), **options) == {'FINISHED'}


def reopen(path):
    bpy.ops.wm.open_mainfile(filepath=str(path))


def decodes(stipple, *names):
    """Checks that sources are there and are read: each at half its budget and back."""
    for name in names:
        data = bpy.data.objects[name].data
        assert stipple.scene.source.sources.state(data) == 'FINE', (name,
                                                                    stipple.scene.source.source_paths.file_of(data))
        stipple.scene.source.decoded.forget()
        assert stipple.scene.source.decoded.full_cloud(data).info().count == COUNT


def stored(*names):
    return [bpy.data.objects[name].data.stipple.source_file.filepath for name in names]


def renders(tmp_path, name):
    """F12 of what is there shows splats."""
    scenes.camera(location=(0, 0, 9))
    bpy.context.scene.render.engine, bpy.context.scene.render.film_transparent = 'STIPPLE', True
    return scenes.render_pixels(tmp_path, name)[..., 3].max() > 0.3


# ---- saving -------------------------------------------------------------------------------------

def test_the_first_save_brings_cached_sources_along(stipple, tmp_path, cache):
    names = all_kinds(stipple, tmp_path / 'scans')
    assert len(os.listdir(cache)) == 2
    save(tmp_path / 'a' / 'shot.blend')
    assert not any(file.is_dirty for file in bpy.data.images)  # Blender would ask to save them
    assert stored(*names) == ['//../scans/in.ply', '//stipple/tree.stipple.safetensors',
                              '//stipple/Quad Splats.stipple.safetensors']
    assert not (tmp_path / 'a' / 'shot.blend1').exists()
    assert [bpy.data.objects[name].data.stipple.source for name in names] == stored(*names)
    decodes(stipple, *names)
    shutil.rmtree(cache)
    os.makedirs(cache)
    # The project moves to another place, or another machine.
    os.rename(tmp_path / 'a', tmp_path / 'b')
    reopen(tmp_path / 'b' / 'shot.blend')
    decodes(stipple, *names)
    assert renders(tmp_path, 'moved')


def test_save_as_elsewhere_and_a_copy(stipple, tmp_path, cache, monkeypatch):
    save(tmp_path / 'a' / 'shot.blend')
    names = all_kinds(stipple, tmp_path / 'scans')
    before = stored(*names)
    assert before[1:] == ['//stipple/tree.stipple.safetensors', '//stipple/Quad Splats.stipple.safetensors']
    save(tmp_path / 'c' / 'd' / 'copy.blend', copy=True)
    assert stored(*names) == before  # this file goes on as it was
    decodes(stipple, *names)
    made = []
    monkeypatch.setattr(stipple.scene.source.decoded, 'decode_data', lambda *_: made.append(1))
    save(tmp_path / 'b' / 'shot.blend')
    assert stored(*names)[1] == '//../a/stipple/tree.stipple.safetensors'
    stipple.scene.source.sync.sync_all()
    for path in ('b/shot.blend', 'c/d/copy.blend'):
        reopen(tmp_path / path)
        assert not made  # what is stored is known to be of the same source
    monkeypatch.undo()
    for path in ('b/shot.blend', 'c/d/copy.blend'):
        reopen(tmp_path / path)
        decodes(stipple, *names)
        assert renders(tmp_path, 'elsewhere')


def test_a_copy_of_an_unsaved_file(stipple, tmp_path, cache):
    names = all_kinds(stipple, tmp_path / 'scans')
    save(tmp_path / 'c' / 'copy.blend', copy=True)
    assert not bpy.data.filepath and stored(*names)[1] == os.path.join(cache, 'tree.stipple.safetensors')
    decodes(stipple, *names)
    reopen(tmp_path / 'c' / 'copy.blend')
    decodes(stipple, *names)


def test_undo_after_save_as(stipple, tmp_path, cache):
    save(tmp_path / 'a' / 'shot.blend')
    names = all_kinds(stipple, tmp_path / 'a' / 'scans')
    bpy.ops.ed.undo_push(message='all')
    bpy.data.objects[names[0]].location.x = 1
    bpy.ops.ed.undo_push(message='moved')
    save(tmp_path / 'b' / 'shot.blend')
    for _ in range(2):
        bpy.ops.ed.undo_push(message='saved')
    for _ in range(3):
        bpy.ops.ed.undo()
    decodes(stipple, *names)
    assert stored(*names)[1] == '//../a/stipple/tree.stipple.safetensors'
    bpy.ops.ed.redo()
    decodes(stipple, *names)


def test_a_disk_that_is_full_loses_nothing(stipple, tmp_path, cache, monkeypatch, caplog):
    names = all_kinds(stipple, tmp_path / 'scans')

    def full(_, to):
        with open(to, 'wb') as file:
            file.write(b'half')
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(shutil, 'copyfile', full)
    with caplog.at_level(logging.ERROR, 'stipple'):
        save(tmp_path / 'a' / 'shot.blend')
    assert [r.message.count('No space left on device') for r in caplog.records] == [1, 1]  # one for each source
    assert 'stays where it is' in caplog.text
    assert not [name for _, _, files in os.walk(tmp_path / 'a') for name in files if name != 'shot.blend']
    decodes(stipple, *names)
    reopen(tmp_path / 'a' / 'shot.blend')
    decodes(stipple, *names)
    monkeypatch.undo()
    save(tmp_path / 'a' / 'again.blend')
    reopen(tmp_path / 'a' / 'again.blend')
    decodes(stipple, *names)


def test_paths_stay_absolute_for_who_wants_them_so(stipple, tmp_path, cache):
    filepaths = bpy.context.preferences.filepaths
    filepaths.use_relative_paths = False
    try:
        save(tmp_path / 'a' / 'shot.blend')
        names = all_kinds(stipple, tmp_path / 'scans')
        assert all(map(os.path.isabs, stored(*names)))
        save(tmp_path / 'b' / 'shot.blend')
        assert all(map(os.path.isabs, stored(*names)))
        decodes(stipple, *names)
    finally:
        filepaths.use_relative_paths = True


# ---- append and link ----------------------------------------------------------------------------

@pytest.fixture
def library(stipple, tmp_path, cache):
    """A file with splats of all kinds, and their names."""
    save(tmp_path / 'lib' / 'props.blend')
    names = all_kinds(stipple, tmp_path / 'lib' / 'scans')
    save(tmp_path / 'lib' / 'props.blend')
    return tmp_path / 'lib' / 'props.blend', names


def take(path, names, link, where):
    """The objects of a library in a new file, saved first at `where` or not at all."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    if where is not None:
        save(where)
    operator = bpy.ops.wm.link if link else bpy.ops.wm.append
    for name in names:
        operator(filepath=str(path / 'Object' / name), directory=str(path / 'Object') + '/', filename=name)
    bpy.context.view_layer.update()
    # Blender makes objects of appended data that could be one and is none.
    assert not [obj.name for obj in bpy.data.objects if obj.name.startswith('.')]


@pytest.mark.parametrize('is_saved', [True, False])
@pytest.mark.parametrize('link', [False, True])
def test_append_and_link(stipple, tmp_path, library, link, is_saved):
    path, names = library
    take(path, names, link, tmp_path / 'x' / 'y' / 'shot.blend' if is_saved else None)
    decodes(stipple, *names)
    assert renders(tmp_path, 'before')
    save(tmp_path / 'z' / 'other.blend')
    reopen(tmp_path / 'z' / 'other.blend')
    decodes(stipple, *names)
    assert renders(tmp_path, 'after')
    if not link:
        assert all(name.startswith('//../lib/') for name in stored(*names))


def test_linked_splats_that_are_made_local_need_no_library(stipple, tmp_path, library):
    path, names = library
    take(path, names, True, tmp_path / 'x' / 'shot.blend')
    scenes.select(*(bpy.data.objects[name] for name in names))
    bpy.ops.object.make_local(type='SELECT_OBDATA')
    decodes(stipple, *names)
    save(tmp_path / 'z' / 'other.blend')
    assert all(file.library is None for file in bpy.data.images if file.users)
    reopen(tmp_path / 'z' / 'other.blend')
    os.rename(path, tmp_path / 'lib' / 'old.blend')
    reopen(tmp_path / 'z' / 'other.blend')
    assert all(bpy.data.objects[name].data.library is None for name in names)
    decodes(stipple, *names)


def test_overrides_of_linked_splats_have_their_source(stipple, tmp_path, library):
    path, names = library
    take(path, names[1:2], True, tmp_path / 'x' / 'shot.blend')
    linked = bpy.data.objects[names[1]]
    linked.override_create(remap_local_usages=True)
    obj = next(o for o in bpy.data.objects if o.library is None and o.name == names[1])
    obj.data.override_create(remap_local_usages=True)
    assert obj.data.override_library is not None
    assert stipple.scene.source.sources.state(obj.data) == 'FINE'
    save(tmp_path / 'z' / 'other.blend')
    reopen(tmp_path / 'z' / 'other.blend')
    obj = next(o for o in bpy.data.objects if o.library is None and o.name == names[1])
    assert obj.data.override_library is not None
    assert stipple.scene.source.sources.state(obj.data) == 'FINE'


def test_files_of_versions_that_kept_a_text(stipple, tmp_path, library, monkeypatch):
    """Opened, linked and appended. The library must still be there, in a file that knows where it is."""
    path, names = library
    sync = stipple.scene.source.sync
    for name in names:
        data = bpy.data.objects[name].data
        known = sync.source_paths.identity(data.stipple)
        data[sync.WRITTEN_KEY] = data[sync.WRITTEN_KEY].replace(known, data.stipple.source)
        data.stipple.source_file = None
    monkeypatch.setattr(stipple.scene.source.source_travel, 'follow_texts', lambda: None)
    save(path)
    monkeypatch.undo()
    made = []
    monkeypatch.setattr(stipple.scene.source.decoded, 'decode_data', lambda *_: made.append(1))
    reopen(path)
    monkeypatch.undo()
    assert not made and all(file.startswith('//') for file in stored(*names))
    decodes(stipple, *names)
    take(path, names, True, tmp_path / 'x' / 'shot.blend')
    assert bpy.data.objects[names[0]].data.stipple.source_file is None
    decodes(stipple, *names)
    take(path, names, False, tmp_path / 'x' / 'shot.blend')
    decodes(stipple, *names)


# ---- Blender's own menu -------------------------------------------------------------------------

def test_external_data(stipple, tmp_path, cache):
    """Relative, absolute, report, find, pack and unpack are Blender's own."""
    save(tmp_path / 'a' / 'shot.blend')
    names = all_kinds(stipple, tmp_path / 'scans')
    bpy.ops.file.make_paths_absolute()
    assert all(map(os.path.isabs, stored(*names)))
    bpy.ops.file.make_paths_relative()
    assert all(path.startswith('//') for path in stored(*names))
    os.rename(tmp_path / 'scans', tmp_path / 'gone')
    assert stipple.scene.source.sources.state(bpy.data.objects['in'].data) == 'MISSING'
    bpy.ops.file.find_missing_files(directory=str(tmp_path / 'gone'))
    decodes(stipple, *names)
    bpy.ops.file.pack_all()
    save(tmp_path / 'b' / 'shot.blend')
    shutil.rmtree(tmp_path / 'a')
    shutil.rmtree(tmp_path / 'gone')
    reopen(tmp_path / 'b' / 'shot.blend')
    decodes(stipple, *names)
    assert renders(tmp_path, 'packed')
    bpy.ops.file.unpack_all(method='WRITE_LOCAL')
    save(tmp_path / 'b' / 'shot.blend')
    reopen(tmp_path / 'b' / 'shot.blend')
    assert all(path.startswith('//textures/') for path in stored(*names))
    assert all(file.packed_file is None for file in bpy.data.images)
    decodes(stipple, *names)


def test_a_missing_source_is_said_once_when_a_file_is_opened(stipple, tmp_path, caplog):
    save(tmp_path / 'a' / 'shot.blend')
    imported(stipple, tmp_path / 'scans')
    save(tmp_path / 'a' / 'shot.blend')
    shutil.rmtree(tmp_path / 'scans')
    with caplog.at_level(logging.WARNING, 'stipple'):
        reopen(tmp_path / 'a' / 'shot.blend')
        bpy.data.objects['in'].location.x = 1
        bpy.data.meshes.new('another')
        bpy.context.view_layer.update()
        save(tmp_path / 'b' / 'shot.blend')
    assert [('in.ply' in r.message, 'is missing' in r.message) for r in caplog.records] == [(True, True)]


# ---- collect ------------------------------------------------------------------------------------

def test_collect_makes_a_folder_that_can_be_sent(stipple, tmp_path, cache):
    save(tmp_path / 'a' / 'shot.blend')
    names = all_kinds(stipple, tmp_path / 'scans')
    swarm = series.load(series.write(stipple, tmp_path / 'frames', range(1, 4)))
    scenes.select(bpy.data.objects['in'])
    (tmp_path / 'sog').mkdir()
    assert bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'sog' / 'meta.json')) == {'FINISHED'}
    (tmp_path / 'sog' / 'unrelated.txt').write_text('not of the source')
    bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'sog' / 'meta.json'))
    sog = bpy.context.object
    write_ply(stipple, tmp_path / 'a' / 'stipple' / 'in.ply', make_arrays(stipple, 7))  # another file of that name
    assert bpy.ops.stipple.collect_sources() == {'FINISHED'}
    assert bpy.ops.stipple.collect_sources() == {'FINISHED'}  # nothing is left to do
    assert stored(*names) == ['//stipple/in.001.ply', '//stipple/tree.stipple.safetensors',
                              '//stipple/Quad Splats.stipple.safetensors']
    assert stored(swarm.name, sog.name) == ['//stipple/swarm/swarm_0001.ply', '//stipple/sog/meta.json']
    assert sorted(os.listdir(tmp_path / 'a' / 'stipple' / 'swarm')) == [f'swarm_000{i}.ply' for i in (1, 2, 3)]
    assert not (tmp_path / 'a' / 'stipple' / 'sog' / 'unrelated.txt').exists()
    before = stipple.scene.source.splat_data.read(sog.data)
    names, sog_name, swarm_name = (*names, sog.name), sog.name, swarm.name
    save(tmp_path / 'a' / 'shot.blend')
    for folder in ('scans', 'frames', 'sog'):
        shutil.rmtree(tmp_path / folder)
    os.rename(tmp_path / 'a', tmp_path / 'sent')
    reopen(tmp_path / 'sent' / 'shot.blend')
    decodes(stipple, *names)
    assert_equal(stipple.scene.source.splat_data.read(bpy.data.objects[sog_name].data), before)
    bpy.context.scene.frame_set(3)
    assert series.centre(stipple, bpy.data.objects[swarm_name]) == 2


def test_collect_refuses_without_a_folder_and_survives_a_full_disk(stipple, tmp_path, monkeypatch):
    names = (imported(stipple, tmp_path / 'scans').name, imported(stipple, tmp_path / 'more', 'other').name)
    scenes.refuses(bpy.ops.stipple.collect_sources, 'save it first')
    save(tmp_path / 'a' / 'shot.blend')
    before = stored(*names)
    copy = shutil.copyfile

    def second_fails(old, to):
        copy(old, to)
        if 'other' in old:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(shutil, 'copyfile', second_fails)
    scenes.refuses(bpy.ops.stipple.collect_sources, 'No space left on device')
    assert stored(*names) == before and os.listdir(tmp_path / 'a' / 'stipple') == ['in.ply']
    decodes(stipple, *names)


def test_objects_that_share_a_source(stipple, tmp_path):
    """A copy of a datablock, and another import of the same file: one path, until one of them is relinked."""
    save(tmp_path / 'a' / 'shot.blend')
    first = imported(stipple, tmp_path / 'a')
    copy = scenes.link(first.copy())
    copy.data = first.data.copy()
    again = imported(stipple, tmp_path / 'a')
    assert len([file for file in bpy.data.images if file.users]) == 1
    shutil.copy(tmp_path / 'a' / 'in.ply', tmp_path / 'a' / 'new.ply')
    scenes.select(copy)
    assert bpy.ops.stipple.relink(filepath=str(tmp_path / 'a' / 'new.ply')) == {'FINISHED'}
    assert stored(first.name, copy.name, again.name) == ['//in.ply', '//new.ply', '//in.ply']
    np.testing.assert_array_equal(stipple.scene.source.splat_data.read(copy.data).positions,
                                  stipple.scene.source.splat_data.read(first.data).positions)
