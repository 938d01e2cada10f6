# SPDX-License-Identifier: GPL-3.0-or-later
"""Differentiable rendering from a script: a small fit, statistics, and what is refused."""

import numpy as np
import pytest

from stipple.binding.cloud import Cloud, SplatArrays
from stipple.binding.errors import StippleError
from stipple.binding.gradients import STATISTICS, backward_memory_bound, image_loss, start_backward
from stipple.binding.renderer import Renderer
from stipple.binding.structs import ObjectOrder, OutputColour, Status, StippleCamera

WIDTH, HEIGHT, COUNT = 60, 44, 40


@pytest.fixture
def camera():
    camera = StippleCamera(width=WIDTH, height=HEIGHT, fx=50, fy=50, cx=WIDTH / 2, cy=HEIGHT / 2, near_plane=0.01,
                           far_plane=100)
    camera.world_to_camera[:] = [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 3, 0, 0, 0, 1]
    return camera


def splats(seed):
    random = np.random.default_rng(seed)
    return SplatArrays(random.uniform(-1, 1, (COUNT, 3)).astype(np.float32),
                       random.normal(size=(COUNT, 4)).astype(np.float32),
                       random.uniform(0.05, 0.3, (COUNT, 3)).astype(np.float32),
                       random.uniform(0.2, 0.9, COUNT).astype(np.float32),
                       random.uniform(-1, 1, (COUNT, 1, 3)).astype(np.float32))


def drawn(renderer, cloud, camera, options):
    task = renderer.start([(cloud, np.eye(4))], camera, options, with_depth=False)
    task.job.wait()
    return task.colour


def test_a_small_fit_of_colours_lowers_the_loss(context, camera):
    renderer = Renderer(context)
    options = renderer.options(output_colour=OutputColour.COMPOSITED, background=(1, 1, 1))
    arrays = splats(1)
    target = drawn(renderer, Cloud.create(context, arrays), camera, options)
    arrays.sh = np.zeros_like(arrays.sh)
    losses = []
    for _ in range(15):
        cloud = Cloud.create(context, arrays)
        picture = drawn(renderer, cloud, camera, options)
        loss, l1, ssim, gradient = image_loss(context, picture, target)
        assert loss == pytest.approx(0.8 * l1 + 0.2 * (1 - ssim))
        losses.append(loss)
        task = start_backward(renderer, [(cloud, np.eye(4))], camera, options, gradient)
        task.job.wait()
        arrays.sh = arrays.sh - 20 * task.instances[0]['sh']
    assert losses[-1] < 0.5 * losses[0]


def test_statistics_come_on_request(context, camera):
    renderer = Renderer(context)
    options = renderer.options(output_colour=OutputColour.COMPOSITED)
    cloud = Cloud.create(context, splats(2))
    picture = drawn(renderer, cloud, camera, options)
    plane = np.ones((HEIGHT, WIDTH), np.float32)
    pictures = {'residual': picture[..., :3], 'edge_weights': plane, 'errors': plane}
    placed = [(cloud, np.eye(4)), (cloud, np.diag([1, -1, 1, 1]))]
    task = start_backward(renderer, placed, camera, options, np.ones_like(picture), STATISTICS, **pictures)
    bound = backward_memory_bound(renderer, placed, camera, np.ones_like(picture), STATISTICS, **pictures)
    task.job.wait()
    assert bound > 0 and task.visible_count == 2 * COUNT
    assert np.any(task.camera != 0) and np.all(task.background == 0)
    for instance in task.instances:
        assert set(STATISTICS) <= set(instance)
        # Every pixel counts once in each of them.
        np.testing.assert_array_equal(instance['edge_weights'], instance['blending_weights'])
        np.testing.assert_array_equal(instance['errors'], instance['blending_weights'])
        assert instance['contributions'].any() and instance['screen_gradients'].shape == (COUNT, 2)


def test_a_loss_of_depth_moves_splats_along_the_view(context, camera):
    renderer = Renderer(context)
    options = renderer.options(output_colour=OutputColour.COMPOSITED)
    cloud = Cloud.create(context, splats(4))
    picture = drawn(renderer, cloud, camera, options)
    nothing = np.zeros_like(picture)
    task = start_backward(renderer, [(cloud, np.eye(4))], camera, options, nothing,
                          depth_gradient=(picture[..., 3] > 0).astype(np.float32))
    task.job.wait()
    # The camera looks along -z of the world. Moving everything away by a metre makes every expected depth a metre
    # larger; what is left are pixels whose splats move in the picture.
    away = -task.instances[0]['positions'][:, 2].sum()
    covered = (picture[..., 3] > 0).sum()
    assert 0.8 * covered < away < 1.2 * covered


def test_bad_input_is_one_sentence(context, camera):
    renderer = Renderer(context)
    cloud = Cloud.create(context, splats(3))
    placed = [(cloud, np.eye(4))]
    composited = renderer.options(output_colour=OutputColour.COMPOSITED)
    ones = np.ones((HEIGHT, WIDTH, 4), np.float32)
    with pytest.raises(StippleError, match=r'colour_gradient has shape \(44, 60, 3\); allowed is \(44, 60, 4\)'):
        start_backward(renderer, placed, camera, composited, ones[..., :3])
    with pytest.raises(StippleError, match="'beauty' is not known; allowed are contributions, "):
        start_backward(renderer, placed, camera, composited, ones, ['beauty'])
    with pytest.raises(StippleError, match='residual is NULL') as caught:
        start_backward(renderer, placed, camera, composited, ones, ['contributions'])
    assert caught.value.status == Status.ERROR_INVALID_ARGUMENT
    with pytest.raises(StippleError, match='output_colour'):
        start_backward(renderer, placed, camera, renderer.options(), ones)
    apart = renderer.options(output_colour=OutputColour.COMPOSITED, object_order=ObjectOrder.APART)
    with pytest.raises(StippleError, match='object_order is 1, which a backward pass does not follow'):
        start_backward(renderer, placed, camera, apart, ones)
    task = start_backward(renderer, placed, camera, composited, np.full_like(ones, np.nan))
    with pytest.raises(StippleError, match='colour_gradient holds nan'):
        task.job.wait()
    with pytest.raises(StippleError, match=r'target has shape \(44, 59, 4\)'):
        image_loss(context, ones, ones[:, 1:])
    with pytest.raises(StippleError, match='ssim_share is 2'):
        image_loss(context, ones, ones, ssim_share=2)
    with pytest.raises(StippleError, match=r'Weights have shape \(3,\)'):
        image_loss(context, ones, ones, weights=[1, 2, 3])
