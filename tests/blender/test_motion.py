# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats that move by themselves: a fitted clip on Blender's timeline."""

import json
import shutil
import struct
from pathlib import Path

import bpy
import numpy as np
import pytest

import scenes

ASSET = Path(__file__).resolve().parents[1] / 'data' / 'assets' / 'motion_1.0.stipple.safetensors'


@pytest.fixture
def clip(stipple, tmp_path):
    """The object of an asset whose splats move, imported."""
    shutil.copy(ASSET, tmp_path / ASSET.name)
    assert bpy.ops.stipple.splats_import(filepath=str(tmp_path / ASSET.name), up_axis='Z') == {'FINISHED'}
    bpy.context.scene.render.fps, bpy.context.scene.render.fps_base = 24, 1.0
    return bpy.context.object


def model(stipple, obj):
    sources = stipple.scene.source.sources
    return sources.model(stipple.scene.source.source_paths.file_of(obj.data))


def at(stipple, obj, seconds):
    """Positions of the model at a time of its clip."""
    settings = stipple.binding.model.DecodeSettings(model(stipple, obj).settings().default_budget, time=seconds)
    return model(stipple, obj).decode(settings).positions()


def shown(stipple, obj):
    return stipple.scene.source.splat_data.read(obj.data).positions


def test_a_clip_plays_on_the_timeline(stipple, clip):
    settings = model(stipple, clip).settings()
    assert settings.has_time and settings.time_end > settings.time_begin
    scene, stored = bpy.context.scene, clip.data.stipple
    seen = []
    for frame in (1, 3, 5):
        scene.frame_set(frame)
        np.testing.assert_allclose(shown(stipple, clip), at(stipple, clip, settings.time_begin + (frame - 1) / 24))
        seen.append(shown(stipple, clip))
    assert np.abs(seen[0] - seen[2]).max() > 1e-4
    # Slow motion at fractions of a frame, and a later start.
    stored.frame_speed, stored.frame_start = 0.25, 2
    scene.frame_set(4, subframe=0.5)
    np.testing.assert_allclose(shown(stipple, clip), at(stipple, clip, settings.time_begin + 0.25 * 2.5 / 24),
                               atol=1e-6)


def rows_of(cloud):
    """What of splats does not change with time, row by row: it tells nodes apart."""
    return np.concatenate([cloud.scales, cloud.sh.reshape(len(cloud.scales), -1)], axis=1)


def shown_rows(stipple, obj):
    return rows_of(stipple.scene.source.splat_data.read(obj.data))


@pytest.fixture
def crowd(stipple, tmp_path):
    """The object of 200 splats that move each in its own way."""
    path = tmp_path / 'crowd.stipple.safetensors'
    write_crowd(path, 200)
    assert bpy.ops.stipple.splats_import(filepath=str(path), up_axis='Z') == {'FINISHED'}
    bpy.context.scene.render.fps, bpy.context.scene.render.fps_base = 24, 1.0
    return bpy.context.object


# Ranges of the numbers of a crowd; others are between -0.2 and 0.2.
RANGES = {'positions': (-1, 1), 'rotations': (0.8, 1.2), 'scales': (0.02, 0.06), 'opacities': (0.5, 1),
          'lifespans': (0.5, 1.1), 'centres': (0.2, 0.8)}


def write_crowd(path, count, with_tree=False):
    """The asset with other splats, as many as are asked for, that move each in its own way.

    With a tree: its nodes are more of the same, and their order is drawn; cuts of it show nothing that is like all."""
    data = ASSET.read_bytes()
    size = struct.unpack('<Q', data[:8])[0]
    old, tensors, dice = json.loads(data[8:8 + size]), [], np.random.default_rng(5)
    header = {'__metadata__': old['__metadata__']}

    def add(name, dtype, values):
        begin = sum(len(part) for part in tensors)
        tensors.append(values.tobytes())
        header[name] = {'dtype': dtype, 'shape': list(values.shape), 'data_offsets': [begin, begin + values.nbytes]}

    for stem, rows in (('motion', count), ('tree.nodes', count - 1))[:2 if with_tree else 1]:
        for name, tensor in old.items():
            if name.startswith('motion.'):
                low, high = RANGES.get(name.split('.')[1], (-0.2, 0.2))
                values = dice.uniform(low, high, [rows] + tensor['shape'][1:])
                add(name.replace('motion', stem, 1), 'F32', values.astype('<f4'))
    if with_tree:
        free, parents = [0, 0], [2**32 - 1]
        for node, drawn in enumerate(dice.integers(0, 2**62, 2 * count - 2), 1):
            place = int(drawn % len(free))
            free[place], free[-1] = free[-1], free[place]
            parents.append(free.pop())
            if node < count - 1:
                free += [node, node]
        add('tree.parents', 'U32', np.array(parents, '<u4'))
        add('tree.errors', 'F32', np.ones(count - 1, '<f4'))
    text = json.dumps(header).encode()
    text += b' ' * (-len(text) % 8)
    path.write_bytes(struct.pack('<Q', len(text)) + text + b''.join(tensors))


def test_the_budget_is_a_slider_that_plays(stipple, crowd):
    """Fewer splats, as many at every frame, the same ones, and where they are at its time."""
    scene, stored = bpy.context.scene, crowd.data.stipple
    settings = model(stipple, crowd).settings()
    assert (settings.minimum_budget, settings.maximum_budget) == (1, 200)
    assert len(shown(stipple, crowd)) == 200
    stored.ratio = 0.25
    scene.frame_set(1)
    first, places = shown_rows(stipple, crowd), shown(stipple, crowd)
    assert len(first) == 50
    for frame in (2, 5, 9):
        scene.frame_set(frame)
        np.testing.assert_array_equal(shown_rows(stipple, crowd), first)
        wanted = model(stipple, crowd).decode(stipple.binding.model.DecodeSettings(
            50, time=settings.time_begin + (frame - 1) / 24))
        np.testing.assert_allclose(shown(stipple, crowd), wanted.positions())
    assert np.abs(shown(stipple, crowd) - places).max() > 1e-3
    assert not stipple.scene.source.sync.problems


def test_budgets_of_moving_splats_are_keyframed(stipple, crowd):
    scene, stored = bpy.context.scene, crowd.data.stipple
    for frame, ratio in ((1, 0.1), (11, 1.0)):
        stored.ratio = ratio
        stored.keyframe_insert('ratio', frame=frame)
    counts = []
    for frame in (1, 4, 8, 11):
        scene.frame_set(frame)
        counts.append(len(shown(stipple, crowd)))
    assert counts[0] == 20 and counts[-1] == 200
    assert sorted(set(counts)) == counts


def test_renders_have_their_own_budget_of_moving_splats(stipple, crowd, tmp_path):
    scene, stored = bpy.context.scene, crowd.data.stipple
    scenes.camera((0, 0, 10), width=48, height=48, type='ORTHO', ortho_scale=3.0)
    scene.render.engine, scene.render.film_transparent = 'STIPPLE', True
    stored.ratio = 0.05
    scene.frame_set(5)
    stored.ratio_render = 1.0
    whole = scenes.render_pixels(tmp_path, 'whole')
    stored.ratio_render = 0.05
    few = scenes.render_pixels(tmp_path, 'few')
    assert np.abs(whole - few).max() > 0.05
    assert len(shown(stipple, crowd)) == 10


def test_images_and_files_are_of_their_frame(stipple, clip, tmp_path):
    scene = bpy.context.scene
    settings = model(stipple, clip).settings()
    scene.frame_start, scene.frame_end = 4, 5
    scenes.select(clip)
    assert bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'a.ply'), frames='SCENE', use_selection=True,
                                         up_axis='Z') == {'FINISHED'}
    for frame in (4, 5):
        path = next(p for p in tmp_path.iterdir() if p.name.endswith(f'{frame}.ply'))
        cloud = stipple.binding.cloud.Cloud.load(stipple.scene.source.sources.context(), str(path))
        np.testing.assert_allclose(cloud.positions(), at(stipple, clip, settings.time_begin + (frame - 1) / 24),
                                   atol=1e-6)


def rewritten(path, values):
    """Gives tensors of an asset other values, by their names' beginnings."""
    data = bytearray(path.read_bytes())
    size = struct.unpack('<Q', data[:8])[0]
    for name, tensor in json.loads(data[8:8 + size]).items():
        for begin, value in values.items():
            if name.startswith(begin):
                first, last = (8 + size + offset for offset in tensor['data_offsets'])
                data[first:last] = np.full((last - first) // 4, value, np.float32).tobytes()
    path.write_bytes(data)


def test_motion_blur_is_of_the_motion_itself(stipple, tmp_path):
    """Splats that go round by 0.8 m and do not fade: the blurred image is the mean of sharp ones of the frames
    between."""
    path = tmp_path / ASSET.name
    shutil.copy(ASSET, path)
    rewritten(path, {'motion.cosines': 0, 'motion.sines': 0, 'motion.phases': 0, 'motion.lifespans': 1})
    rewritten(path, {'motion.cosines.1': 0.8, 'motion.sines.1': 0.4, 'motion.opacities': 0.9})
    assert bpy.ops.stipple.splats_import(filepath=str(path), up_axis='Z') == {'FINISHED'}
    clip, scene = bpy.context.object, bpy.context.scene
    clip.data.stipple.frame_speed = 4.0
    scene.render.fps, scene.render.fps_base = 24, 1.0
    scenes.camera((0, 0, 10), width=32, height=32, type='ORTHO', ortho_scale=4.0)
    scene.render.engine, scene.render.film_transparent = 'STIPPLE', True
    scene.frame_set(5)
    sharp = scenes.render_pixels(tmp_path, 'sharp')
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 2.0
    scene.stipple.blur_samples = 256
    clip.cycles.motion_steps = 3  # of Cycles' scale: nine shapes, straight in between
    blurred = scenes.render_pixels(tmp_path, 'blurred')
    scene.render.use_motion_blur = False
    between = []
    for step in np.linspace(4.0, 6.0, 17):
        scene.frame_set(int(step), subframe=float(step % 1))
        between.append(scenes.render_pixels(tmp_path, 'step'))
    # Evenly open: the two ends are half as long as the steps between.
    mean = np.average(between, axis=0, weights=[0.5, *[1.0] * 15, 0.5])
    assert np.abs(sharp - mean).max() > 0.1
    # Measured: 0.06 with nine shapes, 0.22 with Cycles' three, which cut the bend of the paths short.
    assert np.abs(blurred - mean).mean() < 0.1 * np.abs(sharp - mean).mean()
