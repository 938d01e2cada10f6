# SPDX-License-Identifier: GPL-3.0-or-later
"""Rendered shading through a camera, in a window on a virtual screen: lenses and panoramas as in final pictures."""

from pathlib import Path

import bpy
import numpy as np
import pytest

import screen
import view_lens_steps


@pytest.fixture(scope='module')
def shots(tmp_path_factory):
    folder = tmp_path_factory.mktemp('view_lens')
    pictures, facts, _ = screen.run_steps(Path(view_lens_steps.__file__), folder, bpy.app.binary_path, timeout=560)
    return pictures, facts, folder


def of_view(shots, name):
    """The picture in the camera's frame, display values 0..1."""
    x, y, width, height = shots[1]['frames'][name]
    return shots[0][name][y:y + height, x:x + width] / 255.0


def of_render(shots, name):
    """Display values 0..1 and where the picture is: beyond a fisheye the view shows the editor."""
    pixels = np.load(shots[2] / f'{name}.npy')
    linear = np.clip(pixels[..., :3], 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055), pixels[..., 3] > 0.5


@pytest.mark.parametrize('name', ('sharp', 'blurred', 'panorama', 'fisheye'))
def test_a_view_through_the_camera_is_the_final_picture(shots, name):
    shown, (rendered, is_there) = of_view(shots, name), of_render(shots, name)
    assert shown.shape == rendered.shape
    assert np.ptp(rendered) > 0.5
    # The frame lies anywhere between pixels, so edges may differ by one; the rest by rounding to 8 bits. A perspective
    # picture in place of the panorama differs by 0.1 and more, a sharp one in place of the blurred one by 0.02.
    assert is_there.mean() > 0.7
    assert np.abs(shown - rendered)[is_there].mean() < 0.008


def test_the_lens_blurs_what_is_out_of_focus(shots):
    """The near square is in focus, the far one is not; both end at the right of the picture's middle."""
    def steepest(name, part):
        edge = of_view(shots, name)[..., 2][:, part]
        return np.abs(np.diff(edge, axis=1)).max()

    width = of_view(shots, 'sharp').shape[1]
    far, near = slice(int(0.7 * width), width), slice(0, int(0.4 * width))
    assert steepest('blurred', far) < 0.5 * steepest('sharp', far)
    assert steepest('blurred', near) > 0.7 * steepest('sharp', near)


@pytest.mark.parametrize('name', ('blurred', 'turned'))
def test_a_view_is_sharp_first_then_averages_more_and_more(shots, name):
    """After every change, what was averaged before included."""
    drawn = [tuple(entry) for entry in shots[1]['drawn'][name]]
    assert drawn[:3] == [(False, 1), (True, 1), (True, 4)]
    samples = [count for _, count in drawn[1:]]
    assert samples == sorted(set(samples)) and samples[-1] >= 16


def test_a_view_beside_the_camera_is_sharp(shots):
    assert [tuple(entry) for entry in shots[1]['drawn']['outside']][-1] == (True, 1)


def test_panoramas_without_a_model_show_no_picture(shots):
    assert 'MIRRORBALL' in shots[1]['refusal']
    x, y, width, height = shots[1]['frames']['fisheye']
    part = shots[0]['refused'][y + height // 4:y + 3 * height // 4, x + width // 4:x + 3 * width // 4]
    assert np.ptp(part.reshape(-1, 3).astype(int), axis=0).max() < 20
