# SPDX-License-Identifier: GPL-3.0-or-later
"""3D views and panels in a window on a virtual screen (Xvfb): what the screen shows."""

from pathlib import Path

import bpy
import numpy as np
import pytest

import screen
import window_steps

# Alpha of a splat is 0.99 at most, so a hundredth of what lies behind shows; views that are encoded twice, or blended
# in the wrong space, are off by 20 and more.
TOLERANCE = 6


@pytest.fixture(scope='module')
def shots(tmp_path_factory):
    folder = tmp_path_factory.mktemp('window')
    return screen.run_steps(Path(window_steps.__file__), folder, bpy.app.binary_path)


def pixel(shots, picture, name):
    pictures, facts, _ = shots
    x, y = (int(round(v)) for v in facts[name][0])
    return np.median(pictures[picture][y - 2:y + 3, x - 2:x + 3].reshape(-1, 3), axis=0)


def display(color):
    c = np.array(color)
    return 255 * np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)


def is_color(value, color):
    return np.abs(value - display(color)).max() <= TOLERANCE


@pytest.mark.parametrize('picture', ('solid', 'workbench', 'native'))
def test_splats_show_their_own_colors(shots, picture):
    assert is_color(pixel(shots, picture, 'left'), window_steps.RED)
    assert is_color(pixel(shots, picture, 'right'), window_steps.BLUE)
    assert not is_color(pixel(shots, picture, 'nothing'), window_steps.RED)


def test_meshes_hide_splats_behind_them(shots):
    value = pixel(shots, 'solid', 'behind_cube')
    assert np.ptp(value) < 10 and value.mean() > 80  # the grey of the cube


def test_meshes_hide_splats_in_the_engines_own_view(shots):
    value = pixel(shots, 'native', 'behind_cube')
    assert np.ptp(value) < 10  # a hole, in which the editor's grey shows


def test_selected_splats_have_an_outline(shots):
    # Blender draws the box of what is selected too; the outline lies on the splats' rim, next to it.
    changed = (shots[0]['outlined'] != shots[0]['solid']).any(-1)
    x, y = (int(v) for v in shots[1]['right'][0])
    assert changed[y - 120:y + 121, x - 120:x + 121].sum() > 100
    assert not changed[y - 5:y + 6, x - 5:x + 6].any()


@pytest.mark.parametrize('picture', ('clipped', 'clipped_native'))
def test_the_clipping_region_cuts_splats(shots, picture):
    assert is_color(pixel(shots, picture, 'right'), window_steps.BLUE)
    assert not is_color(pixel(shots, picture, 'clipped'), window_steps.BLUE)
    assert is_color(pixel(shots, 'solid', 'clipped'), window_steps.BLUE)


@pytest.mark.parametrize('picture', ('local', 'local_native'))
def test_local_view_shows_only_its_objects(shots, picture):
    assert is_color(pixel(shots, picture, 'right'), window_steps.BLUE)
    assert not is_color(pixel(shots, picture, 'left'), window_steps.RED)


def test_hidden_objects_are_not_drawn(shots):
    assert is_color(pixel(shots, 'hidden', 'right'), window_steps.BLUE)
    assert not is_color(pixel(shots, 'hidden', 'left'), window_steps.RED)


def test_a_click_on_its_box_selects_a_splat_object(shots):
    assert shots[1]['clicked'] == [shots[1]['left'][1]]


def test_edit_mode_leaves_splats_as_they_are(shots):
    assert shots[1]['problems'] == {}
    assert is_color(pixel(shots, 'left_edit_mode', 'left'), window_steps.RED)
    assert is_color(pixel(shots, 'edited', 'right'), window_steps.BLUE)


def test_above_the_chosen_count_the_largest_are_points(shots):
    """Both squares have 4,000 splats: the first becomes points, which leave gaps."""
    def noise(picture, name):
        x, y = (int(v) for v in shots[1][name][0])
        return shots[0][picture][y - 15:y + 16, x - 15:x + 16].astype(float).std(axis=(0, 1)).max()

    assert noise('solid', 'left') < 3 and noise('solid', 'right') < 3
    assert noise('points', 'left') > 10
    assert noise('points', 'right') < 3


def test_the_panel_is_drawn(shots):
    # A Properties editor that shows the data panels differs from the one with the object's own.
    changed = (shots[0]['panel'] != shots[0]['hidden']).any(-1)
    assert changed[:, -220:].sum() > 2000


def test_a_shader_that_does_not_compile_gives_one_message_and_points(shots):
    pictures, facts, text = shots
    assert 'cannot compile' in facts['problem'] and not facts['off']
    assert text.count('The graphics driver cannot compile') == 1
    assert 'Traceback' not in text
    x, y = (int(v) for v in facts['right'][0])
    part = pictures['broken_shader'][y - 15:y + 16, x - 15:x + 16].reshape(-1, 3)
    assert (np.abs(part - display(window_steps.BLUE)).max(axis=1) <= TOLERANCE).mean() > 0.05
