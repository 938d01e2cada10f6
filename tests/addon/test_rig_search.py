# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras of fits: the library's against the same rules written down in numpy, in a scene of balls."""

import math

import numpy as np
import pytest

from stipple.binding.errors import StippleError
from stipple.binding.rig_search import RigSearch
from stipple.binding.structs import ViewRig

LOW, HIGH = np.array([-1.0, -0.8, -0.6]), np.array([1.0, 1.2, 0.6])
CENTRE, RADIUS = (LOW + HIGH) / 2, np.linalg.norm(HIGH - LOW) / 2
AROUND = math.radians(40)
# Both sides are double and take other orders of some tens of operations on numbers up to 10.
TOLERANCE = 1e-12


class Balls:
    """Hollow balls (centre, radius), as scene.ray_cast of Blender tells of them."""

    def __init__(self, *balls):
        self.balls, self.asked = balls, 0

    def __call__(self, rays):
        self.asked += len(rays)
        best, normals = np.full(len(rays), np.inf), np.zeros((len(rays), 3))
        objects = np.zeros(len(rays), np.uint32)
        for k, (centre, radius) in enumerate(self.balls):
            offset = rays[:, :3] - centre
            b = np.einsum('ij,ij->i', offset, rays[:, 3:6])
            root = b * b - np.einsum('ij,ij->i', offset, offset) + radius * radius
            for sign in (-1, 1):
                t = np.where(root >= 0, -b + sign * np.sqrt(np.maximum(root, 0)), np.inf)
                nearer = (t > 1e-9) & (t < best) & (t <= rays[:, 6])
                best[nearer], objects[nearer] = t[nearer], k
                normals[nearer] = (offset[nearer] + t[nearer, None] * rays[nearer, 3:6]) / radius
        return best, normals, objects, np.array([[2 * r] * 3 for _, r in self.balls]).reshape(-1, 3)


def radical_inverse(index, base):
    value, share = 0.0, 1.0 / base
    while index:
        index, digit = divmod(index, base)
        value, share = value + digit * share, share / base
    return value


def sphere(count, seed):
    turn = 2 * math.pi * radical_inverse(seed, 2)
    i = np.arange(count)
    z = 1 - (2 * i + 1) / count
    angle = turn + i * math.pi * (3 - math.sqrt(5))
    return np.stack((np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z), axis=1)


def looking(place, direction):
    """World to camera, OpenCV, with z up in the image."""
    right = np.cross(direction, (0, 0, 1))
    right /= np.linalg.norm(right)
    rotation = np.stack((right, np.cross(direction, right), direction))
    return np.vstack((np.column_stack((rotation, -rotation @ place)), (0, 0, 0, 1)))


def matrices(cameras):
    return np.array([list(camera.world_to_camera) for camera in cameras]).reshape(-1, 4, 4)


def places(cameras):
    return np.linalg.inv(matrices(cameras))[:, :3, 3]


def around(library, scene, count, **options):
    return RigSearch.create(library, LOW, HIGH, count, ViewRig.AROUND, **options).cameras(scene)


@pytest.mark.parametrize('seed', (0, 5))
def test_cameras_around_stand_on_a_sphere_and_nearer_where_something_is_between(library, seed):
    directions = sphere(30, seed)
    far = 1.05 * RADIUS / math.sin(AROUND / 2)
    wall = (CENTRE, 3.2)  # seen from within: no place beyond it is free to look in
    for scene, distance in ((Balls((CENTRE, 0.5)), far), (Balls((CENTRE, 0.5), wall), 0.9 * 3.2)):
        cameras = around(library, scene, 30, seed=seed, size=64)
        wanted = [looking(CENTRE + distance * d, -d) for d in directions]
        assert np.abs(matrices(cameras) - wanted).max() < TOLERANCE
        camera = cameras[7]
        assert (camera.width, camera.height, camera.cx) == (64, 64, 32)
        assert camera.fx == camera.fy == pytest.approx(32 / math.tan(AROUND / 2), rel=TOLERANCE)
        assert camera.near_plane == pytest.approx(1e-3 * RADIUS, rel=TOLERANCE)
        assert camera.far_plane == pytest.approx(2 * (distance + RADIUS), rel=TOLERANCE)


def test_cameras_do_not_stand_inside_of_things(library):
    far = 1.05 * RADIUS / math.sin(AROUND / 2)
    direction = sphere(20, 0)[4]
    # It begins before rays outwards do (1.001), so that nothing seems to be between.
    stone = (CENTRE + far * direction, far - 1.0005 * RADIUS)
    seen = places(around(library, Balls((CENTRE, 0.5), stone), 20))
    assert len(seen) == 20
    assert (np.linalg.norm(seen - stone[0], axis=1) > stone[1]).all()


def test_cameras_inside_stand_at_free_places(library):
    low, high = np.full(3, -2.0), np.full(3, 2.0)
    room, ball = (np.zeros(3), 2.0), (np.array([0.6, 0.3, -0.4]), 0.6)
    cameras = RigSearch.create(library, low, high, 25, ViewRig.INSIDE, seed=2).cameras(Balls(room, ball))
    directions, wanted, index = sphere(25, 2), [], 0
    while len(wanted) < 25:
        place = low + (0.1 + 0.8 * np.array([radical_inverse(index + 1 + 7919 * 2, base)
                                             for base in (2, 3, 5)])) * (high - low)
        probes = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)
                           if abs(x) + abs(y) + abs(z) in (1, 3)], float)
        probes /= np.linalg.norm(probes, axis=1, keepdims=True)
        rays = np.column_stack((np.tile(place, (14, 1)), probes, np.full(14, np.inf)))
        nearest = Balls(room, ball)(rays)[0].min()
        is_enclosed = np.linalg.norm(place) < room[1] and np.linalg.norm(place - ball[0]) > ball[1]
        if is_enclosed and nearest >= 0.05 * math.sqrt(12):
            wanted.append(looking(place, directions[len(wanted)]))
        index += 1
    assert np.abs(matrices(cameras) - wanted).max() < TOLERANCE
    assert cameras[0].fx == pytest.approx(200 / math.tan(math.radians(75) / 2), rel=TOLERANCE)


def test_a_room_is_told_by_the_viewer_in_it(library):
    scene = Balls((CENTRE, 1.5))

    def angle(viewer):
        search = RigSearch.create(library, LOW, HIGH, 1, viewer=viewer)
        camera = search.cameras(scene)[0]
        return math.degrees(2 * math.atan(0.5 * camera.width / camera.fx))

    assert angle(None) == pytest.approx(40)
    assert angle(CENTRE) == pytest.approx(75)
    assert angle(CENTRE + (0, 0, 5)) == pytest.approx(40)


def test_messages(library):
    for arguments, text in (((LOW, HIGH, 0), '0 views'), ((HIGH, LOW, 2), 'bounds_min'),
                            ((LOW, LOW * np.nan, 2), 'bounds_max')):
        with pytest.raises(StippleError, match=text):
            RigSearch.create(library, *arguments)
    with pytest.raises(StippleError, match='angle is 4'):
        RigSearch.create(library, LOW, HIGH, 2, angle=4.0)
    with pytest.raises(StippleError, match='0 of 2 cameras around'):
        around(library, Balls((CENTRE, 1.1 * RADIUS)), 2)
    with pytest.raises(StippleError, match='0 of 4 cameras find a free place'):
        RigSearch.create(library, LOW, HIGH, 4, ViewRig.INSIDE).cameras(Balls())
    search = RigSearch.create(library, LOW, HIGH, 2)
    with pytest.raises(StippleError, match='still asks 2 rays'):
        search._camera(0)
    with pytest.raises(StippleError, match='there are 0 answers; 2 rays were asked'):
        search._answer(np.empty(0), np.empty((0, 3)), np.empty(0), np.empty((0, 3)))
