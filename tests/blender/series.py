# SPDX-License-Identifier: GPL-3.0-or-later
"""A series of ten splat files: a swarm of splats that walks along x and swells. Made anew by every test."""

import bpy
import numpy as np

import scenes

DC = 0.28209479177387814
COUNT = 60


def arrays_of(stipple, frame, count=COUNT):
    """Frame 1, 2, ...: splats in a ball of 0.5 m around (frame - 1, 0, 0), red turning blue."""
    random = np.random.default_rng(7)
    positions = (random.normal(size=(count, 3)) * 0.15).astype(np.float32)
    positions[:, 0] += frame - 1
    share = np.float32((frame - 1) / 9)
    colour = np.array([1 - share, 0.2, share], np.float32)
    return stipple.binding.cloud.SplatArrays(
        positions, np.tile(np.float32([1, 0, 0, 0]), (count, 1)),
        np.full((count, 3), 0.08 + 0.01 * frame, np.float32), np.full(count, 0.7, np.float32),
        np.tile((colour - 0.5) / DC, (count, 1))[:, None, :].astype(np.float32),
        frame=stipple.binding.structs.Frame.RFU)


def write(stipple, folder, frames=range(1, 11), name='swarm_{:04d}.ply', count=COUNT):
    """Writes the files; returns their folder."""
    folder.mkdir(exist_ok=True)
    for frame in frames:
        cloud = stipple.binding.cloud.Cloud.create(stipple.scene.source.sources.context(),
                                                   arrays_of(stipple, frame, count))
        cloud.save(str(folder / name.format(frame)), frame=stipple.binding.structs.Frame.RFU)
    return folder


def load(folder, first='swarm_0001.ply', **settings):
    """Imports a series by its first file and returns the object."""
    assert bpy.ops.stipple.splats_import(filepath=str(folder / first), as_sequence=True, up_axis='Z',
                                         **settings) == {'FINISHED'}
    return bpy.context.object


def centre(stipple, obj):
    """Where the stored splats are along x, about: the frame that is shown less 1; None for no splats."""
    arrays = stipple.scene.source.splat_data.read(obj.data)
    return round(float(arrays.positions[:, 0].mean())) if arrays.count else None


def camera(x=0.0):
    """Looks down at x from 6 m, over 3 m."""
    return scenes.camera((x, 0, 6), width=48, height=48, type='ORTHO', ortho_scale=3.0)
