# SPDX-License-Identifier: GPL-3.0-or-later
"""Sources that are gone or have changed, a library that is missing, no extent, no memory, cancel: nothing is lost."""

import os

import bpy
import numpy as np
import pytest

import scenes
import series
from test_bad_input import unchanged  # noqa: F401 (a fixture)
from test_edits import box
from test_files import write_ply
from test_sequence import background, written
from test_splat_data import assert_equal, make_arrays

COUNT = 300


@pytest.fixture(params=['CLOUD', 'TREE', 'MODEL'])
def splats(request, stipple, tmp_path):
    """(object, path of its source) of each kind of source."""
    return make(stipple, tmp_path, request.param)


def make(stipple, tmp_path, kind, count=COUNT):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    if kind == 'MODEL':
        obj = scenes.make_splats(scenes.quad(), anchors=count)
    else:
        arrays = make_arrays(stipple, count, degree=0)
        arrays.scales *= np.float32(0.2)
        write_ply(stipple, tmp_path / 'in.ply', arrays)
        bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'in.ply'), up_axis='Z')
        obj = bpy.context.object
        if kind == 'TREE':
            assert bpy.ops.stipple.add_budget() == {'FINISHED'}
    scenes.select(obj)
    assert obj.data.stipple.source_kind == kind
    path = stipple.scene.source.source_paths.file_of(obj.data)
    assert stipple.scene.source.sources.state(obj.data) == 'FINE'
    return obj, path


def change(path):
    """Other content of the same length: its last byte, which is of a number, differs."""
    with open(path, 'r+b') as file:
        file.seek(-1, os.SEEK_END)
        last = file.read(1)
        file.seek(-1, os.SEEK_END)
        file.write(bytes([last[0] ^ 1]))
    os.utime(path, (2, 2))


def read(stipple, obj):
    return stipple.scene.source.splat_data.read(obj.data)


class Layout:
    """What a panel draws, as text."""

    def __init__(self):
        self.texts = []

    def label(self, text, icon='NONE'):
        self.texts.append(text)

    def operator(self, name, text='', icon='NONE'):
        self.texts.append(name)
        self.asked = type('Settings', (), {})()
        return self.asked

    def column(self, align=False):
        return self


def drawn(stipple, obj):
    layout = Layout()
    stipple.panels.source_state.draw(layout, obj.data)
    return layout.texts


# ---- missing and changed, in the window ---------------------------------------------------------

def test_a_missing_source_is_said_and_relinked(stipple, splats, tmp_path):
    obj, path = splats
    before = read(stipple, obj)
    moved = str(tmp_path / ('moved' + ('.ply' if path.endswith('.ply') else '.stipple.safetensors')))
    os.rename(path, moved)
    assert drawn(stipple, obj) == ['Source file is missing', 'stipple.relink', 'stipple.use_as_new_source']
    assert_equal(read(stipple, obj), before)
    assert bpy.ops.stipple.relink(filepath=moved) == {'FINISHED'}
    assert stipple.scene.source.source_paths.file_of(obj.data) == moved and drawn(stipple, obj) == []
    assert_equal(read(stipple, obj), before)


def test_a_changed_source_is_said_and_read_again(stipple, splats):
    obj, path = splats
    before = read(stipple, obj)
    os.utime(path, (1, 1))
    assert drawn(stipple, obj) == []  # the same bytes at another time are the same file
    change(path)
    assert drawn(stipple, obj) == ['Source file has changed', 'stipple.relink', 'stipple.relink',
                                   'stipple.use_as_new_source']
    assert_equal(read(stipple, obj), before)
    if obj.data.stipple.source_kind == 'TREE':  # a flipped byte breaks a tree: another one takes its place
        binding, native = stipple.binding, stipple.scene.source.sources.context()
        cloud = binding.cloud.Cloud.create(native, make_arrays(stipple, COUNT, degree=0))
        job = binding.model.Model.from_cloud_start(native, cloud)
        job.wait()
        binding.model.Model.of_job(job).save(path)
    assert bpy.ops.stipple.relink(again=True) == {'FINISHED'}
    assert drawn(stipple, obj) == []
    if obj.data.stipple.source_kind == 'TREE':
        np.testing.assert_allclose(read(stipple, obj).scales, 5 * before.scales, rtol=1e-4)
    if obj.data.stipple.source_kind == 'CLOUD':
        assert not np.array_equal(read(stipple, obj).sh, before.sh) or not np.array_equal(
            read(stipple, obj).rotations, before.rotations)


@pytest.mark.parametrize('how', ['gone', 'changed'])
def test_a_slider_does_not_mix_old_and_new_sources(stipple, tmp_path, how):
    obj, path = make(stipple, tmp_path, 'TREE')
    before = read(stipple, obj)
    os.remove(path) if how == 'gone' else change(path)
    obj.data.stipple.ratio = 0.5
    assert 'choose Relink' in stipple.scene.source.sync.problems[obj.data.name]
    assert_equal(read(stipple, obj), before)


def test_use_as_new_source_keeps_what_is_stored(stipple, splats):
    obj, path = splats
    before = read(stipple, obj)
    os.remove(path)
    assert bpy.ops.stipple.use_as_new_source() == {'FINISHED'}
    assert drawn(stipple, obj) == []
    assert_equal(read(stipple, obj), before)


# ---- relink -------------------------------------------------------------------------------------

def test_relink_keeps_budget_and_mask(stipple, tmp_path):
    obj, path = make(stipple, tmp_path, 'TREE')
    scenes.select(obj, box(size=1.0))
    assert bpy.ops.stipple.crop_by_box() == {'FINISHED'}
    obj.data.stipple.ratio = 0.5
    before, counts = read(stipple, obj), stipple.scene.source.masks.counts(obj.data)
    assert counts[0] == COUNT > counts[1]
    os.rename(path, tmp_path / 'b.stipple.safetensors')
    scenes.select(obj)
    assert bpy.ops.stipple.relink(filepath=str(tmp_path / 'b.stipple.safetensors')) == {'FINISHED'}
    assert stipple.scene.source.masks.counts(obj.data) == counts and obj.data.stipple.ratio == 0.5
    assert_equal(read(stipple, obj), before)
    obj.data.stipple.ratio = 1.0
    assert stipple.scene.source.splat_data.count(obj.data) == counts[1]


def test_relink_refuses_another_count_unless_told(stipple, tmp_path):
    obj, _ = make(stipple, tmp_path, 'CLOUD')
    scenes.select(obj, box(size=1.0))
    bpy.ops.stipple.crop_by_box()
    scenes.select(obj)
    before = read(stipple, obj)
    write_ply(stipple, tmp_path / 'other.ply', make_arrays(stipple, 40))
    call = lambda **more: bpy.ops.stipple.relink(filepath=str(tmp_path / 'other.ply'), **more)
    scenes.refuses(call, f"has 40 splats; the source of 'in' had {COUNT}")
    assert obj.data.stipple.source.endswith('in.ply') and stipple.scene.source.masks.counts(obj.data) is not None
    assert_equal(read(stipple, obj), before)
    assert call(other_count=True) == {'FINISHED'}
    assert stipple.scene.source.splat_data.count(obj.data) == 40 and stipple.scene.source.masks.counts(obj.data) is None


@pytest.mark.parametrize('content, text', [(None, 'bad.ply'), (b'ply\nbroken', 'bad.ply')])
def test_relink_to_a_file_that_cannot_be_read_changes_nothing(stipple, splats, tmp_path, content, text):
    obj, path = splats
    before = read(stipple, obj)
    if content is not None:
        (tmp_path / 'bad.ply').write_bytes(content)
    scenes.refuses(lambda: bpy.ops.stipple.relink(filepath=str(tmp_path / 'bad.ply')), text)
    assert stipple.scene.source.source_paths.file_of(obj.data) == path
    assert_equal(read(stipple, obj), before)


def test_relink_refuses_a_model_of_the_other_kind(stipple, tmp_path):
    obj, _ = make(stipple, tmp_path, 'TREE')
    other = scenes.make_splats(scenes.quad(), anchors=20)
    path = stipple.scene.source.source_paths.file_of(other.data)
    scenes.select(obj)
    scenes.refuses(lambda: bpy.ops.stipple.relink(filepath=path), 'holds splats of a mesh')


def test_relink_keeps_what_was_edited_by_hand(stipple, tmp_path):
    obj, path = make(stipple, tmp_path, 'CLOUD')
    scale = obj.data.attributes['scale'].data
    scale[0].vector = (9, 9, 9)
    os.rename(path, tmp_path / 'moved.ply')
    assert bpy.ops.stipple.relink(filepath=str(tmp_path / 'moved.ply')) == {'FINISHED'}
    assert read(stipple, obj).scales[0, 0] == 9


def test_a_series_is_relinked_with_its_timing(stipple, tmp_path):
    obj = series.load(series.write(stipple, tmp_path / 'swarm', range(1, 5)))
    obj.data.stipple.frame_start, obj.data.stipple.sequence_mode = 2, 'REPEAT'
    os.rename(tmp_path / 'swarm', tmp_path / 'moved')
    bpy.context.scene.frame_set(4)
    assert 'swarm_0003.ply' in stipple.scene.source.sync.problems[obj.data.name]
    scenes.select(obj)
    scenes.refuses(lambda: bpy.ops.stipple.relink(filepath=str(tmp_path / 'none.ply')), 'has no number')
    assert bpy.ops.stipple.relink(filepath=str(tmp_path / 'moved' / 'swarm_0001.ply')) == {'FINISHED'}
    assert obj.data.name not in stipple.scene.source.sync.problems and series.centre(stipple, obj) == 2
    assert (obj.data.stipple.frame_start, obj.data.stipple.frame_duration) == (2, 4)


# ---- in background ------------------------------------------------------------------------------

def prepare_render():
    scenes.camera((0, 0, 6), width=16, height=16)
    bpy.context.scene.render.film_transparent = True


@pytest.mark.parametrize('how', ['gone', 'changed'])
def test_a_frame_fails_with_one_line_and_no_picture(stipple, splats, tmp_path, how):
    obj, path = splats
    prepare_render()
    os.remove(path) if how == 'gone' else change(path)
    code, output = background(tmp_path, 'STIPPLE', '--render-frame', '1')
    assert code == 1 and written(tmp_path) == [], output
    lines = [line for line in output.splitlines() if os.path.basename(path) in line]
    assert len(lines) == 1 and 'error' in lines[0].lower(), output
    assert ('is missing' if how == 'gone' else 'has changed') in lines[0]


@pytest.mark.parametrize('kind, how', [('CLOUD', 'gone'), ('TREE', 'changed')])
def test_with_cycles_too(stipple, tmp_path, kind, how):
    _, path = make(stipple, tmp_path, kind)
    prepare_render()
    os.remove(path) if how == 'gone' else change(path)
    code, output = background(tmp_path, 'CYCLES', '--render-frame', '1')
    assert code == 1 and written(tmp_path) == [], output
    assert len([line for line in output.splitlines() if os.path.basename(path) in line]) == 1, output


def test_a_source_that_is_fine_renders(stipple, splats, tmp_path):
    prepare_render()
    code, output = background(tmp_path, 'STIPPLE', '--render-frame', '1')
    assert code == 0 and written(tmp_path) == ['out_0001.png'], output


def test_a_missing_library_fails_the_frame(stipple, tmp_path, monkeypatch):
    make(stipple, tmp_path, 'CLOUD')
    prepare_render()
    monkeypatch.setenv('STIPPLE_LIBRARY', str(tmp_path / 'libstipple.so'))
    code, output = background(tmp_path, 'STIPPLE', '--render-frame', '1')
    assert code == 1 and written(tmp_path) == [], output
    assert len([line for line in output.splitlines() if 'libstipple.so' in line]) == 1, output


# ---- no library ---------------------------------------------------------------------------------

def test_a_missing_library_is_said_by_panel_and_operators(stipple, tmp_path, monkeypatch, unchanged):  # noqa: F811
    obj, _ = make(stipple, tmp_path, 'CLOUD')
    unchanged()
    path = tmp_path / 'libstipple.so'
    monkeypatch.setenv('STIPPLE_LIBRARY', str(path))
    assert drawn(stipple, obj) == ['The Stipple library is missing', 'preferences.addon_show']
    for name in ('splats_from_mesh', 'splats_import', 'splats_export', 'splats_to_volume', 'add_budget', 'relink',
                 'delete_floaters', 'merge_splats'):
        operator = getattr(bpy.ops.stipple, name)
        assert not operator.poll()
        scenes.refuses(operator, 'The Stipple library')
    # A file that is there but does not load is tried once, and then known.
    path.write_text('no library')
    scenes.refuses(lambda: bpy.ops.stipple.splats_import(filepath='a.ply'), 'cannot be loaded')
    assert not bpy.ops.stipple.splats_import.poll()
    assert 'cannot be loaded' in stipple.scene.source.sources.library_problem()
    monkeypatch.undo()
    assert bpy.ops.stipple.splats_import.poll() and drawn(stipple, obj) == []


# ---- no extent ----------------------------------------------------------------------------------

def test_an_object_scaled_to_zero_is_left_out_and_others_render(stipple, tmp_path):
    square = scenes.quad()
    obj = scenes.make_splats(square, anchors=5000)
    flat = scenes.link(bpy.data.objects.new('flat', obj.data))
    scenes.camera((0, 0, 6), width=20, height=20, type='ORTHO', ortho_scale=3.0)
    scene = bpy.context.scene
    scene.render.engine, scene.render.film_transparent = 'STIPPLE', True
    flat.hide_render = True
    expected = scenes.render_pixels(tmp_path, 'without')
    flat.hide_render = False
    for scale in ((0, 0, 0), (1, 0, 1)):
        flat.scale = scale
        np.testing.assert_array_equal(scenes.render_pixels(tmp_path, 'with'), expected)
    warned = []
    stipple.scene.instances.gather(bpy.context.evaluated_depsgraph_get(), 'RENDER', warned.append)
    assert warned == ["Splat object 'flat' is scaled to zero; it is left out."]


def test_operators_name_an_object_scaled_to_zero(stipple, tmp_path, unchanged):  # noqa: F811
    obj, _ = make(stipple, tmp_path, 'CLOUD')
    other = scenes.make_splats(scenes.quad(), anchors=20)
    cutter, empty = scenes.sphere(), box()
    obj.scale = (0, 0, 0)
    bpy.context.view_layer.update()
    before = read(stipple, obj)
    scenes.select(obj)
    unchanged()
    ops = bpy.ops.stipple
    for call in (lambda: ops.splats_export(filepath=str(tmp_path / 'out.ply')),
                 lambda: ops.splats_to_volume(filepath=str(tmp_path / 'out.vdb'), resolution=8),
                 ops.apply_transform, ops.level_to_ground):
        scenes.refuses(call, "Object 'in' is scaled to zero")
    for others, call in (([other], ops.merge_splats), ([cutter], ops.crop_by_mesh), ([empty], ops.crop_by_box)):
        scenes.select(obj, *others)
        scenes.refuses(call, "Object 'in' is scaled to zero")
    scenes.select(obj)
    unchanged()
    assert_equal(read(stipple, obj), before)
    assert not list(tmp_path.glob('out*'))


# ---- no memory ----------------------------------------------------------------------------------

@pytest.fixture
def one_mebibyte(stipple):
    """From its call on, native work has 1 MiB."""
    chosen = stipple.preferences.get()

    def limit():
        chosen.memory_limit = 1
        stipple.scene.source.decoded.forget()

    yield limit
    chosen.memory_limit = 0
    stipple.scene.source.decoded.forget()


def test_work_beyond_the_memory_limit_is_refused(stipple, tmp_path, one_mebibyte, unchanged):  # noqa: F811
    many = make_arrays(stipple, 30_000, degree=0)  # 1.7 MB
    write_ply(stipple, tmp_path / 'in.ply', many)
    write_ply(stipple, tmp_path / 'in_1.ply', many)
    bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'in.ply'))
    obj = bpy.context.object
    scenes.select(obj)
    before = read(stipple, obj)
    one_mebibyte()
    unchanged()
    ops = bpy.ops.stipple
    for call in (lambda: ops.splats_import(filepath=str(tmp_path / 'in.ply')),
                 lambda: ops.splats_import(filepath=str(tmp_path / 'in_1.ply'), as_sequence=True),
                 ops.add_budget, lambda: ops.relink(again=True)):
        scenes.refuses(call, 'the memory limit is 1.00 MiB')
    scenes.refuses(lambda: ops.splats_to_volume(filepath=str(tmp_path / 'out.vdb'), resolution=512),
                   '1 MiB are allowed')
    assert_equal(read(stipple, obj), before)
    assert not list(tmp_path.glob('out*'))


def test_a_frame_of_a_series_beyond_the_memory_limit(stipple, tmp_path, one_mebibyte):
    obj = series.load(series.write(stipple, tmp_path / 'swarm', range(1, 3), count=30_000))
    one_mebibyte()
    stipple.scene.sequence.sequences.forget()
    bpy.context.scene.frame_set(2)
    assert 'memory limit' in stipple.scene.source.sync.problems[obj.data.name]
    assert series.centre(stipple, obj) == 0


def test_a_picture_beyond_the_memory_limit_is_one_error(stipple, tmp_path, one_mebibyte):
    make(stipple, tmp_path, 'MODEL')
    scenes.camera(width=4000, height=4000)
    bpy.context.scene.render.engine = 'STIPPLE'
    one_mebibyte()
    scenes.refuses(lambda: scenes.render_pixels(tmp_path, 'large'), 'limit')
    assert not (tmp_path / 'large.exr').exists()


# ---- cancel -------------------------------------------------------------------------------------

@pytest.fixture
def cancelled(stipple, monkeypatch):
    """Cancels every task at its first step, and every native job the moment it has started. Work on 20,000
    splats takes longer than that; reading them does not, so there are more of them to read."""
    start, advance = stipple.binding.job.Job.__init__, stipple.jobs.Task.advance

    def started(self, *arguments, **options):
        start(self, *arguments, **options)
        self.cancel()

    def cancel_first(self, fraction, stage):
        self.cancel()
        advance(self, fraction, stage)

    monkeypatch.setattr(stipple.binding.job.Job, '__init__', started)
    monkeypatch.setattr(stipple.jobs.Task, 'advance', cancel_first)


@pytest.mark.parametrize('phase', ['import', 'sequence', 'make', 'budget', 'volume', 'export', 'relink', 'crop'])
def test_cancel_in_any_phase(stipple, tmp_path, unchanged, request, phase):  # noqa: F811
    obj, path = make(stipple, tmp_path, 'CLOUD', 1_000_000 if phase == 'relink' else 20_000)
    for i in (1, 2):
        write_ply(stipple, tmp_path / f'n_{i}.ply', make_arrays(stipple, 20_000))
    quad, ball = scenes.quad(), scenes.sphere()
    swarm = series.load(tmp_path, 'n_1.ply')
    scenes.select(*{'make': [quad], 'crop': [obj, ball], 'sequence': [swarm]}.get(phase, [obj]))
    before = read(stipple, obj)
    request.getfixturevalue('cancelled')
    unchanged()
    ops = bpy.ops.stipple
    call = {'import': lambda: ops.splats_import(filepath=path),
            'sequence': lambda: ops.splats_to_volume(filepath=str(tmp_path / 'out.vdb'), frames='SERIES'),
            'make': lambda: ops.splats_from_mesh(anchors=100_000), 'budget': ops.add_budget,
            'volume': lambda: ops.splats_to_volume(filepath=str(tmp_path / 'out.vdb'), resolution=256),
            'export': lambda: ops.splats_export(filepath=str(tmp_path / 'out.ply')),
            'relink': lambda: ops.relink(again=True), 'crop': ops.crop_by_mesh}[phase]
    assert call() == {'CANCELLED'}
    assert_equal(read(stipple, obj), before)
    assert not list(tmp_path.glob('out*')) and obj.data.stipple.source_kind == 'CLOUD'
