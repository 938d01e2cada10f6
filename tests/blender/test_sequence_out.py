# SPDX-License-Identifier: GPL-3.0-or-later
"""Series of splat files become volume sequences and series of files again."""

import re

import bpy
import numpy as np
import pytest

import scenes
import series
from test_files import assert_close
from test_volume import cycles_shows_volumes


@pytest.fixture
def swarm(stipple, tmp_path):
    obj = series.load(series.write(stipple, tmp_path / 'swarm', range(1, 5)))
    scenes.select(obj)
    return obj


def load(stipple, path):
    return stipple.binding.cloud.Cloud.load(stipple.scene.source.sources.context(), str(path)).read()


def names(folder):
    return sorted(p.name for p in folder.iterdir())


# ---- volumes ------------------------------------------------------------------------------------

def test_a_series_becomes_a_volume_sequence(stipple, swarm, tmp_path):
    settings = swarm.data.stipple
    settings.frame_start, settings.sequence_mode = 3, 'REPEAT'
    out = tmp_path / 'out'
    out.mkdir()
    assert bpy.ops.stipple.splats_to_volume(filepath=str(out / 'v.vdb'), voxel_size=0.1,
                                            frames='SERIES') == {'FINISHED'}
    assert names(out) == [f'v_000{i}.vdb' for i in (1, 2, 3, 4)]
    volume = bpy.data.objects['v'].data
    assert volume.is_sequence and (volume.frame_start, volume.frame_duration, volume.frame_offset,
                                   volume.sequence_mode) == (3, 4, 0, 'REPEAT')
    native = stipple.scene.source.sources.context()
    for i in (1, 4):
        info = stipple.binding.volume.Volume.load(native, str(out / f'v_000{i}.vdb')).info()
        assert abs(info.voxel_size - 0.1) < 1e-6
        assert info.bounds_min[0] < i - 1 < info.bounds_max[0] and info.bounds_max[0] - info.bounds_min[0] < 3
    for frame in (3, 6, 7, 2):
        bpy.context.scene.frame_set(frame)
        grids = bpy.data.objects['v'].evaluated_get(bpy.context.evaluated_depsgraph_get()).data.grids
        grids.load()
        assert grids.frame == series.centre(stipple, swarm) + 1
        assert grids.is_loaded and sorted(g.name for g in grids) == ['color', 'density']


def test_voxels_have_one_size_over_all_frames(stipple, swarm, tmp_path):
    swarm.scale = (2, 2, 2)
    bpy.context.view_layer.update()
    assert bpy.ops.stipple.splats_to_volume(filepath=str(tmp_path / 'v.vdb'), resolution=32, frames='SERIES') == {
        'FINISHED'}
    native = stipple.scene.source.sources.context()
    sizes = {round(stipple.binding.volume.Volume.load(native, str(tmp_path / f'v_000{i}.vdb')).info().voxel_size, 7)
             for i in (1, 2, 3, 4)}
    longest = 2 * np.ptp(series.arrays_of(stipple, 1).positions, axis=0).max()
    assert len(sizes) == 1 and abs(sizes.pop() - longest / 32) < 1e-3


def test_scene_range_keeps_motion_speed_and_budget(stipple, swarm, tmp_path):
    swarm.data.stipple.frame_speed = 0.5
    for frame, height in ((1, 0.0), (6, 5.0)):
        swarm.location.z = height
        swarm.keyframe_insert('location', index=2, frame=frame)
    for curve in scenes_fcurves(swarm):
        for point in curve.keyframe_points:
            point.interpolation = 'LINEAR'
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 2, 9
    scene.frame_set(4)
    assert bpy.ops.stipple.splats_to_volume(filepath=str(tmp_path / 'v.vdb'), voxel_size=0.1, frames='SCENE') == {
        'FINISHED'}
    assert scene.frame_current == 4 and series.centre(stipple, swarm) == 1
    # Frame 9 is after the clip: there is nothing to write.
    assert [p.name for p in sorted(tmp_path.glob('v_*'))] == [f'v_000{i}.vdb' for i in range(2, 9)]
    volume = bpy.data.objects['v'].data
    assert (volume.frame_start, volume.frame_duration, volume.frame_offset) == (2, 8, 1)
    info = stipple.binding.volume.Volume.load(stipple.scene.source.sources.context(),
                                              str(tmp_path / 'v_0005.vdb')).info()
    middle = [(a + b) / 2 for a, b in zip(info.bounds_min, info.bounds_max)]
    assert abs(middle[0] - 2) < 0.3 and abs(middle[2] - 4) < 0.3


def scenes_fcurves(obj):
    """All animation curves of an object; since 5.0 they lie in slots of layered actions."""
    action = obj.animation_data.action
    if bpy.app.version < (5, 0, 0):
        return list(action.fcurves)
    return [curve for layer in action.layers for strip in layer.strips for bag in strip.channelbags
            for curve in bag.fcurves]


def test_cycles_shows_the_frame_of_the_volume_sequence(stipple, swarm, tmp_path):
    if not cycles_shows_volumes():
        pytest.skip('Cycles of this build does not read OpenVDB files')
    bpy.ops.stipple.splats_to_volume(filepath=str(tmp_path / 'v.vdb'), voxel_size=0.1, frames='SERIES')
    swarm.hide_render = True
    scene = bpy.context.scene
    scene.render.engine = 'CYCLES'
    scene.cycles.samples, scene.cycles.use_denoising = 16, False
    scene.render.film_transparent = True
    for frame in (1, 4):
        camera = series.camera(frame - 1)
        scene.frame_set(frame)
        alpha = scenes.render_pixels(tmp_path)[..., 3]
        assert alpha[20:28, 20:28].mean() > 0.5
        assert alpha[:, :4].max() == 0
        bpy.data.objects.remove(camera)


def test_nothing_that_changes_and_no_series(stipple, swarm, tmp_path):
    still = scenes.make_splats(scenes.quad(), anchors=100)
    scenes.select(still)
    scenes.refuses(lambda: bpy.ops.stipple.splats_to_volume(filepath=str(tmp_path / 'v.vdb'), frames='SERIES'),
                   'is no series of files')
    assert not list(tmp_path.glob('v*'))


def test_a_gap_stops_before_anything_is_written(stipple, swarm, tmp_path):
    (tmp_path / 'swarm' / 'swarm_0003.ply').unlink()
    for operator, path in ((bpy.ops.stipple.splats_to_volume, 'v.vdb'), (bpy.ops.stipple.splats_export, 'v.ply')):
        scenes.refuses(lambda: operator(filepath=str(tmp_path / path), frames='SERIES'), 'swarm_0003.ply')
    assert not list(tmp_path.glob('v*')) and len(bpy.data.objects) == 1
    swarm.data.stipple.missing_frames = 'HOLD'
    bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'v.ply'), frames='SERIES')
    assert len(list(tmp_path.glob('v*'))) == 4


@pytest.mark.parametrize('operator, path', [('splats_to_volume', 'v.vdb'), ('splats_export', 'v.ply')])
def test_cancel_leaves_whole_frames_only(stipple, swarm, tmp_path, monkeypatch, operator, path):
    advance = stipple.jobs.Task.advance

    def cancel_at_frame_3(self, fraction, stage):
        if stage == 'Frame 3 of 4':
            self.cancel()
        advance(self, fraction, stage)

    monkeypatch.setattr(stipple.jobs.Task, 'advance', cancel_at_frame_3)
    assert getattr(bpy.ops.stipple, operator)(filepath=str(tmp_path / path), frames='SERIES') == {'CANCELLED'}
    stem, extension = path.split('.')
    assert [p.name for p in sorted(tmp_path.glob('v*'))] == [f'{stem}_0001.{extension}', f'{stem}_0002.{extension}']
    assert len(bpy.data.objects) == 1
    assert series.centre(stipple, swarm) == 0


# ---- files --------------------------------------------------------------------------------------

@pytest.mark.parametrize('name, frame_3', [('out.ply', 'out_0003.ply'), ('out.spz', 'out_0003.spz'),
                                           ('out.compressed.ply', 'out_0003.compressed.ply'),
                                           ('out/meta.json', 'out_0003/meta.json'), ('out.glb', 'out_0003.glb')])
def test_export_again_in_any_format(stipple, swarm, tmp_path, name, frame_3):
    assert bpy.ops.stipple.splats_export(filepath=str(tmp_path / name), frames='SERIES') == {'FINISHED'}
    there = load(stipple, tmp_path / frame_3)
    assert there.count == series.COUNT
    again = series.load(tmp_path, frame_3.replace('3', '1'))
    assert again.data.stipple.frame_duration == 4


def samples(path, name):
    """{frame: number of elements} of an attribute with time samples."""
    text = path.read_text().split(f' {name}.timeSamples = {{', 1)[1].split('\n    }', 1)[0]
    return {int(frame): rows.count('(') for frame, rows in re.findall(r'^        (\d+): \[(.*?)\],?$', text,
                                                                     re.M | re.S)}


def test_a_series_becomes_one_file_of_usd(stipple, swarm, tmp_path):
    render = bpy.context.scene.render
    render.fps, render.fps_base = 30, 1.001
    out = tmp_path / 'out.usda'
    assert bpy.ops.stipple.splats_export(filepath=str(out), frames='SERIES') == {'FINISHED'}
    assert names(tmp_path) == ['out.usda', 'swarm']
    assert samples(out, 'positions') == {frame: series.COUNT for frame in (1, 2, 3, 4)}
    rate = re.search(r'timeCodesPerSecond = ([\d.]+)', out.read_text()).group(1)
    assert abs(float(rate) - 30 / 1.001) < 1e-5  # Blender keeps the base in single precision
    assert bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'each.usdz'), frames='SERIES', one_file=False) == {
        'FINISHED'}
    assert names(tmp_path) == [*(f'each_000{i}.usdz' for i in (1, 2, 3, 4)), 'out.usda', 'swarm']
    # Read as splats, it shows its first frame.
    assert_close(load(stipple, out), load(stipple, tmp_path / 'each_0001.usdz'))


def test_one_file_has_frames_that_show_nothing(stipple, swarm, tmp_path):
    for frame, scale in ((1, 1.0), (2, 0.0), (3, 1.0)):
        swarm.scale = (scale,) * 3
        swarm.keyframe_insert('scale', frame=frame)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 3
    bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'out.usda'), frames='SCENE')
    assert samples(tmp_path / 'out.usda', 'scales') == {1: series.COUNT, 2: 0, 3: series.COUNT}


def test_cancel_leaves_no_part_of_one_file(stipple, swarm, tmp_path, monkeypatch):
    advance = stipple.jobs.Task.advance

    def cancel_at_frame_3(self, fraction, stage):
        if stage == 'Frame 3 of 4':
            self.cancel()
        advance(self, fraction, stage)

    (tmp_path / 'v.usda').write_text('old')
    monkeypatch.setattr(stipple.jobs.Task, 'advance', cancel_at_frame_3)
    assert bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'v.usda'), frames='SERIES') == {'CANCELLED'}
    assert names(tmp_path) == ['swarm', 'v.usda'] and (tmp_path / 'v.usda').read_text() == 'old'


def test_export_writes_the_series_own_splats(stipple, swarm, tmp_path):
    bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'out.ply'), frames='SERIES', up_axis='Z')
    for i in (1, 4):
        assert_close(load(stipple, tmp_path / f'out_000{i}.ply'),
                     load(stipple, tmp_path / 'swarm' / f'swarm_000{i}.ply'))


def test_export_of_the_scene_range_with_a_keyframed_budget(stipple, swarm, tmp_path):
    settings = swarm.data.stipple
    for frame, ratio in ((1, 0.5), (3, 1.0)):
        settings.ratio_render = ratio
        settings.keyframe_insert('ratio_render', frame=frame)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 3
    bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'out.ply'), frames='SCENE', budget='RENDER')
    assert [load(stipple, tmp_path / f'out_000{i}.ply').count for i in (1, 2, 3)] == [30, 45, 60]
    bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'full.ply'), frames='SCENE', budget='FULL')
    assert load(stipple, tmp_path / 'full_0001.ply').count == series.COUNT


def test_export_of_a_model_with_a_keyframed_budget(stipple, tmp_path):
    obj = scenes.make_splats(scenes.quad(), anchors=100)
    for frame, budget in ((1, 100), (2, 300)):
        obj.data.stipple.anchors = budget
        obj.data.stipple.keyframe_insert('anchors', frame=frame)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 2
    scene.frame_set(1)
    bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'out.ply'), frames='SCENE')
    assert [load(stipple, tmp_path / f'out_000{i}.ply').count for i in (1, 2)] == [100, 300]


def test_one_file_of_usd_becomes_a_series_again(stipple, swarm, tmp_path):
    scene = bpy.context.scene
    out = tmp_path / 'walk.usdz'
    bpy.ops.stipple.splats_export(filepath=str(out), frames='SERIES')
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    scene.render.fps = 48
    for number, folder in ((0, 'walk'), (1, 'walk.001')):
        assert bpy.ops.stipple.splats_import(filepath=str(out), as_sequence=True) == {'FINISHED'}
        files = tmp_path / 'stipple' / folder
        assert names(files) == [f'walk_000{i}.ply' for i in (1, 2, 3, 4)]
        settings = bpy.context.object.data.stipple
        assert settings.is_sequence and settings.frame_duration == 4
        assert settings.source.endswith(f'{folder}/walk_0001.ply')
        # Two frames of the scene pass for each of the file, whose first is at 1.
        assert (settings.frame_start, settings.frame_speed) == (2, 0.5)
    assert bpy.context.object.name.startswith('walk')
    for frame, local in ((2, 1), (4, 2), (5, 2), (8, 4)):
        scene.frame_set(frame)
        expected = series.arrays_of(stipple, local)
        shown = stipple.scene.source.splat_data.read(bpy.context.object.data)
        placed = shown.positions @ np.array(bpy.context.object.matrix_world)[:3, :3].T
        np.testing.assert_allclose(placed, expected.positions, atol=1e-5)


def test_one_file_without_the_option_shows_its_first_frame_and_says_so(stipple, swarm, tmp_path, capfd):
    bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'walk.usda'), frames='SERIES')
    capfd.readouterr()
    assert bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'walk.usda')) == {'FINISHED'}
    assert "'walk.usda' holds splats at 4 times, of which the first is shown" in capfd.readouterr().out
    assert not bpy.context.object.data.stipple.is_sequence
    assert stipple.scene.source.splat_data.count(bpy.context.object.data) == series.COUNT


def test_a_split_that_stops_leaves_nothing(stipple, swarm, tmp_path, monkeypatch):
    advance = stipple.jobs.Task.advance
    bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'walk.usda'), frames='SERIES')
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))

    def cancel_at_frame_3(self, fraction, stage):
        if stage == 'Frame 3 of 4':
            self.cancel()
        advance(self, fraction, stage)

    monkeypatch.setattr(stipple.jobs.Task, 'advance', cancel_at_frame_3)
    assert bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'walk.usda'), as_sequence=True) == {'CANCELLED'}
    assert names(tmp_path / 'stipple') == []
