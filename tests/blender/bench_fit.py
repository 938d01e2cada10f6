#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures fits as an artist waits for them: Suzanne with the defaults, views included.

    python3 tests/blender/run.py tests/blender/bench_fit.py -s

Not a test of the suite: its name keeps it out. Held-out views stand elsewhere and have 256 samples; rendering them is
not on the clock. Seconds of the processor are those of all its cores, whatever else runs on them.
STIPPLE_FIT_MODELS=FIELD,EXPLICIT chooses what is fitted. STIPPLE_FIT_PICTURES=folder keeps what was compared.
"""

import importlib
import os
import time

import bpy
import numpy as np
import pytest

import scenes

HELD_OUT = 8
TARGET_SECONDS, TARGET_PSNR = 180, 32.0


def display(linear):
    """[H,W,3] over black, as a Standard view shows scene linear premultiplied pictures."""
    alpha = np.maximum(linear[..., 3:], 1e-6)
    straight = np.clip(linear[..., :3] / alpha, 0, 1)
    return np.where(straight <= 0.0031308, 12.92 * straight, 1.055 * straight ** (1 / 2.4) - 0.055) * linear[..., 3:]


def psnr(error):
    return -10 * np.log10(np.mean(np.square(error)))


@pytest.mark.parametrize('model', os.environ.get('STIPPLE_FIT_MODELS', 'EXPLICIT').split(','))
def test_suzanne(stipple, tmp_path, model):
    rigs = importlib.import_module('.scene.fit.view_rigs', stipple.__name__)
    capturing = importlib.import_module('.scene.fit.view_capture', stipple.__name__)
    fitting = importlib.import_module('.scene.fit.fitting', stipple.__name__)
    binding = importlib.import_module('.binding.renderer', stipple.__name__)
    structs = importlib.import_module('.binding.structs', stipple.__name__)
    obj = scenes.suzanne()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    settings = bpy.context.scene.stipple.fit
    settings.model = model
    if 'STIPPLE_FIT_QUALITY' in os.environ:
        settings.quality = os.environ['STIPPLE_FIT_QUALITY']
    start, busy = time.perf_counter(), time.process_time()
    assert bpy.ops.stipple.splats_fit() == {'FINISHED'}
    seconds, busy = time.perf_counter() - start, time.process_time() - busy
    figures = fitting.state.figures
    result = next(o for o in bpy.data.objects if o.name.endswith(' Fit'))
    cloud = stipple.scene.source.decoded.decode_data(result.data,
                                                     stipple.scene.source.sources.decode_settings(result.data.stipple))
    depsgraph = bpy.context.evaluated_depsgraph_get()
    poses = rigs.poses('AROUND', bpy.context.scene, depsgraph, rigs.bounds_of([obj], depsgraph), HELD_OUT, seed=5)
    renderer = binding.Renderer(stipple.scene.source.sources.context())
    black, foreground = [], []
    with capturing.Capture(bpy.context, [obj], capturing.CaptureSettings('CYCLES', 256, 256)) as capture:
        for i, pose in enumerate(poses):
            seen = capture.pose(f'held_{i}', pose)
            task = renderer.start([(cloud, np.eye(4))], seen.camera,
                                  renderer.options(output_colour=structs.OutputColour.COMPOSITED), with_depth=False)
            task.job.wait()
            wanted, got = display(seen.linear), np.clip(task.colour[..., :3], 0, 1)
            black.append(psnr(got - wanted))
            inside = seen.linear[..., 3] > 0.5
            foreground.append(psnr((got - wanted)[inside]))
            if 'STIPPLE_FIT_PICTURES' in os.environ and i < 2:
                save(os.path.join(os.environ['STIPPLE_FIT_PICTURES'], f'{model.lower()}_{i}.png'), wanted, got)
    print(f'\nSuzanne, {model}: {seconds:.1f} s in all (target {TARGET_SECONDS} s, ratio '
          f'{TARGET_SECONDS / seconds:.2f}x), '
          f'{busy:.1f} s of the processor; {figures.seconds:.1f} s of them {figures.iteration} steps; '
          f'{cloud.info().count:,} splats; '
          f'held-out views over black {np.mean(black):.2f} dB (target {TARGET_PSNR} dB), foreground '
          f'{np.mean(foreground):.2f} dB; trainer measured {figures.best_psnr:.2f} dB', flush=True)


def save(path, wanted, got):
    """Both pictures and ten times their difference, side by side."""
    picture = np.concatenate([wanted, got, np.clip(np.abs(got - wanted) * 10, 0, 1)], axis=1)[::-1]
    image = bpy.data.images.new('compared', picture.shape[1], picture.shape[0])
    image.pixels.foreach_set(np.concatenate([picture, np.ones_like(picture[..., :1])],
                                            2).astype(np.float32).reshape(-1))
    image.filepath_raw, image.file_format = path, 'PNG'
    image.save()
