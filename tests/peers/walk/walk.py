#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""An artist's way with assets from elsewhere, in Blender windows, from the import to a render in another file.

    STIPPLE_WALK_ASSETS=/FOLDER STIPPLE_WALK_SHOTS=/FOLDER python3 tests/blender/run.py tests/peers/walk/walk.py

The assets, which the project does not keep (README.md beside says where they come from), are checked by their SHA-256.
Three Blenders run one after the other, so that nothing but files passes from one to the next: `make` imports, levels,
crops, erases, sets a budget and saves twice; `reopen` renders what the second file shows after the first folder is
gone; `append` takes the splats into a file of its own and renders them there. A fourth, `others`, cleans and exports
another scan, and fits splats to photographs. Screenshots and renders end up in the folder of shots, to be looked
at."""

import hashlib
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
    'burger.splat': '82d5c5621bf0d9f09d399f034647b16da0bd9671fd5db899a23f82098b8d0291',
    'DamagedHelmet.glb': '2822d55c9e75e3015fb3f7f810e6b9b827284f1c9f838f984cb21ebabc7bbf4d',
}
# Of the names and bytes of all files under fox/, in the order of their names.
FOX = '3499f3b1edb0f1fb44a55a183e2d95a5fbf8ca214f7fd8ebd761d9c1d5e76225'
ENGINES = ('STIPPLE', 'STIPPLE_CYCLES')
SIZE = (1400, 900)


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp('walk')


@pytest.fixture(scope='module')
def way(folder):
    """The folder of the walk after the first three Blenders have ended, and what they noted."""
    facts = {}
    for part in ('make', 'reopen', 'append'):
        facts[part] = walked(folder, part)
        if part == 'make':  # the place that the first file stood at
            shutil.rmtree(folder / 'first')
    return folder, facts


@pytest.fixture(scope='module')
def others(folder):
    """What the fourth has noted."""
    return walked(folder, 'others')


def checked_assets():
    assets = Path(os.environ['STIPPLE_WALK_ASSETS']).resolve()
    for name, digest in ASSETS.items():
        assert hashlib.sha256((assets / name).read_bytes()).hexdigest() == digest, f'{name} is another file'
    every = hashlib.sha256()
    for path in sorted((assets / 'fox').rglob('*')):
        if path.is_file():
            every.update(path.relative_to(assets).as_posix().encode() + path.read_bytes())
    assert every.hexdigest() == FOX, 'fox/ has other files'
    return assets


def walked(folder, part):
    """Runs a Blender and keeps what it shows; returns what it has noted."""
    assets, inside = checked_assets(), folder / part
    shots = Path(os.environ.get('STIPPLE_WALK_SHOTS', folder / 'shots')).resolve()
    shots.mkdir(parents=True, exist_ok=True)
    inside.mkdir()
    images, facts, log = screen.run_steps(HERE / f'walk_{part}.py', inside, bpy.app.binary_path, timeout=1500,
                                          size=SIZE, arguments=(str(folder), str(assets)),
                                          options=('--enable-event-simulate',))
    (shots / f'{part}.log').write_text(log)
    for name, pixels in images.items():
        save_png(pixels, shots / f'{part}_{name}.png')
    for made in inside.glob('*.png'):
        shutil.copy(made, shots / f'{part}_{made.name}')
    assert 'Traceback' not in log, log
    return facts


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


def test_a_scan_is_cleaned_and_exported(others):
    """What is written is what is left, in files of two formats that come in again."""
    counts = others['burger']
    assert counts['imported'] == 110_529
    assert 100 < counts['imported'] - counts['erased'] < counts['imported'] // 2
    assert counts['ply'] == counts['spz'] == counts['erased']


def test_photographs_become_cameras_and_splats(others):
    """17 of the 67 pictures that the set names are not in it: the other 50 are used, and a note says so."""
    fox = others['fox']
    assert fox['cameras'] == 50
    assert fox['count'] > 1000 and fox['state'] == 'FINE'
    assert 0 < fox['iterations'] < 2000
