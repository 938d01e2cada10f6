# SPDX-License-Identifier: GPL-3.0-or-later
"""Series of splat files: timing, budgets, reading ahead, gaps."""

import os
import subprocess

import bpy
import numpy as np
import pytest

import scenes
import series
from test_splat_data import assert_equal


@pytest.fixture
def folder(stipple, tmp_path):
    return series.write(stipple, tmp_path / 'swarm')


@pytest.fixture
def swarm(folder):
    return series.load(folder)


def shown(stipple, obj, frames):
    """The series' frame that each scene frame shows, None for nothing."""
    found = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        centre = series.centre(stipple, obj)
        found.append(None if centre is None else centre + 1)
    return found


# ---- import -------------------------------------------------------------------------------------

def test_one_file_stands_for_its_series(stipple, swarm):
    settings = swarm.data.stipple
    assert swarm.name == 'swarm' and settings.is_sequence and settings.frame_duration == 10
    assert len(bpy.data.objects) == 1 and settings.sequence_mode == 'CLIP' and settings.frame_start == 1
    assert shown(stipple, swarm, range(1, 11)) == list(range(1, 11))


def test_chosen_files_are_one_series_and_others_stay_single(stipple, folder):
    series.write(stipple, folder, [1, 2], 'other{}.ply')
    files = [{'name': name} for name in ('swarm_0005.ply', 'swarm_0003.ply', 'swarm_0004.ply', 'other2.ply')]
    os.remove(folder / 'other1.ply')
    assert bpy.ops.stipple.splats_import(directory=str(folder), files=files, as_sequence=True) == {'FINISHED'}
    assert sorted(o.name for o in bpy.data.objects) == ['other2', 'swarm']
    settings = bpy.data.objects['swarm'].data.stipple
    assert settings.frame_duration == 3 and settings.source.endswith('swarm_0003.ply')
    assert not bpy.data.objects['other2'].data.stipple.is_sequence
    assert shown(stipple, bpy.data.objects['swarm'], (1, 2, 3)) == [3, 4, 5]


def test_without_the_option_numbered_files_are_objects(folder):
    files = [{'name': f'swarm_{i:04d}.ply'} for i in (1, 2)]
    assert bpy.ops.stipple.splats_import(directory=str(folder), files=files) == {'FINISHED'}
    assert len(bpy.data.objects) == 2 and not any(o.data.stipple.is_sequence for o in bpy.data.objects)


@pytest.mark.parametrize('name', ['swarm9_{}.ply', '{:03d}.ply', 'a{}b.ply', 'swarm_{:04d}.compressed.ply', 's.{}.spz',
                                  'swarm_{:04d}.sog'])
def test_names_of_series(stipple, tmp_path, name):
    folder = series.write(stipple, tmp_path / 'swarm', range(8, 12), name)
    obj = series.load(folder, name.format(8))
    assert obj.data.stipple.frame_duration == 4
    assert shown(stipple, obj, range(1, 5)) == [8, 9, 10, 11]


def test_folders_of_a_format_whose_file_name_is_fixed(stipple, tmp_path):
    for frame in (1, 2, 3):
        (tmp_path / f'swarm_{frame}').mkdir()
        series.write(stipple, tmp_path, [frame], f'swarm_{frame}/meta.json')
    obj = series.load(tmp_path, 'swarm_1/meta.json')
    assert obj.data.stipple.frame_duration == 3
    assert shown(stipple, obj, (1, 3, 2)) == [1, 3, 2]


# ---- timing -------------------------------------------------------------------------------------

@pytest.mark.parametrize('mode, expected', [
    ('CLIP', [None, None, 1, 2, 3, 4, None, None, None]), ('EXTEND', [1, 1, 1, 2, 3, 4, 4, 4, 4]),
    ('REPEAT', [3, 4, 1, 2, 3, 4, 1, 2, 3]), ('PING_PONG', [3, 2, 1, 2, 3, 4, 3, 2, 1])])
def test_modes(stipple, swarm, mode, expected):
    settings = swarm.data.stipple
    settings.frame_duration, settings.sequence_mode = 4, mode
    assert shown(stipple, swarm, range(-1, 8)) == expected
    assert shown(stipple, swarm, range(7, -2, -1)) == expected[::-1]  # backwards, too


@pytest.mark.parametrize('mode', ['CLIP', 'EXTEND', 'REPEAT', 'PING_PONG'])
@pytest.mark.parametrize('start, offset, duration', [(1, 0, 4), (3, 2, 4), (-2, 1, 1), (1, 0, 2)])
def test_timing_is_that_of_blenders_own_volumes(stipple, swarm, mode, start, offset, duration, tmp_path):
    """Volume.grids.frame is what Blender itself computes from properties of the same names."""
    if mode == 'PING_PONG' and duration == 1:
        swarm.data.stipple.frame_duration, swarm.data.stipple.sequence_mode = 1, mode
        assert stipple.scene.sequence.sequences.local_frame(swarm.data.stipple, 7) == 1
        return  # Blender divides by zero here
    settings = swarm.data.stipple
    volume = bpy.data.volumes.new('volume')
    volume.filepath = str(tmp_path / 'any_0001.vdb')
    volume.is_sequence = settings.is_sequence = True
    for owner in (volume, settings):
        owner.frame_start, owner.frame_offset, owner.frame_duration = start, offset, duration
        owner.sequence_mode = mode
    obj = scenes.link(bpy.data.objects.new('volume', volume))
    nothing = 2 ** 31 - 1
    for frame in range(-6, 14):
        bpy.context.scene.frame_set(frame)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        grids = obj.evaluated_get(depsgraph).data.grids
        grids.load()
        local = stipple.scene.sequence.sequences.local_frame(settings, frame)
        assert (nothing if local is None else local + offset) == grids.frame, frame


@pytest.mark.parametrize('speed, expected', [(0.5, [1, 1, 2, 2, 3, 3]), (2.0, [1, 3, 5, 7, 9, None]),
                                             (1 / 3, [1, 1, 1, 2, 2, 2]), (-1.0, [1, None, None, None, None, None])])
def test_speed(stipple, swarm, speed, expected):
    swarm.data.stipple.frame_speed = speed
    assert shown(stipple, swarm, range(1, 7)) == expected


def test_backward_in_a_loop_start_and_offset(stipple, swarm):
    settings = swarm.data.stipple
    settings.frame_speed, settings.sequence_mode = -1.0, 'REPEAT'
    assert shown(stipple, swarm, range(1, 5)) == [1, 10, 9, 8]
    settings.frame_speed, settings.frame_start, settings.frame_duration = 1.0, 5, 3
    assert shown(stipple, swarm, (4, 5, 6, 7, 8)) == [3, 1, 2, 3, 1]
    settings.frame_offset = 4
    assert shown(stipple, swarm, (5, 7)) == [5, 7]


def test_keyframes_of_the_offset_time_the_series(stipple, swarm):
    settings = swarm.data.stipple
    settings.sequence_mode, settings.frame_duration = 'EXTEND', 1
    for frame, offset in ((1, 9), (10, 0)):
        settings.frame_offset = offset
        settings.keyframe_insert('frame_offset', frame=frame)
    assert shown(stipple, swarm, (1, 10)) == [10, 1]


def test_jumps_and_the_same_frame_again(stipple, swarm):
    assert shown(stipple, swarm, (1, 9, 2, 2, 10, 1)) == [1, 9, 2, 2, 10, 1]


def test_undo_save_and_reload(stipple, swarm, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    assert shown(stipple, swarm, (4,)) == [4]
    bpy.ops.ed.undo_push(message='before')
    swarm.data.stipple.frame_start = 3
    assert series.centre(stipple, swarm) == 1
    bpy.ops.ed.undo_push(message='after')
    bpy.ops.ed.undo()
    swarm = bpy.data.objects['swarm']
    assert swarm.data.stipple.frame_start == 1 and series.centre(stipple, swarm) == 3
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'a.blend'))
    swarm = bpy.data.objects['swarm']
    assert series.centre(stipple, swarm) == 3 and swarm.data.stipple.frame_duration == 10
    assert shown(stipple, swarm, (8,)) == [8]


def test_several_objects_share_files(stipple, swarm, folder):
    series.load(folder)
    other = bpy.context.object
    other.data.stipple.frame_start = 3
    twin = scenes.link(bpy.data.objects.new('twin', swarm.data))
    bpy.context.scene.frame_set(6)
    assert (series.centre(stipple, swarm), series.centre(stipple, twin), series.centre(stipple, other)) == (5, 5, 3)
    read = [key[0] for key in stipple.scene.sequence.sequences._entries]
    assert len(read) == len(set(read))


def test_linked_series_follow_frames(stipple, swarm, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'library.blend'))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(tmp_path / 'library.blend'), link=True) as (there, here):
        here.objects = there.objects
    linked = scenes.link(here.objects[0])
    assert linked.library is not None
    assert shown(stipple, linked, (1, 7, 3)) == [1, 7, 3]


# ---- budgets ------------------------------------------------------------------------------------

def test_budget_by_ratio_and_count_in_each_frame(stipple, swarm):
    settings = swarm.data.stipple
    count = stipple.scene.source.splat_data.count
    settings.ratio = 0.25
    assert shown(stipple, swarm, (1, 5)) == [1, 5] and count(swarm.data) == series.COUNT // 4
    settings.anchors, settings.budget_by = 7, 'COUNT'
    assert count(swarm.data) == 7
    bpy.context.scene.frame_set(6)
    assert count(swarm.data) == 7
    settings.anchors = 10 * series.COUNT
    assert count(swarm.data) == series.COUNT


def test_a_plain_budget_keeps_the_same_splats_in_every_frame(stipple, swarm, folder):
    swarm.data.stipple.ratio = 0.25
    kept = []
    for frame in (1, 8):
        bpy.context.scene.frame_set(frame)
        positions = stipple.scene.source.splat_data.read(swarm.data).positions
        whole = stipple.binding.cloud.Cloud.load(stipple.scene.source.sources.context(),
                                                 str(folder / f'swarm_{frame:04d}.ply')).read().positions
        kept.append([int(np.flatnonzero((whole == p).all(axis=1))[0]) for p in positions])
    assert kept[0] == kept[1] and len(set(kept[0])) == series.COUNT // 4


def test_keyframed_budget(stipple, swarm):
    settings = swarm.data.stipple
    for frame, ratio in ((1, 0.1), (5, 0.5)):
        settings.ratio = ratio
        settings.keyframe_insert('ratio', frame=frame)
    for frame in (1, 5, 3):
        bpy.context.scene.frame_set(frame)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        ratio = swarm.data.evaluated_get(depsgraph).stipple.ratio
        assert stipple.scene.source.splat_data.count(swarm.data) == round(series.COUNT * ratio)
    assert 0.1 < ratio < 0.5


def test_prepared_budgets_are_cuts_of_a_tree_for_each_frame(stipple, swarm, folder, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    before = stipple.scene.source.splat_data.read(swarm.data)
    scenes.select(swarm)
    assert bpy.ops.stipple.prepare_budgets() == {'FINISHED'}
    settings = swarm.data.stipple
    assert settings.source_kind == 'TREE' and settings.is_sequence and settings.source.startswith('//stipple')
    assert len(list((tmp_path / 'stipple' / 'swarm').iterdir())) == 10
    assert_equal(stipple.scene.source.splat_data.read(swarm.data), before)  # a whole budget is the file's own splats
    settings.ratio = 0.5
    assert shown(stipple, swarm, (1, 10, 4)) == [1, 10, 4]
    assert stipple.scene.source.splat_data.count(swarm.data) == series.COUNT // 2
    cut = stipple.binding.model.Model.load(stipple.scene.source.sources.context(), str(
        tmp_path / 'stipple' / 'swarm' / 'swarm_0004.stipple.safetensors')).decode(
            stipple.binding.model.DecodeSettings(series.COUNT // 2)).read()
    assert_equal(stipple.scene.source.splat_data.read(swarm.data), cut)
    assert not bpy.ops.stipple.prepare_budgets.poll()


def test_a_cancelled_or_failed_preparation_changes_nothing(stipple, swarm, folder, tmp_path, monkeypatch):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    scenes.select(swarm)
    (folder / 'swarm_0006.ply').write_bytes(b'broken')
    scenes.refuses(bpy.ops.stipple.prepare_budgets, 'swarm_0006.ply')
    advance, seen = stipple.jobs.Task.advance, []

    def cancel_at_the_third(self, fraction, stage):
        seen.append(stage)
        if len(seen) == 3:
            self.cancel()
        advance(self, fraction, stage)

    monkeypatch.setattr(stipple.jobs.Task, 'advance', cancel_at_the_third)
    assert bpy.ops.stipple.prepare_budgets() == {'CANCELLED'}
    assert swarm.data.stipple.source_kind == 'CLOUD' and shown(stipple, swarm, (2,)) == [2]
    assert not (tmp_path / 'stipple').exists() or not list((tmp_path / 'stipple').iterdir())


def test_edits_of_one_file_are_refused(stipple, swarm):
    scenes.select(swarm)
    for operator in (bpy.ops.stipple.delete_floaters, bpy.ops.stipple.apply_transform):
        scenes.refuses(operator, "'swarm' is a series of files")
    assert not bpy.ops.stipple.add_budget.poll()
    assert bpy.ops.stipple.use_as_new_source() == {'FINISHED'}
    assert not swarm.data.stipple.is_sequence
    assert shown(stipple, swarm, (5,)) == [1]


# ---- reading ahead ------------------------------------------------------------------------------

def names(stipple):
    return [os.path.basename(key[0]) for key in stipple.scene.sequence.sequences._entries]


def test_next_files_are_read_ahead_the_way_it_plays(stipple, swarm):
    sequences = stipple.scene.sequence.sequences
    sequences.forget()
    bpy.context.scene.frame_set(5)
    assert sorted(names(stipple)) == [f'swarm_{i:04d}.ply' for i in (5, 6, 7, 8, 9)]
    bpy.context.scene.frame_set(4)
    assert {'swarm_0003.ply', 'swarm_0002.ply', 'swarm_0001.ply'} <= set(names(stipple))
    for entry in sequences._entries.values():
        if entry.job is not None:
            entry.job.wait()
    assert shown(stipple, swarm, (3, 2)) == [3, 2]


def test_loops_read_ahead_over_their_ends(stipple, swarm):
    stipple.scene.sequence.sequences.forget()
    swarm.data.stipple.sequence_mode = 'REPEAT'
    bpy.context.scene.frame_set(10)
    assert {'swarm_0010.ply', 'swarm_0001.ply', 'swarm_0002.ply'} <= set(names(stipple))


def test_cache_keeps_its_size(stipple, swarm, monkeypatch):
    sequences = stipple.scene.sequence.sequences
    each = series.COUNT * 14 * 4
    for limit, ahead, most in ((3 * each + 100, 4, 3), (0, 4, 1), (1 << 30, 0, 10)):
        sequences.forget()
        monkeypatch.setattr(sequences, '_limits', lambda: (limit, ahead))
        for frame in range(1, 11):
            bpy.context.scene.frame_set(frame)
            assert series.centre(stipple, swarm) == frame - 1
            assert len(sequences._entries) <= most
            for entry in sequences._entries.values():
                if entry.job is not None:
                    entry.job.wait()
        if ahead == 0:
            assert len(sequences._entries) == 10  # all fit, each read once


def test_a_file_that_changes_is_read_again(stipple, swarm, folder):
    bpy.context.scene.frame_set(1)
    (folder / 'swarm_0003.ply').write_bytes((folder / 'swarm_0009.ply').read_bytes())
    os.utime(folder / 'swarm_0003.ply', (1, 1))
    assert shown(stipple, swarm, (3,)) == [9]


def test_a_broken_file_ahead_stops_nothing_before_its_frame(stipple, swarm, folder):
    (folder / 'swarm_0004.ply').write_bytes(b'ply\nbroken')
    stipple.scene.sequence.sequences.forget()
    assert shown(stipple, swarm, (2, 3)) == [2, 3]
    assert shown(stipple, swarm, (4,)) == [3]  # what was there stays
    assert 'swarm_0004.ply' in stipple.scene.source.sync.problems[swarm.data.name]
    assert shown(stipple, swarm, (5,)) == [5]
    assert swarm.data.name not in stipple.scene.source.sync.problems


# ---- gaps ---------------------------------------------------------------------------------------

def test_a_gap_is_said_in_the_window_and_can_be_held(stipple, swarm, folder):
    os.remove(folder / 'swarm_0005.ply')
    os.remove(folder / 'swarm_0006.ply')
    assert shown(stipple, swarm, (4, 5)) == [4, 4]
    assert stipple.scene.source.sync.problems[swarm.data.name] == (
        f"File '{folder / 'swarm_0005.ply'}' of the series 'swarm' is missing.")
    swarm.data.stipple.missing_frames = 'HOLD'
    assert swarm.data.name not in stipple.scene.source.sync.problems
    assert shown(stipple, swarm, (6, 7, 5)) == [4, 7, 4]
    os.remove(folder / 'swarm_0001.ply')
    bpy.context.scene.frame_set(1)
    assert 'swarm_0001.ply' in stipple.scene.source.sync.problems[swarm.data.name]


# ---- renders ------------------------------------------------------------------------------------

def test_f12_shows_the_frame(stipple, swarm, tmp_path):
    scene = bpy.context.scene
    scene.render.engine, scene.render.film_transparent = 'STIPPLE', True
    for frame in (7, 2):
        camera = series.camera(frame - 1)
        scene.frame_set(frame)
        picture = scenes.render_pixels(tmp_path)
        assert picture[20:28, 20:28, 3].min() > 0.5
        straight = picture[24, 24, :3] / picture[24, 24, 3]
        share = (frame - 1) / 9
        # Display values to light; 1e-2 for splats of one colour in single precision, half transparent.
        expected = [((v + 0.055) / 1.055) ** 2.4 if v > 0.04045 else v / 12.92 for v in (1 - share, 0.2, share)]
        np.testing.assert_allclose(straight, expected, atol=1e-2)
        bpy.data.objects.remove(camera)


def test_f12_outside_of_a_clip_is_an_empty_picture_and_no_error(stipple, swarm, tmp_path):
    scene = bpy.context.scene
    scene.render.engine, scene.render.film_transparent = 'STIPPLE', True
    series.camera()
    scene.frame_set(20)
    assert scenes.render_pixels(tmp_path)[..., 3].max() == 0


def background(tmp_path, engine, *arguments, script=''):
    """A Blender of its own renders the saved file; returns (exit code, output)."""
    scene = bpy.context.scene
    scene.render.engine = engine
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    scene.render.image_settings.file_format = 'PNG'
    scene.render.filepath = str(tmp_path / 'out_')
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    (tmp_path / 'enable.py').write_text("import bpy\nbpy.ops.preferences.addon_enable(module='stipple')\n" + script)
    done = subprocess.run([bpy.app.binary_path, '--background', '--factory-startup', str(tmp_path / 'a.blend'),
                           '--python', str(tmp_path / 'enable.py'), *arguments], env=os.environ, timeout=120,
                          capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def written(tmp_path):
    return sorted(p.name for p in tmp_path.glob('out_*'))


STORED = '''
import sys
package = sys.modules['stipple']
def note(scene, *_):
    arrays = package.scene.source.splat_data.read(bpy.data.objects['swarm'].data)
    print('STORED', scene.frame_current, round(float(arrays.positions[:, 0].mean())) + 1, flush=True)
bpy.app.handlers.render_post.append(note)
'''


@pytest.mark.parametrize('engine', ['STIPPLE', 'CYCLES'])
def test_animation_in_background(stipple, swarm, tmp_path, engine):
    series.camera(4.5)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 3, 5
    code, output = background(tmp_path, engine, '--render-anim', script=STORED)
    assert code == 0, output
    assert written(tmp_path) == [f'out_000{i}.png' for i in (3, 4, 5)]
    if engine == 'CYCLES':
        stored = [line.split()[1:] for line in output.splitlines() if line.startswith('STORED')]
        assert stored == [['3', '3'], ['4', '4'], ['5', '5']]


@pytest.mark.parametrize('engine', ['STIPPLE', 'CYCLES'])
def test_a_gap_fails_its_frame_in_background(stipple, swarm, folder, tmp_path, engine):
    series.camera(4.5)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 3, 5
    os.remove(folder / 'swarm_0004.ply')
    code, output = background(tmp_path, engine, '--render-anim')
    assert code == 1, output
    assert written(tmp_path) == ['out_0003.png']
    lines = [line for line in output.splitlines() if 'swarm_0004.ply' in line]
    assert len(lines) == 1 and 'error' in lines[0].lower() and 'is missing' in lines[0], output
