# SPDX-License-Identifier: GPL-3.0-or-later
"""Lens, shutter, cameras of directions and passes through the binding."""
import math

import numpy as np
import pytest

from stipple.binding.blur import Blur
from stipple.binding.cloud import Cloud, SplatArrays
from stipple.binding.errors import StippleError
from stipple.binding.renderer import Renderer
from stipple.binding.structs import CameraModel, OutputColour, RenderMethod, StippleCamera

SIZE = 48


def view(model=CameraModel.PERSPECTIVE, focal=60.0):
    """From y = -4 along +y."""
    camera = StippleCamera(model=int(model), width=SIZE, height=SIZE, fx=focal, fy=focal, cx=SIZE / 2, cy=SIZE / 2,
                           near_plane=0.01, far_plane=100.0)
    camera.world_to_camera[:] = [1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 4, 0, 0, 0, 1]
    return camera


@pytest.fixture
def cloud(context):
    return Cloud.create(context, SplatArrays(
        np.zeros((1, 3), np.float32), np.array([[1, 0, 0, 0]], np.float32), np.array([[0.2, 0.01, 0.2]], np.float32),
        np.array([0.9], np.float32), np.ones((1, 1, 3), np.float32)))


def draw(context, cloud, camera, blur=None, method=RenderMethod.TILED, output=OutputColour.SCENE_LINEAR, **wanted):
    renderer = Renderer(context)
    task = renderer.start([(cloud, np.eye(4))], camera, renderer.options(method=method, output_colour=output),
                          blur=blur, **wanted)
    task.job.wait()
    return task


def test_a_lens_spreads_and_keeps_the_light(context, cloud):
    sharp = draw(context, cloud, view(), Blur(samples=64)).colour
    wide = draw(context, cloud, view(), Blur(aperture_radius=0.3, focus_distance=2.0, samples=256)).colour
    assert wide[..., 3].sum() == pytest.approx(sharp[..., 3].sum(), rel=0.03)
    assert (wide[..., 3] > 0.02).sum() > 1.2 * (sharp[..., 3] > 0.02).sum()
    assert wide[..., 3].max() < 0.8 * sharp[..., 3].max()
    again = draw(context, cloud, view(), Blur(aperture_radius=0.3, focus_distance=2.0, samples=256)).colour
    assert np.array_equal(wide, again)


def test_light_is_averaged_whatever_the_output(context, cloud):
    blur = Blur(aperture_radius=0.3, focus_distance=2.0, samples=32)
    light = draw(context, cloud, view(), blur).colour
    shown = draw(context, cloud, view(), blur, output=OutputColour.COMPOSITED).colour
    assert np.array_equal(light[..., 3], shown[..., 3])
    inside = light[..., 3] > 0.05
    straight = shown[inside][:, :3] / shown[inside][:, 3:]
    linear = np.where(straight <= 0.04045, straight / 12.92, ((straight + 0.055) / 1.055) ** 2.4)
    assert np.allclose(linear, light[inside][:, :3] / light[inside][:, 3:], atol=1e-4)


def test_a_shutter_draws_a_streak(context, cloud):
    steps = np.stack([np.eye(4), np.eye(4)])
    steps[0, 0, 3], steps[1, 0, 3] = -0.8, 0.8
    still = draw(context, cloud, view()).colour[..., 3]
    streak = draw(context, cloud, view(), Blur(instances=steps[:, None], samples=128)).colour[..., 3]
    assert (streak > 0.01).any(0).sum() > (still > 0.01).any(0).sum() + 15
    assert abs(int((streak > 0.01).any(1).sum()) - int((still > 0.01).any(1).sum())) <= 2
    cameras = np.stack([np.array(view().world_to_camera).reshape(4, 4)] * 2)
    same = draw(context, cloud, view(), Blur(cameras=cameras, samples=1)).colour[..., 3]
    assert np.array_equal(same, still)
    with pytest.raises(StippleError, match='as many of each'):
        Blur(cameras=cameras, instances=steps[:1, None])


def shifted(cloud, x):
    matrix = np.eye(4)
    matrix[0, 3] = x
    return cloud.transformed(matrix)


def test_splats_that_change_are_blurred(context, cloud):
    still = draw(context, cloud, view()).colour
    steps = np.stack([np.eye(4), np.eye(4)])
    steps[0, 0, 3], steps[1, 0, 3] = -0.8, 0.8
    by_matrices = draw(context, cloud, view(), Blur(instances=steps[:, None], samples=128)).colour
    blur = Blur(clouds=[[shifted(cloud, -0.8)], [shifted(cloud, 0.8)]], samples=128)
    by_clouds = draw(context, cloud, view(), blur).colour
    assert np.abs(by_clouds - still).max() > 0.3
    # Places are float32 in the clouds and double in the matrices.
    assert np.allclose(by_clouds, by_matrices, atol=1e-4)
    # From the splats themselves to others, beside an object that moves.
    renderer, faint = Renderer(context), shifted(cloud, 0.3)
    instances = [(cloud, np.eye(4)), (faint, np.eye(4))]
    both = Blur(clouds=[[None, None], [faint, None]], instances=np.tile(np.eye(4), (2, 2, 1, 1)), samples=0)
    assert renderer.sample_count(instances, view(), renderer.options(), both) == 16
    far = Blur(clouds=[[None, None], [shifted(cloud, 3.0), None]])
    # 45 px.
    assert renderer.sample_count(instances[:1], view(), renderer.options(),
                                 Blur(clouds=[[None], [shifted(cloud, 3.0)]])) == 64
    task = renderer.start(instances, view(), renderer.options(), blur=far)
    del far  # the task holds what it needs
    task.job.wait()
    # No clouds that differ: the bits of the picture without.
    same = draw(context, cloud, view(), Blur(clouds=[[None], [cloud]], samples=16)).colour
    assert np.array_equal(same, draw(context, cloud, view(), Blur(
        cameras=np.stack([np.array(view().world_to_camera).reshape(4, 4)] * 2), samples=16)).colour)


def test_clouds_of_other_splats_are_refused_by_name(context, cloud):
    arrays = cloud.read()
    two = Cloud.create(context, SplatArrays(*(np.concatenate([array, array]) for array in (
        arrays.positions, arrays.rotations, arrays.scales, arrays.opacities, arrays.sh))))
    with pytest.raises(StippleError, match='instance 0: the cloud of step 1 has 2 splats .* itself are 1 of'):
        draw(context, cloud, view(), Blur(clouds=[[None], [two]]))
    with pytest.raises(StippleError, match='have 1 to 2 clouds'):
        Blur(clouds=[[None], [None, None]])
    with pytest.raises(StippleError, match='3 steps of instances and 2 steps of clouds; as many of each'):
        Blur(clouds=[[None], [None]], instances=np.tile(np.eye(4), (3, 1, 1, 1)))


def test_passes_name_the_object_and_turn_to_the_camera(context, cloud):
    task = draw(context, cloud, view(), with_normal=True, with_objects=True)
    middle = SIZE // 2
    assert task.objects[middle, middle] == 1 and task.objects[0, 0] == 0
    assert np.allclose(task.normal[middle, middle], [0, -1, 0], atol=1e-6)


def test_a_panorama_shows_what_is_behind(context, cloud):
    camera = view(CameraModel.EQUIRECTANGULAR, focal=SIZE / (2 * math.pi))
    camera.fy = SIZE / math.pi
    behind = view(CameraModel.EQUIRECTANGULAR, focal=SIZE / (2 * math.pi))
    behind.fy = camera.fy
    behind.world_to_camera[:] = [-1, 0, 0, 0, 0, 0, -1, 0, 0, -1, 0, -4, 0, 0, 0, 1]
    ahead = draw(context, cloud, camera, method=RenderMethod.RAYS).colour[..., 3]
    at_the_seam = draw(context, cloud, behind, method=RenderMethod.RAYS).colour[..., 3]
    assert ahead[SIZE // 2, SIZE // 2] > 0.1
    assert np.allclose(np.roll(ahead, SIZE // 2, 1), at_the_seam, atol=1e-5)
    with pytest.raises(StippleError, match='drawn along rays only'):
        draw(context, cloud, camera)
    camera = view(CameraModel.FISHEYE_EQUIDISTANT)
    camera.field_of_view = math.radians(400)
    with pytest.raises(StippleError, match='400 degrees; 0 to 360 is allowed'):
        draw(context, cloud, camera, method=RenderMethod.RAYS)
