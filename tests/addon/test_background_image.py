# SPDX-License-Identifier: GPL-3.0-or-later
"""An image behind splats, and depths where they are solid, through the binding."""
import numpy as np
import pytest

from stipple.binding.cloud import Cloud, SplatArrays
from stipple.binding.errors import StippleError
from stipple.binding.renderer import EMPTY_DEPTH, Renderer
from stipple.binding.structs import StippleCamera

SIZE = 32


@pytest.fixture
def camera():
    """From y = -4 along +y."""
    camera = StippleCamera(width=SIZE, height=SIZE, fx=60.0, fy=60.0, cx=SIZE / 2, cy=SIZE / 2, near_plane=0.01,
                           far_plane=100.0)
    camera.world_to_camera[:] = [1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 4, 0, 0, 0, 1]
    return camera


def draw(context, camera, **options):
    cloud = Cloud.create(context, SplatArrays(
        np.zeros((1, 3), np.float32), np.array([[1, 0, 0, 0]], np.float32), np.array([[0.2, 0.01, 0.2]], np.float32),
        np.array([0.9], np.float32), np.ones((1, 1, 3), np.float32)))
    renderer = Renderer(context)
    image = options.pop('background_image', None)
    task = renderer.start([(cloud, np.eye(4))], camera, renderer.options(**options), background_image=image)
    task.job.wait()
    return task


def test_an_image_is_behind_the_splats(context, camera):
    image = np.zeros((SIZE, SIZE, 3), np.float32)
    image[:4, :, 0] = 0.5  # the first rows are the top ones
    drawn = draw(context, camera, background_image=image).colour
    assert drawn[1, 1].tolist() == [0.5, 0, 0, 1] and drawn[-2, 1].tolist() == [0, 0, 0, 1]
    plain = np.broadcast_to(np.float32((0.25, 0.5, 0.75)), (SIZE, SIZE, 3))
    np.testing.assert_allclose(draw(context, camera, background_image=plain).colour,
                               draw(context, camera, background=(0.25, 0.5, 0.75)).colour, atol=1e-6)


def test_a_solid_depth_is_where_half_of_a_pixel_is_covered(context, camera):
    everywhere, solid = draw(context, camera), draw(context, camera, solid_depth=True)
    covered = solid.colour[..., 3] >= 0.5
    assert 0 < covered.sum() < 0.5 * (everywhere.depth < EMPTY_DEPTH).sum()
    assert np.array_equal(solid.depth < EMPTY_DEPTH, covered)
    assert np.array_equal(solid.depth[covered], everywhere.depth[covered])


def test_what_does_not_fit_is_one_error(context, camera):
    with pytest.raises(StippleError, match=r'has shape \(2, 2, 3\); allowed is \(32, 32, 3\)'):
        draw(context, camera, background_image=np.zeros((2, 2, 3), np.float32))
    with pytest.raises(StippleError, match='beside options->background_image'):
        draw(context, camera, background_image=np.zeros((SIZE, SIZE, 3), np.float32), background=(1, 1, 1))
