# SPDX-License-Identifier: GPL-3.0-or-later
"""Selections by regions through the C header against numpy in double, their records, and filled holes."""

import ctypes
import json

import numpy as np
import pytest

from stipple.binding import regions
from stipple.binding.cloud import Cloud, SplatArrays
from stipple.binding.context import Context
from stipple.binding.errors import StippleError
from stipple.binding.regions import FillSettings, Region
from stipple.binding.structs import ColourSpace, RegionKind, RegionOperation, StippleRegion

C0 = 0.28209479177387814
WIDTH, HEIGHT = 640, 480


def arrays(count=4000, seed=1):
    rng = np.random.default_rng(seed)
    rotations = rng.normal(size=(count, 4)).astype(np.float32)
    rotations /= np.linalg.norm(rotations, axis=1, keepdims=True)
    return SplatArrays(rng.uniform(-1, 1, (count, 3)).astype(np.float32), rotations,
                       rng.uniform(0.01, 0.1, (count, 3)).astype(np.float32),
                       rng.uniform(0.1, 1, count).astype(np.float32),
                       ((rng.uniform(0, 1, (count, 1, 3)) - 0.5) / C0).astype(np.float32))


def camera(distance=2.0):
    """A perspective view along -z from above; some splats are behind it where the distance is below 1."""
    f = 500.0
    return np.array([[f, 0, -WIDTH / 2, WIDTH / 2 * distance], [0, -f, -HEIGHT / 2, HEIGHT / 2 * distance],
                     [0, 0, 1, 0], [0, 0, -1, distance]])


def projected(positions, matrix):
    """(pixels [n,2], in front [n])"""
    homogeneous = np.c_[positions.astype(np.float64), np.ones(len(positions))] @ matrix.T
    ahead = homogeneous[:, 3] > 0
    return homogeneous[:, :2] / np.where(ahead, homogeneous[:, 3], 1.0)[:, None], ahead


def to_path(pixels, path):
    """Distance of pixels to a path."""
    path = np.asarray(path, np.float32).astype(np.float64)
    best = np.linalg.norm(pixels - path[0], axis=1)
    for a, b in zip(path[:-1], path[1:]):
        d = b - a
        t = np.clip((pixels - a) @ d / max(d @ d, 1e-300), 0, 1)
        best = np.minimum(best, np.linalg.norm(pixels - a - t[:, None] * d, axis=1))
    return best


def in_outline(pixels, outline):
    outline = np.asarray(outline, np.float32).astype(np.float64)
    inside = np.zeros(len(pixels), bool)
    for a, b in zip(outline, np.roll(outline, -1, axis=0)):
        crosses = (a[1] > pixels[:, 1]) != (b[1] > pixels[:, 1])
        with np.errstate(divide='ignore', invalid='ignore'):
            inside ^= crosses & (pixels[:, 0] < a[0] + (pixels[:, 1] - a[1]) * (b[0] - a[0]) / (b[1] - a[1]))
    return inside


def oklab(linear):
    lms = np.cbrt(np.asarray(linear) @ np.array([[0.4122214708, 0.5363325363, 0.0514459929],
                                                 [0.2119034982, 0.6806995451, 0.1073969566],
                                                 [0.0883024619, 0.2817188376, 0.6299787005]]).T)
    return lms @ np.array([[0.2104542553, 0.7936177850, -0.0040720468],
                           [1.9779984951, -2.4285922050, 0.4505937099],
                           [0.0259040371, 0.7827717662, -0.8086757660]]).T


def linear_colours(given, space=ColourSpace.DISPLAY):
    stored = given.sh[:, 0].astype(np.float64) * C0 + 0.5
    if space == ColourSpace.LINEAR:
        return stored
    sign, size = np.sign(stored), np.abs(stored)
    return sign * np.where(size <= 0.04045, size / 12.92, ((size + 0.055) / 1.055) ** 2.4)


def scribble(count, seed=3):
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.normal(0, 12, (count, 2)), axis=0) + (WIDTH / 2, HEIGHT / 2)


@pytest.fixture(scope='module')
def given():
    return arrays()


@pytest.fixture(scope='module')
def cloud(context, given):
    return Cloud.create(context, given)


@pytest.mark.parametrize('count, radius, distance', [(1, 60, 2), (2, 25, 2), (40, 12, 2), (600, 5, 2), (40, 30, 0.5)])
def test_a_brush_selects_what_is_near_its_path(cloud, given, count, radius, distance):
    path = scribble(count)
    view = camera(distance)
    mask = regions.select(cloud, [Region(RegionKind.BRUSH, cloud_to_pixels=view, points=path, radius=radius)])
    pixels, ahead = projected(given.positions, view)
    away = to_path(pixels, path)
    clear = np.abs(away - radius) > 1e-6  # what is on the edge is decided by the last bit
    assert clear.sum() > 0.999 * len(clear)
    np.testing.assert_array_equal(mask[clear], (ahead & (away <= radius))[clear])
    assert 0 < mask.sum() < len(mask)


def test_a_brush_over_one_place_is_a_disc(cloud, given):
    path = np.repeat([[300.0, 200.0]], 5, axis=0)
    mask = regions.select(cloud, [Region(RegionKind.BRUSH, cloud_to_pixels=camera(), points=path, radius=80)])
    pixels, _ = projected(given.positions, camera())
    np.testing.assert_array_equal(mask, np.linalg.norm(pixels - (300, 200), axis=1) <= 80)


@pytest.mark.parametrize('count', [4, 7, 50, 900])
def test_a_lasso_selects_by_the_even_odd_rule(cloud, given, count):
    outline = scribble(count, seed=count)  # crosses itself
    mask = regions.select(cloud, [Region(RegionKind.LASSO, cloud_to_pixels=camera(), points=outline)])
    pixels, ahead = projected(given.positions, camera())
    closed = np.r_[outline, outline[:1]]
    clear = to_path(pixels, closed) > 1e-6
    np.testing.assert_array_equal(mask[clear], (ahead & in_outline(pixels, outline))[clear])
    assert mask.any()


def test_sphere_and_box_select_centres(cloud, given):
    positions = given.positions.astype(np.float64)
    centre = np.array([0.2, -0.3, 0.1])
    ball = regions.select(cloud, [Region(RegionKind.SPHERE, centre=centre, radius=0.6)])
    np.testing.assert_array_equal(ball, np.linalg.norm(positions - centre, axis=1) <= 0.6)
    frame = np.diag([2, 0.5, -3, 1.0])
    frame[:3, 3] = (0.1, 0.2, -0.3)
    placed = positions @ frame[:3, :3].T + frame[:3, 3]
    there = regions.select(cloud, [Region(RegionKind.SPHERE, centre=centre, radius=0.6, cloud_to_box=frame)])
    np.testing.assert_array_equal(there, np.linalg.norm(placed - centre, axis=1) <= 0.6)
    assert there.any() and (there != ball).any()
    box = np.diag([2, 4, 3, 1.0])
    cube = regions.select(cloud, [Region(RegionKind.BOX, cloud_to_box=box)])
    np.testing.assert_array_equal(cube, (np.abs(positions * (2, 4, 3)) <= 1).all(axis=1))


@pytest.mark.parametrize('space', list(ColourSpace))
@pytest.mark.parametrize('tolerance', [0.03, 0.1, 0.4, 3.0])
def test_colours_are_compared_in_oklab(context, given, space, tolerance):
    given = SplatArrays(given.positions, given.rotations, given.scales, given.opacities, given.sh, colour_space=space)
    cloud = Cloud.create(context, given)
    linear = linear_colours(given, space)
    np.testing.assert_allclose(regions.colours(cloud, np.arange(len(linear))), linear, rtol=1e-5, atol=1e-6)
    wanted = linear[17]
    away = np.linalg.norm(oklab(linear) - oklab(wanted), axis=1)
    clear = np.abs(away - tolerance) > 1e-6
    mask = regions.select(cloud, [Region(RegionKind.COLOUR, colour=wanted, tolerance=tolerance)])
    np.testing.assert_array_equal(mask[clear], (away <= tolerance)[clear])
    near = regions.select(cloud, [Region(RegionKind.COLOUR, colour=wanted, tolerance=tolerance, centre=np.zeros(3),
                                         radius=0.8)])
    inside = np.linalg.norm(given.positions.astype(np.float64), axis=1) <= 0.8
    np.testing.assert_array_equal(near[clear], (inside & (away <= tolerance))[clear])


def pairwise(positions):
    positions = positions.astype(np.float64)
    return np.linalg.norm(positions[:, None] - positions[None], axis=2)


@pytest.mark.parametrize('distance', [0.02, 0.15, 0.6, 5.0])
def test_growing_and_shrinking_go_by_distance(context, distance):
    given = arrays(1500, seed=7)
    cloud = Cloud.create(context, given)
    ball = Region(RegionKind.SPHERE, centre=np.array([0.1, 0, 0]), radius=0.7)
    before = regions.select(cloud, [ball]).astype(bool)
    away = pairwise(given.positions)
    more = regions.select(cloud, [ball, Region(RegionKind.GROW, distance=distance)])
    np.testing.assert_array_equal(more, (away[:, before] <= distance).any(axis=1))
    less = regions.select(cloud, [ball, Region(RegionKind.GROW, distance=-distance)])
    np.testing.assert_array_equal(less, before & (away[:, ~before] > distance).all(axis=1))
    # The rim alone: what shrinking takes away.
    rim = regions.select(cloud, [ball, Region(RegionKind.GROW, RegionOperation.SUBTRACT, distance=-distance)])
    np.testing.assert_array_equal(rim, before & ~less.astype(bool))


def test_growing_by_itself_takes_the_usual_distance(context):
    given = arrays(1500, seed=7)
    cloud = Cloud.create(context, given)
    ball = Region(RegionKind.SPHERE, centre=np.zeros(3), radius=0.5)
    before = np.flatnonzero(regions.select(cloud, [ball]))
    away = pairwise(given.positions)
    asked = before[np.arange(32) * len(before) // 32]
    eighth = np.sort(away[asked], axis=1)[:, 8]
    distance = np.sort(eighth)[16]
    more = regions.select(cloud, [ball, Region(RegionKind.GROW)])
    np.testing.assert_array_equal(more, (away[:, before] <= distance).any(axis=1))
    assert len(before) < more.sum() < 1500


def test_nothing_and_all_neither_grow_nor_shrink(cloud, given):
    everything = Region(RegionKind.ALL)
    nothing = Region(RegionKind.ALL, RegionOperation.SUBTRACT)
    for distance in (0.0, 0.3, -0.3):
        step = Region(RegionKind.GROW, distance=distance)
        assert regions.select(cloud, [everything, step]).all()
        assert not regions.select(cloud, [nothing, step]).any()


def test_operations_are_those_of_sets(cloud):
    a = Region(RegionKind.SPHERE, centre=np.zeros(3), radius=0.7)
    b = {'kind': RegionKind.SPHERE, 'centre': np.array([0.4, 0, 0]), 'radius': 0.6}
    first = regions.select(cloud, [a])
    second = regions.select(cloud, [Region(**b)])
    for operation, expected in ((RegionOperation.SET, second), (RegionOperation.ADD, first | second),
                                (RegionOperation.SUBTRACT, first & ~second & 1),
                                (RegionOperation.INTERSECT, first & second), (RegionOperation.TOGGLE, first ^ second)):
        region = Region(operation=operation, **b)
        np.testing.assert_array_equal(regions.select(cloud, [a, region]), expected)
        # The same from the selection before; any value but 0 is selected.
        np.testing.assert_array_equal(regions.select(cloud, [region], first * 7), expected)
    assert (first & second).any() and (first & ~second & 1).any()


def test_front_only_leaves_out_what_is_hidden(cloud, given):
    view = camera()
    to_depth = np.array([0, 0, -1.0, 2.0])
    pixels, _ = projected(given.positions, view)
    depth = 2.0 - given.positions[:, 2].astype(np.float64)
    # Left half: a wall at depth 2; right half: nothing is there; the lowest quarter is not covered.
    depths = np.full((30, 64), np.inf, np.float32)
    depths[:, :32] = 2.0
    rect = (0.0, 0.0, WIDTH, HEIGHT * 0.75)
    front = {'depths': depths, 'depth_rect': rect, 'cloud_to_depth': to_depth, 'cloud_to_pixels': view,
             'depth_margin': 0.125}
    seen = ((pixels >= 0) & (pixels <= (WIDTH, HEIGHT * 0.75))).all(axis=1)
    seen &= (depth <= 2.125) | (pixels[:, 0] >= WIDTH / 2)
    clear = (np.abs(pixels - (WIDTH / 2, HEIGHT * 0.75)) > 1e-6).all(axis=1)
    np.testing.assert_array_equal(regions.select(cloud, [Region(RegionKind.ALL, **front)])[clear], seen[clear])
    path = scribble(30)
    stroke = {'points': path, 'radius': 40}
    mask = regions.select(cloud, [Region(RegionKind.BRUSH, **stroke, **front)])
    through = regions.select(cloud, [Region(RegionKind.BRUSH, **stroke, cloud_to_pixels=view)])
    np.testing.assert_array_equal(mask[clear], (through.astype(bool) & seen)[clear])
    assert 0 < mask.sum() < through.sum()


def test_the_number_of_threads_changes_nothing(library):
    given = arrays(60000, seed=5)
    steps = [Region(RegionKind.BRUSH, cloud_to_pixels=camera(), points=scribble(200), radius=20),
             Region(RegionKind.LASSO, RegionOperation.ADD, cloud_to_pixels=camera(), points=scribble(99)),
             Region(RegionKind.GROW), Region(RegionKind.GROW, distance=-0.02)]
    masks = [regions.select(Cloud.create(Context(library, threads=threads), given), steps) for threads in (1, 2, 5)]
    np.testing.assert_array_equal(masks[0], masks[1])
    np.testing.assert_array_equal(masks[0], masks[2])
    assert masks[0].any()


def test_positions_to_draw_are_evenly_chosen(cloud, given):
    mask = regions.select(cloud, [Region(RegionKind.SPHERE, centre=np.zeros(3), radius=0.8)])
    chosen = np.flatnonzero(mask)
    np.testing.assert_array_equal(regions.selected_positions(cloud, mask, 10 ** 9), given.positions[chosen])
    some = regions.selected_positions(cloud, mask, 100)
    np.testing.assert_array_equal(some, given.positions[chosen[np.arange(100) * len(chosen) // 100]])
    assert regions.selected_positions(cloud, mask, 0).shape == (0, 3)
    assert regions.selected_positions(cloud, np.zeros_like(mask), 5).shape == (0, 3)
    with pytest.raises(StippleError, match='-1'):
        regions.selected_positions(cloud, mask, -1)


BRUSH = {'kind': RegionKind.BRUSH, 'cloud_to_pixels': np.eye(4), 'points': [[1.0, 2.0]], 'radius': 3.0}
BAD = [
    ({**BRUSH, 'points': np.zeros((0, 2))}, '0 points; 1 to 65536'),
    ({**BRUSH, 'points': np.zeros((65537, 2))}, '65537; at most 65536'),
    ({**BRUSH, 'points': [[1.0, np.nan]]}, 'point'),
    ({**BRUSH, 'radius': -1.0}, 'radius is -1'),
    ({**BRUSH, 'radius': np.nan}, 'radius is'),
    ({**BRUSH, 'cloud_to_pixels': np.full((4, 4), np.inf)}, 'cloud_to_pixels holds a number that is not finite'),
    ({**BRUSH, 'kind': RegionKind.LASSO, 'points': np.zeros((2, 2))}, '2 points; 3 to 16384'),
    ({'kind': RegionKind.SPHERE, 'centre': [0, 0, np.nan], 'radius': 1.0}, 'centre holds a number that is not finite'),
    ({'kind': RegionKind.SPHERE, 'centre': [0, 0, 0], 'radius': -1.0}, 'radius is -1'),
    ({'kind': RegionKind.COLOUR, 'colour': [0, 0, 0], 'tolerance': -0.1}, 'tolerance is -0.1'),
    ({'kind': RegionKind.BOX, 'cloud_to_box': np.zeros((4, 4))}, 'cloud_to_box'),
    ({'kind': RegionKind.GROW, 'distance': np.inf}, 'distance'),
    ({**BRUSH, 'depths': np.zeros((0, 5)), 'depth_rect': [0, 0, 1, 1], 'cloud_to_depth': [0, 0, 1, 0]},
     'depths has 5 x 0 pixels'),
    ({**BRUSH, 'depths': np.ones((4, 5)), 'depth_rect': [0, 0, 0, 1], 'cloud_to_depth': [0, 0, 1, 0]}, 'no area'),
    ({**BRUSH, 'depths': np.full((4, 5), np.nan), 'depth_rect': [0, 0, 1, 1], 'cloud_to_depth': [0, 0, 1, 0]}, 'NaN'),
]


@pytest.mark.parametrize('fields, message', BAD)
def test_what_makes_no_region_is_refused(cloud, fields, message):
    mask = np.ones(4000, np.uint8)
    with pytest.raises(StippleError, match=message):
        regions.select(cloud, [Region(RegionKind.ALL), Region(**fields)], mask)


def test_masks_of_another_length_are_refused(cloud):
    for call in (lambda mask: regions.select(cloud, [Region(RegionKind.ALL)], mask),
                 lambda mask: regions.selected_positions(cloud, mask, 5),
                 lambda mask: regions.fill_start(cloud, mask)):
        with pytest.raises(StippleError, match='3999; the cloud has 4000'):
            call(np.ones(3999, np.uint8))
    with pytest.raises(StippleError, match='4000; the cloud has 4000'):
        regions.colours(cloud, [4000])


def test_unknown_kinds_and_shapes_are_refused(library, cloud):
    made = StippleRegion()
    library.stipple_region_init(ctypes.byref(made))
    made.kind = 77
    mask = np.zeros(4000, np.uint8)
    status = library.stipple_cloud_select_regions(cloud.pointer, ctypes.byref(made), 1,
                                                  mask.ctypes.data_as(ctypes.POINTER(ctypes.c_uint8)), 4000, None)
    assert status == 1 and b'kind is 77' in library.stipple_last_error_message()
    with pytest.raises(StippleError, match='n x 2 is needed'):
        Region(RegionKind.BRUSH, cloud_to_pixels=np.eye(4), points=np.zeros((4, 3)))
    with pytest.raises(StippleError, match='needs cloud_to_box'):
        Region(RegionKind.BOX)


def every_kind():
    front = {'depths': np.array([[1, np.inf]], np.float32), 'depth_rect': [0, 0, 2, 1], 'cloud_to_depth': [0, 0, 1, 3],
             'depth_margin': 0.1}
    return [Region(RegionKind.ALL), Region(operation=RegionOperation.ADD, **BRUSH), Region(**BRUSH, **front),
            Region(RegionKind.LASSO, RegionOperation.SUBTRACT, cloud_to_pixels=camera(), points=scribble(50)),
            Region(RegionKind.SPHERE, RegionOperation.INTERSECT, centre=[1, 2, 3], radius=0.1),
            Region(RegionKind.COLOUR, colour=[0.1, 0.2, 0.3], tolerance=0.1),
            Region(RegionKind.COLOUR, colour=[0.1, 0.2, 0.3], tolerance=0.1, centre=[0, 0, 0], radius=2.0),
            Region(RegionKind.SPHERE, centre=[1, 2, 3], radius=0.1, cloud_to_box=np.diag([1, 2, 3, 1.0])),
            Region(RegionKind.GROW, distance=0.25, shrink=True), Region(RegionKind.ALL, RegionOperation.TOGGLE),
            Region(RegionKind.GROW, distance=-0.25), Region(RegionKind.BOX, cloud_to_box=np.diag([1, 2, 3, 1.0]))]


@pytest.mark.parametrize('region', every_kind(), ids=lambda region: region.kind.name)
def test_records_are_json_and_lose_nothing(region):
    record = json.loads(json.dumps(region.to_record()))
    back = Region.from_record(record)
    assert back.to_record() == region.to_record()
    assert (back.kind, back.operation) == (region.kind, region.operation)
    for name in ('points', 'depths', 'cloud_to_pixels', 'cloud_to_box', 'centre', 'colour', 'depth_rect'):
        if getattr(back, name) is not None:
            np.testing.assert_array_equal(getattr(back, name), getattr(region, name))
    assert (back.radius, back.tolerance, back.distance) == (region.radius, region.tolerance, region.distance)
    assert back.shrink is region.shrink


def test_hostile_records_are_refused():
    good = Region(**BRUSH).to_record()
    bomb = Region(RegionKind.LASSO, cloud_to_pixels=np.eye(4), points=np.zeros((100000, 2))).to_record()['points']
    for change, message in (({'version': 2}, 'version 2'), ({'version': None}, 'version'), ({'kind': 'SMELL'}, 'SMELL'),
                            ({'kind': 3}, 'kind 3'), ({'operation': 'XOR'}, 'XOR'), ({'radius': 'wide'}, 'radius'),
                            ({'radius': float('nan')}, 'radius'), ({'points': 5}, 'damaged'),
                            ({'points': {**good['points'], 'shape': [1 << 40, 2]}}, 'at most'),
                            ({'points': {**good['points'], 'shape': [-1, 2]}}, 'at most'),
                            ({'points': {**good['points'], 'shape': None}}, 'damaged'),
                            ({'points': {**good['points'], 'shape': [2, 2]}}, 'damaged'),
                            ({'points': {**bomb, 'shape': [1, 2]}}, 'damaged'),
                            ({'points': {**good['points'], 'data': '!'}}, 'damaged'),
                            ({'points': {**good['points'], 'shape': [1, 2, 1]}}, 'at most')):
        with pytest.raises(StippleError, match=message):
            Region.from_record({**good, **change})
    with pytest.raises(StippleError, match='not a record'):
        Region.from_record('brush')
    assert Region.from_record({**good, 'comment': 'is not read'}).radius == 3.0


def ground(count=40000, half=3.0, height=lambda u: np.zeros(len(u)), noise=0.0, seed=4, degree=1):
    """Flat splats over a square, each with its axes in the ground, in colours that vary with a period of ten splats."""
    rng = np.random.default_rng(seed)
    u = rng.uniform(-half, half, (count, 2))
    positions = np.c_[u, height(u) + noise * rng.normal(size=count)].astype(np.float32)
    spacing = 2 * half / np.sqrt(count)
    sh = np.zeros((count, (degree + 1) ** 2, 3), np.float32)
    sh[:, 0] = np.c_[0.3 * np.sin(20 * u[:, 0]), 0.3 * np.sin(20 * u[:, 1]), np.full(count, -0.1)] / C0
    sh[:, 2:3] = 0.2  # of z: which side is up
    return SplatArrays(positions, np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1)),
                       np.tile(np.array([0.7, 0.6, 0.05], np.float32) * np.float32(spacing), (count, 1)),
                       np.full(count, 0.9, np.float32), sh)


def filled(context, given, hole, **settings):
    task = regions.fill_start(Cloud.create(context, given), hole, FillSettings(**settings))
    task.job.wait()
    made = task.cloud().read()
    assert task.report.splat_count == len(made.positions)
    return made, task.report


def outcomes(report):
    return (report.hole_count, report.filled_count, report.no_ring_count, report.no_plane_count, report.covered_count)


def disc(given, centre, radius):
    return np.linalg.norm(given.positions[:, :2] - np.float32(centre), axis=1) < radius


CELL = 3 * 2 * 3.0 / 200  # splats are 0.03 apart: the edge of a hole is followed to two cells of 0.042


def test_a_filled_hole_is_as_dense_and_as_coloured_as_its_ring(context):
    given = ground()
    hole = disc(given, (0.2, -0.1), 0.7)
    made, report = filled(context, given, hole)
    assert outcomes(report) == (1, 1, 0, 0, 0)
    # 1200 splats were there; patches of about 160 are copied whole, so their number varies by so many.
    assert abs(len(made.positions) / hole.sum() - 1) < 0.1
    assert np.abs(made.positions[:, 2]).max() < 1e-6
    away = np.linalg.norm(made.positions[:, :2] - (0.2, -0.1), axis=1)
    assert away.max() < 0.7 + CELL
    # Evenly, too: as many in the inner half of the area as in the outer.
    assert abs((away < 0.7 / np.sqrt(2)).mean() - 0.5) < 0.06
    ring = disc(given, (0.2, -0.1), 1.4) & ~hole
    # Amplitudes are 1.06, and a patch has about a period of them.
    np.testing.assert_allclose(made.sh[:, 0].mean(axis=0), given.sh[ring, 0].mean(axis=0), atol=0.15)
    np.testing.assert_allclose(made.sh[:, 0].std(axis=0), given.sh[ring, 0].std(axis=0), atol=0.12)
    # Nothing else changes where the ground is a plane.
    for name in ('rotations', 'scales', 'opacities'):
        assert (np.isin(getattr(made, name), getattr(given, name))).all()
    np.testing.assert_array_equal(made.sh[:, 1:], np.broadcast_to(given.sh[0, 1:], made.sh[:, 1:].shape))


def test_copies_go_on_with_what_is_around_them(context):
    """Stripes along x: a colour at the edge of the hole differs little from that of the ground beside it."""
    given = ground()
    given.sh[:, 0, 0] = np.sign(np.sin(9 * given.positions[:, 1])) * 0.3 / C0
    hole = disc(given, (0, 0), 0.6)
    made, _ = filled(context, given, hole)
    wrong = np.sign(np.sin(9 * made.positions[:, 1])) != np.sign(made.sh[:, 0, 0])
    assert wrong.mean() < 0.2  # by chance it would be a half


def test_a_hole_in_a_slope_is_filled_in_the_slope(context):
    given = ground(noise=0.002)
    cloud = Cloud.create(context, given)
    angle = 0.6
    slope = np.eye(4)
    slope[1:3, 1:3] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    slope[:3, 3] = (5, -3, 2)
    tilted = cloud.transformed(slope).read()
    hole = disc(given, (0.5, 0.5), 0.6)
    made, report = filled(context, tilted, hole)
    assert outcomes(report) == (1, 1, 0, 0, 0)
    back = np.linalg.inv(slope)
    local = made.positions.astype(np.float64) @ back[:3, :3].T + back[:3, 3]
    assert np.linalg.norm(local[:, :2] - 0.5, axis=1).max() < 0.6 + CELL
    # The height over the ground is the source's: as much noise as there was, and around the same plane.
    assert abs(local[:, 2].std() / 0.002 - 1) < 0.1 and abs(local[:, 2].mean()) < 2e-4
    # A plane has one direction, so that nothing was turned but by the slope (the noise bends it a little).
    np.testing.assert_allclose(np.abs(made.rotations @ tilted.rotations[0]), 1, atol=1e-5)


def test_a_hole_in_a_sphere_is_filled_with_a_piece_of_it(context):
    radius = 12.0
    given = ground(height=lambda u: np.sqrt(radius ** 2 - (u ** 2).sum(axis=1)) - radius)
    hole = disc(given, (0.3, 0), 0.8)
    made, report = filled(context, given, hole)
    assert outcomes(report) == (1, 1, 0, 0, 0)
    middle = np.array([0, 0, -radius])
    away = np.linalg.norm(made.positions.astype(np.float64) - middle, axis=1)
    # A plane would be off by 0.8^2 / 24 = 0.027; the fourth order of the sphere is 0.0003.
    assert np.abs(away - radius).max() < 0.001
    # Every splat is turned as far as the sphere turns between its source and itself.
    w, x, y, z = made.rotations.astype(np.float64).T
    up = np.c_[2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
    outwards = (made.positions - middle) / away[:, None]
    flat = np.array([0, 0, 1.0])
    # All sources look straight up, so that a copy's direction less its source's is the turn itself.
    turns = np.arccos(np.clip(up @ flat, -1, 1))
    assert 0.01 < turns.max() < 3 / radius
    assert (np.abs(np.linalg.norm(made.rotations, axis=1) - 1) < 1e-6).all()
    assert outwards[:, 2].min() > 0.99
    # The harmonics turn, too: where a splat's up points, its colour is as strong as at its source.
    lengths = np.linalg.norm(made.sh[:, 1:4, 0], axis=1)
    np.testing.assert_allclose(lengths, 0.2, atol=1e-6)
    towards = made.sh[:, [3, 1, 2], 0] * (-1, -1, 1) / 0.2  # Y of degree 1: -y, z, -x
    np.testing.assert_allclose((towards * up).sum(axis=1), 1, atol=1e-5)


def test_holes_are_filled_one_by_one(context):
    given = ground(noise=0.003)
    places = [((1.6, 1.2), 0.5), ((-1.5, -1.0), 0.35), ((3.0, -1.5), 0.6)]  # the last is at the border
    hole = np.any([disc(given, *place) for place in places], axis=0)
    made, report = filled(context, given, hole)
    assert outcomes(report) == (3, 3, 0, 0, 0)
    inside = [np.linalg.norm(made.positions[:, :2] - centre, axis=1) < radius + CELL for centre, radius in places]
    assert np.any(inside, axis=0).all()
    for mine, (centre, radius) in zip(inside, places):
        # 430 to 750 splats are a few patches of about 160; along the border cells end beyond it.
        removed = disc(given, centre, radius).sum()
        assert abs(mine.sum() / removed - 1) < 0.2
    # Nothing grows where the cloud ended before.
    assert made.positions[:, 0].max() < 3.0 + CELL


def test_what_stood_on_the_ground_leaves_its_place_to_the_ground(context):
    """A box whose inside nobody has seen: only its sides are removed, and the ground below it was never there."""
    given = ground(noise=0.002)
    inside = (np.abs(given.positions[:, :2]) < 0.5).all(axis=1)
    rng = np.random.default_rng(8)
    side = rng.uniform(-0.5, 0.5, (6000, 3)) * (1, 1, 1.2) + (0, 0, 0.6)
    wall = rng.integers(0, 2, 6000)
    side[np.arange(6000), wall] = rng.choice([-0.5, 0.5], 6000)
    keep = ~inside
    total = SplatArrays(*(np.concatenate([getattr(given, name)[keep], getattr(given, name)[:6000]])
                          for name in ('positions', 'rotations', 'scales', 'opacities', 'sh')))
    total.positions[keep.sum():] = side
    hole = np.zeros(len(total.positions), bool)
    hole[keep.sum():] = True
    made, report = filled(context, total, hole)
    assert report.filled_count == 1 and report.splat_count == len(made.positions)
    assert np.abs(made.positions[:, 2]).max() < 0.02
    assert np.abs(made.positions[:, :2]).max() < 0.5 + CELL
    assert abs(len(made.positions) / inside.sum() - 1) < 0.15


def test_what_floats_over_whole_ground_is_not_filled(context):
    given = ground()
    given.positions[:200] = np.random.default_rng(2).uniform(-0.1, 0.1, (200, 3)) + (0.5, 0.5, 0.25)
    hole = np.arange(len(given.positions)) < 200
    made, report = filled(context, given, hole)
    assert outcomes(report) == (1, 0, 0, 0, 1) and len(made.positions) == 0


def test_groups_without_ground_are_reported(context):
    given = ground()
    given.positions[:50] = np.random.default_rng(2).uniform(-0.1, 0.1, (50, 3)) + (0, 0, 900)
    hole = disc(given, (1, 1), 0.4)
    hole[:50] = True
    made, report = filled(context, given, hole, radius=0.3)
    assert outcomes(report) == (2, 1, 1, 0, 0) and len(made.positions) > 0
    # A row of splats spans no plane.
    row = arrays(400)
    row.positions[:] = np.linspace(-1, 1, 400)[:, None] * (1, 2, 3)
    made, report = filled(context, row, np.abs(np.arange(400) - 200) < 20)
    assert outcomes(report) == (1, 0, 0, 1, 0) and len(made.positions) == 0


def test_a_seed_decides_and_the_number_of_threads_does_not(library):
    given = ground(20000, noise=0.003)
    hole = disc(given, (0, 0), 0.5)
    made = {}
    for threads in (1, 2, 4):
        made[threads] = filled(Context(library, threads=threads), given, hole, seed=5)[0].positions
    np.testing.assert_array_equal(made[1], made[2])
    np.testing.assert_array_equal(made[1], made[4])
    other = filled(Context(library, threads=2), given, hole, seed=6)[0].positions
    assert other.shape != made[1].shape or (other != made[1]).any()


def test_fill_refuses_what_is_no_hole(cloud):
    for mask, settings, message in ((np.zeros(4000), {}, 'removes no splats'), (np.ones(4000), {}, 'removes all'),
                                    (np.arange(4000) < 50, {'radius': -1.0}, 'radius is -1'),
                                    (np.arange(4000) < 50, {'ring_width': np.inf}, 'ring_width'),
                                    (np.arange(4000) < 50, {'patch_size': -2.0}, 'patch_size is -2')):
        with pytest.raises(StippleError, match=message):
            regions.fill_start(cloud, mask, FillSettings(**settings)).job.wait()
