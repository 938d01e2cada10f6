#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""An artist's way with assets from elsewhere, in Blender windows, from the import to a render in another file.

    STIPPLE_WALK_ASSETS=/FOLDER STIPPLE_WALK_SHOTS=/FOLDER python3 tests/blender/run.py tests/peers/walk/walk.py

The assets, which the project does not keep (README.md beside says where they come from), are checked by their SHA-256.
Three Blenders run one after the other, so that nothing but files passes from one to the next: `make` imports, levels,
crops, erases, sets a budget and saves twice; `reopen` renders what the second file shows after the first folder is
gone; `append` takes the splats into a file of its own and renders them there. Screenshots and renders end up in the
folder of shots, to be looked at."""

import hashlib
import json
import os
import shutil
from pathlib import Path

import bpy
import numpy as np
import pytest

import screen

HERE = Path(__file__).resolve().parent
ASSETS = {
    'truck.splat': '1e0a0f2c9fa19ca162881aef75f9596a8bb5c16ee2d18f66f8e59e2964fe6227',
    'DamagedHelmet.glb': '2822d55c9e75e3015fb3f7f810e6b9b827284f1c9f838f984cb21ebabc7bbf4d',
}
ENGINES = ('STIPPLE', 'STIPPLE_CYCLES')
SIZE = (1400, 900)


@pytest.fixture(scope='module')
def way(tmp_path_factory):
    """The folder of the walk after all three Blenders have ended, and what they noted."""
    assets = Path(os.environ['STIPPLE_WALK_ASSETS']).resolve()
    for name, digest in ASSETS.items():
        assert hashlib.sha256((assets / name).read_bytes()).hexdigest() == digest, f'{name} is another file'
    folder = tmp_path_factory.mktemp('walk')
    shots = Path(os.environ.get('STIPPLE_WALK_SHOTS', folder / 'shots')).resolve()
    shots.mkdir(parents=True, exist_ok=True)
    facts = {}
    for part in ('make', 'reopen', 'append'):
        inside = folder / part
        inside.mkdir()
        images, log = screen.run_steps(HERE / f'walk_{part}.py', inside, bpy.app.binary_path, timeout=900, size=SIZE,
                                       arguments=(str(folder), str(assets)), options=('--enable-event-simulate',))
        (shots / f'{part}.log').write_text(log)
        for name, pixels in images.items():
            save_png(pixels, shots / f'{part}_{name}.png')
        for made in inside.glob('*.png'):
            shutil.copy(made, shots / f'{part}_{made.name}')
        facts[part] = json.loads((inside / 'facts.json').read_text())
        if part == 'make':  # the place that the first file stood at
            shutil.rmtree(folder / 'first')
    return folder, facts


def save_png(pixels, path):
    height, width = pixels.shape[:2]
    values = np.ones((height, width, 4), np.float32)
    values[..., :3] = pixels[::-1] / 255
    image = bpy.data.images.new(path.stem, width, height)
    image.pixels.foreach_set(values.reshape(-1))
    image.filepath_raw, image.file_format = str(path), 'PNG'
    image.save()
    bpy.data.images.remove(image)


def render_of(folder, name):
    """[H,W,4] of a render, row 0 at the bottom."""
    image = bpy.data.images.load(str(folder / f'{name}.png'))
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(height, width, 4)


def psnr(first, second):
    return -10 * np.log10(max(np.mean((first - second) ** 2), 1e-12))


def test_crop_and_brush_leave_less_and_a_budget_cuts_it(way):
    _, facts = way
    counts = facts['make']['counts']
    assert counts['imported'] == 116_544
    assert counts['imported'] > counts['cropped'] > counts['erased'] > counts['budget'] == 20_000


def test_the_brush_took_what_it_touched_and_nothing_else(way):
    """The stroke goes over the middle of what the window shows; a few thousand splats lie there, not most of them."""
    _, facts = way
    counts = facts['make']['counts']
    assert 100 < counts['cropped'] - counts['erased'] < counts['cropped'] // 2


@pytest.mark.parametrize('engine', ENGINES)
def test_the_file_elsewhere_renders_as_the_one_that_was_saved(way, engine):
    folder, facts = way
    assert facts['reopen']['states'] == {name: 'FINE' for name in facts['make']['objects']}
    before, after = (render_of(folder / part, engine) for part in ('make', 'reopen'))
    assert before[..., :3].std() > 0.05  # something is there to be seen
    # The engine Stipple gives the same bits; Cycles' samples of the same seed do as well.
    assert psnr(before, after) > 60


@pytest.mark.parametrize('engine', ENGINES)
def test_appended_splats_render_in_another_file(way, engine):
    folder, facts = way
    assert facts['append']['states'] == {name: 'FINE' for name in facts['make']['objects']}
    before, after = (render_of(folder / part, engine) for part in ('make', 'append'))
    assert psnr(before, after) > 60
