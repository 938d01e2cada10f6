#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the pictures of windows in docs/images.

    python3 tests/blender/run.py tests/blender/make_pictures.py                     # all of them
    python3 tests/blender/run.py tests/blender/make_pictures.py -k fit_tour         # those of fits: minutes

Not a test of the suite: its name keeps it out.
"""

import json
import shutil
from pathlib import Path

import bpy
import numpy as np
import pytest

import adapting_tour_steps
import densify_tour_steps
import fit_tour_steps
import moving_tour_steps
import picture_steps
import screen
import selection_tour_steps
import tour_steps

IMAGES = Path(__file__).resolve().parent.parent.parent / 'docs' / 'images'


@pytest.mark.parametrize('steps,size', ((picture_steps, (screen.WIDTH, screen.HEIGHT)), (tour_steps, (1600, 1300)),
                                        (fit_tour_steps, (1600, 1000)), (densify_tour_steps, (1400, 1100)),
                                        (moving_tour_steps, (1400, 1000)), (adapting_tour_steps, (1600, 900)),
                                        (selection_tour_steps, (1280, selection_tour_steps.HEIGHT))),
                         ids=lambda value: getattr(value, '__name__', ''))
def test_pictures_of_windows(tmp_path, steps, size):
    shots, _, _ = screen.run_steps(Path(steps.__file__), tmp_path, bpy.app.binary_path, timeout=1500, size=size,
                                   options=('--enable-event-simulate',))
    for made in tmp_path.glob('*.png'):  # by the steps themselves
        shutil.copy(made, IMAGES / made.name)
    for name, shot in shots.items():
        part = tmp_path / f'{name}.json'
        if part.exists():
            x, y, width, height = json.loads(part.read_text())
            shot = shot[len(shot) - y - height:len(shot) - y, x:x + width]
        height, width = shot.shape[:2]
        pixels = np.ones((height, width, 4), np.float32)
        pixels[..., :3] = shot[::-1] / 255
        image = bpy.data.images.new(name, width, height)
        image.pixels.foreach_set(pixels.reshape(-1))
        image.filepath_raw, image.file_format = str(IMAGES / f'{name}.png'), 'PNG'
        image.save()
