# SPDX-License-Identifier: GPL-3.0-or-later
"""Masks, merging, ground and scale through the C header, against numpy in double."""

import numpy as np
import pytest

from stipple.binding import cloud_edit
from stipple.binding.cloud import Cloud, SplatArrays
from stipple.binding.errors import CancelledError, StippleError
from stipple.binding.mesh import Mesh
from stipple.binding.model import DecodeSettings, Model
from stipple.binding.structs import Antialias, Side


def arrays(count=400, degree=1, seed=1):
    rng = np.random.default_rng(seed)
    rotations = rng.normal(size=(count, 4)).astype(np.float32)
    rotations /= np.linalg.norm(rotations, axis=1, keepdims=True)
    return SplatArrays(rng.uniform(-1, 1, (count, 3)).astype(np.float32), rotations,
                       rng.uniform(0.01, 0.1, (count, 3)).astype(np.float32),
                       rng.uniform(0.1, 1, count).astype(np.float32),
                       rng.normal(size=(count, (degree + 1) ** 2, 3)).astype(np.float32))


def cube_mesh(context, matrix=np.eye(4)):
    """The cube -1..1 without its top."""
    corners = np.array([(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], np.float32)
    triangles = [(0, 2, 1), (1, 2, 3), (0, 1, 4), (1, 5, 4), (2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6), (1, 3, 5),
                 (3, 7, 5)]
    mesh = Mesh.create(context)
    mesh.add_part(corners, np.array(triangles), matrix)
    return mesh


def turned(scale=(0.5, 0.3, 0.8)):
    c, s = np.cos(0.4), np.sin(0.4)
    matrix = np.diag([*scale, 1.0])
    matrix[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ matrix[:3, :3]
    matrix[:3, 3] = (0.1, 0.2, -0.1)
    return matrix


def in_box(positions, box_to_cloud):
    inverse = np.linalg.inv(box_to_cloud)
    local = positions.astype(np.float64) @ inverse[:3, :3].T + inverse[:3, 3]
    return np.abs(local).max(axis=1) <= 1


def test_box_and_its_outside_add_up(context):
    given = arrays()
    cloud = Cloud.create(context, given)
    box = turned()
    inside = cloud_edit.select_box(cloud, np.linalg.inv(box))
    np.testing.assert_array_equal(inside, in_box(given.positions, box))
    outside = cloud_edit.select_box(cloud, np.linalg.inv(box), Side.OUTSIDE)
    np.testing.assert_array_equal(inside + outside, np.ones(400))
    left = cloud_edit.keep(cloud, inside).read()
    np.testing.assert_array_equal(left.positions, given.positions[inside == 1])
    np.testing.assert_array_equal(left.sh, given.sh[inside == 1])


def test_masks_compose(context):
    given = arrays()
    cloud = Cloud.create(context, given)
    a = cloud_edit.select_box(cloud, np.linalg.inv(turned()))
    b = cloud_edit.select_box(cloud, np.diag([1, 1, 4.0, 1]))
    both = cloud_edit.keep(cloud, a & b).read()
    expected = in_box(given.positions, turned()) & (np.abs(given.positions[:, 2]) <= 0.25)
    np.testing.assert_array_equal(both.positions, given.positions[expected])


@pytest.mark.parametrize('side', [Side.INSIDE, Side.OUTSIDE])
def test_mesh_with_a_hole_selects_like_the_box(context, side):
    given = arrays(2000)
    cloud = Cloud.create(context, given)
    task = cloud_edit.select_mesh_start(cloud, np.linalg.inv(turned()), cube_mesh(context), side)
    task.job.wait()
    inverse = np.linalg.inv(turned())
    local = given.positions.astype(np.float64) @ inverse[:3, :3].T + inverse[:3, 3]
    # Seen from below the middle, the open top fills less than half of the sphere: 4 pi times half is
    # passed at its own height.
    clear = (local[:, 2] < 0) | (np.abs(local).max(axis=1) > 1)
    expected = (np.abs(local).max(axis=1) <= 1) == (side == Side.INSIDE)
    np.testing.assert_array_equal(task.mask[clear] == 1, expected[clear])
    assert 50 < np.count_nonzero(task.mask) < 1950


def test_mesh_selection_is_cancelled_with_its_job(context):
    cloud = Cloud.create(context, arrays(200000))
    task = cloud_edit.select_mesh_start(cloud, np.eye(4), cube_mesh(context))
    task.job.cancel()
    with pytest.raises(CancelledError):
        task.job.wait()


def test_floaters_are_counted(context):
    given = arrays(1000)
    given.opacities[:7] = 0.01
    given.scales[7:10] = 50
    given.positions[10:12] = (30, 0, 0)
    cloud = Cloud.create(context, given)
    task = cloud_edit.select_floaters_start(cloud)
    task.job.wait()
    assert (task.report.faint, task.report.large, task.report.isolated, task.report.kept) == (7, 3, 2, 988)
    np.testing.assert_array_equal(np.flatnonzero(task.mask == 0), np.arange(12))
    off = cloud_edit.FloaterSettings(by_opacity=False, by_size=False, by_connectivity=False)
    task = cloud_edit.select_floaters_start(cloud, off)
    task.job.wait()
    assert task.report.kept == 1000


def test_merge_pads_harmonics_and_moves(context):
    a, b = arrays(30, degree=0), arrays(20, degree=2, seed=2)
    matrix = np.diag([-1.0, 2.0, 1.0, 1.0])
    both = cloud_edit.merge([(Cloud.create(context, a), np.eye(4)), (Cloud.create(context, b), matrix)]).read()
    assert both.sh.shape == (50, 9, 3)
    np.testing.assert_array_equal(both.positions[:30], a.positions)
    np.testing.assert_array_equal(both.sh[:30, 1:], 0)
    np.testing.assert_allclose(both.positions[30:], b.positions * np.float32((-1, 2, 1)))
    mip = arrays(5)
    mip.antialias = Antialias.MIP
    with pytest.raises(StippleError, match='antialias'):
        cloud_edit.merge([(Cloud.create(context, a), np.eye(4)), (Cloud.create(context, mip), np.eye(4))])


def test_a_tree_without_some_splats_never_shows_them(context):
    given = arrays(300, degree=1)
    job = Model.from_cloud_start(context, Cloud.create(context, given))
    job.wait()
    model = Model.of_job(job)
    mask = (given.positions[:, 0] < 0).astype(np.uint8)
    kept = int(mask.sum())
    masked = model.masked(mask)
    assert masked.info().leaf_count == kept
    np.testing.assert_array_equal(masked.decode(DecodeSettings(kept)).read().positions, given.positions[mask == 1])
    for budget in (1, 10, kept // 2):
        positions = masked.decode(DecodeSettings(budget)).read().positions
        assert positions.shape == (budget, 3) and positions[:, 0].max() < 0
    for wrong, text in ((mask[:-1], 'mask holds 299'), (mask * 0, 'leaves out all 300')):
        with pytest.raises(StippleError, match=text):
            model.masked(wrong)


def test_ground_plane_is_levelled(context):
    given = arrays(2000)
    given.positions[:1500, 2] = 0.2 * given.positions[:1500, 0] - 1.3
    plane = cloud_edit.ground_plane(Cloud.create(context, given), np.eye(4))
    expected = np.array([-0.2, 0, 1]) / np.sqrt(1.04)
    # 1,500 of the splats lie in it to float32; strangers within the tolerance pull a little.
    np.testing.assert_allclose(plane.normal, expected, atol=1e-3)
    matrix = np.array(plane.matrix).reshape(4, 4)
    floor = given.positions[:1500] @ matrix[:3, :3].T + matrix[:3, 3]
    assert np.abs(floor[:, 2]).max() < 0.01
    assert plane.inlier_count >= 1500


def test_points_give_level_and_scale(library):
    points = np.array([(1, 2, 3), (4, 2.5, 3.5), (0, 7, 2.0)])
    matrix = cloud_edit.level_points(library, points)
    np.testing.assert_allclose((points @ matrix[:3, :3].T + matrix[:3, 3])[:, 2], 0, atol=1e-14)
    scale = cloud_edit.scale_points(library, points[:2], 5.0)
    assert np.linalg.norm((points[1] - points[0]) @ scale[:3, :3]) == pytest.approx(5.0)
    with pytest.raises(StippleError, match='one line'):
        cloud_edit.level_points(library, np.array([(0, 0, 0), (1, 1, 1), (2, 2, 2.0)]))
    with pytest.raises(StippleError, match='needed'):
        cloud_edit.level_points(library, points[:2])


@pytest.mark.parametrize('call, text', [
    (lambda cloud, mesh: cloud_edit.keep(cloud, np.ones(3)), 'mask_count is 3'),
    (lambda cloud, mesh: cloud_edit.select_box(cloud, np.zeros((4, 4))), 'row 0 0 0 1'),
    (lambda cloud, mesh: cloud_edit.select_box(cloud, np.diag([1, 0, 1.0, 1])), 'singular'),
    (lambda cloud, mesh: cloud_edit.select_box(cloud, np.eye(4), 7), 'side is 7'),
    (lambda cloud, mesh: cloud_edit.select_mesh_start(cloud, np.full((4, 4), np.nan), mesh).job.wait(), 'finite'),
    (lambda cloud, mesh: cloud_edit.select_floaters_start(
        cloud, cloud_edit.FloaterSettings(min_opacity=2)).job.wait(), 'min_opacity is 2'),
    (lambda cloud, mesh: cloud_edit.merge([]), 'nothing to merge'),
    (lambda cloud, mesh: cloud_edit.ground_plane(cloud, np.eye(4), max_tilt=3.0), 'max_tilt is 3'),
])
def test_what_does_not_fit_is_refused_with_the_value(context, call, text):
    cloud = Cloud.create(context, arrays(10))
    with pytest.raises(StippleError, match=text):
        call(cloud, cube_mesh(context))
