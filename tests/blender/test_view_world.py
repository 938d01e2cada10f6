# SPDX-License-Identifier: GPL-3.0-or-later
"""Worlds in Rendered shading of the engine Stipple, in a window on a virtual screen, against final pictures."""

import os
from pathlib import Path

import bpy
import numpy as np
import pytest

import screen
import view_world_steps
from test_view_lens import of_render, of_view

NAMES = ('panorama_world', 'turned', 'dimmer', 'gradient', 'green', 'pink', 'undone', 'wide', 'plain')


@pytest.fixture(scope='module')
def shots(tmp_path_factory):
    folder = tmp_path_factory.mktemp('view_world')
    pictures, facts, text = screen.run_steps(Path(view_world_steps.__file__), folder, bpy.app.binary_path, timeout=560)
    assert 'Traceback' not in text, text
    return pictures, facts, folder


@pytest.mark.parametrize('name', NAMES)
def test_a_view_shows_the_world_of_the_final_picture(shots, name):
    """Splats and world together. A single colour for the world differs by 0.03 and more (below)."""
    shown, (rendered, is_there) = of_view(shots, name), of_render(shots, name)
    assert shown.shape == rendered.shape
    assert is_there.all()
    difference = np.abs(shown - rendered)
    # The frame lies anywhere between pixels, so edges of splats may differ by one; the rest by 8 bits.
    assert difference.mean() < 0.006
    assert np.quantile(difference, 0.97) < 0.02
    if name != 'plain':
        assert np.abs(rendered - np.median(rendered, axis=(0, 1))).mean() > 0.03


def test_every_change_of_the_world_is_seen(shots):
    for before, after in zip(('turned', 'dimmer', 'gradient', 'green'), ('dimmer', 'gradient', 'green', 'pink')):
        assert np.abs(of_view(shots, before) - of_view(shots, after)).mean() > 0.02
    np.testing.assert_allclose(of_view(shots, 'undone'), of_view(shots, 'green'), atol=0.02)


def test_a_plain_world_and_other_changes_are_not_painted(shots):
    facts = shots[1]
    assert facts['picture of a plain world'] is False
    assert facts['versions after'] == facts['versions']


def test_the_process_ends_with_blender(shots):
    assert not Path(f"/proc/{shots[1]['process']}").exists() or not os.path.exists('/proc')


def test_how_long_it_takes(shots):
    """Printed with -s: seconds until the coarse and the fine picture of each world."""
    print({name: round(seconds, 1) for name, seconds in shots[1]['seconds'].items()}, shots[1]['sizes'])
    width = view_world_steps.STEPS[-1][0]
    assert shots[1]['sizes'] == [width // 2, width, 3]
