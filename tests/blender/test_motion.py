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


def test_all_splats_are_shown_at_any_budget(stipple, clip):
    """They have no budget: whatever an animation or a script says, all of them come."""
    count = len(shown(stipple, clip))
    clip.data.stipple.ratio = 0.1
    assert len(shown(stipple, clip)) == count
    assert not stipple.scene.source.sync.problems


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
