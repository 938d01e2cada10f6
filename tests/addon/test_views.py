# SPDX-License-Identifier: GPL-3.0-or-later
"""Views with pictures through the C header."""

import json
import os

import numpy as np
import pytest

from stipple.binding.errors import StippleError
from stipple.binding.image import Image
from stipple.binding.structs import ColourSpace, StippleCamera, Transfer, ViewSplit
from stipple.binding.views import Views


def camera(width, height):
    made = StippleCamera(width=width, height=height, fx=width, fy=width, cx=width / 2, cy=height / 2, near_plane=0.01,
                         far_plane=100.0)
    for i in range(4):
        made.world_to_camera[5 * i] = 1.0
    return made


def test_pictures_and_points_come_back(context):
    rng = np.random.default_rng(3)
    rgba = rng.random((3, 4, 4), np.float32)
    depth = rng.random((3, 4), np.float32)
    normals = np.tile(np.array((0, 0, 1), np.float32), (3, 4, 1))
    with_space = Views.create(context, ColourSpace.LINEAR)
    with_space.add(camera(4, 3), rgba, depth=depth, normals=normals, name='été.png')
    with_space.add(camera(4, 3), rgba[:, ::-1])
    assert len(with_space) == 2
    assert with_space.view_info(0).name.decode() == 'été.png'
    read = with_space.read(0)
    kept = 7.7e-6  # in 16 bits
    np.testing.assert_allclose(read[0], rgba, atol=kept)
    np.testing.assert_array_equal(read[1], np.ones((3, 4)))
    np.testing.assert_array_equal(read[2], depth)
    np.testing.assert_array_equal(read[3], normals)
    np.testing.assert_allclose(with_space.read(1)[0], rgba[:, ::-1], atol=kept)

    positions, colours = rng.random((5, 3), np.float32), rng.random((5, 3), np.float32)
    with_space.set_points(positions, colours)
    np.testing.assert_array_equal(with_space.points()[0], positions)
    np.testing.assert_array_equal(with_space.points()[1], colours)
    with_space.set_points(positions, colours, times=[0.0, 1.5, np.nan, 2.0, 0.0])
    with pytest.raises(StippleError, match=r'Point array times has shape \(4,\); allowed is \(5,\)'):
        with_space.set_points(positions, colours, times=np.zeros(4))
    with pytest.raises(StippleError, match='time of point 2'):
        with_space.set_points(positions, colours, times=[0.0, 1.5, np.inf, 2.0, 0.0])
    info = with_space.info()
    assert (info.view_count, info.point_count, info.has_images) == (2, 5, 1)


def test_views_have_times_and_say_what_they_are_for(context):
    views = Views.create(context)
    rgba = np.zeros((1, 2, 4), np.float32)
    views.add(camera(2, 1), rgba, time=1.25, split=ViewSplit.TEST)
    views.add(camera(2, 1), rgba)
    assert [(info.time, info.split) for info in map(views.view_info, (0, 1))] == [(1.25, ViewSplit.TEST),
                                                                                  (0.0, ViewSplit.NONE)]
    with pytest.raises(StippleError, match='time'):
        views.add(camera(2, 1), rgba, time=float('nan'))


def test_a_data_set_is_read_from_its_folder(context, tmp_path):
    pixels = np.full((6, 8, 3), 51 / 255, np.float32)
    Image.create(context, pixels, Transfer.SRGB).save(tmp_path / 'a.png')
    matrix = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]
    (tmp_path / 'transforms_train.json').write_text(json.dumps(
        {'camera_angle_x': 1.0, 'frames': [{'file_path': './a', 'transform_matrix': matrix}]}))
    views = Views.open(context, tmp_path, downscale=2)
    assert len(views) == 1
    info = views.view_info(0)
    assert ViewSplit(info.split) == ViewSplit.TRAIN
    assert (info.source_width, info.source_height) == (8, 6)
    assert os.path.samefile(info.image_path.decode(), tmp_path / 'a.png')
    assert (views.camera(0).width, views.camera(0).height) == (4, 3)
    rgba, weights, _, _ = views.read(0)
    np.testing.assert_allclose(rgba[..., :3], 51 / 255, atol=1e-7)
    assert (weights == 1).all()


def test_wrong_shapes_are_one_clear_error(context):
    views = Views.create(context)
    with pytest.raises(StippleError, match=r'View array rgba has shape \(4, 3, 4\); allowed is \(3, 4, 4\)'):
        views.add(camera(4, 3), np.zeros((4, 3, 4)))
    with pytest.raises(StippleError, match='has colour nan'):
        views.add(camera(4, 3), np.full((3, 4, 4), np.nan), Transfer.SRGB)
    assert len(views) == 0
