# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that take another shape, through the binding."""

import numpy as np
import pytest

from stipple.binding.cloud import SplatArrays
from stipple.binding.errors import CancelledError, StippleError
from stipple.binding.mesh import Mesh
from stipple.binding.mesh_adapt import adapt_report, start_adapt
from stipple.binding.structs import MeshAlignment, MeshDensity, Status

QUICK = {'steps': 60, 'target_count': 2000, 'report_count': 2000}


def ball(side=8):
    """(positions, triangles) of a unit sphere: the hull of a cube's grid of 6 side^2 quads."""
    grid = np.linspace(-1, 1, side + 1)
    rows, index = [], {}

    def vertex(p):
        key = tuple(np.round(p, 6))
        if key not in index:
            index[key] = len(rows)
            rows.append(p / np.linalg.norm(p))
        return index[key]

    triangles = []
    for axis in range(3):
        for sign in (-1, 1):
            for i in range(side):
                for j in range(side):
                    quad = []
                    for a, b in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)):
                        p = np.empty(3)
                        p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3] = sign, grid[a], grid[b]
                        quad.append(vertex(p))
                    a, b, c, d = quad if sign > 0 else quad[::-1]
                    triangles += [(a, b, c), (a, c, d)]
    return np.array(rows, np.float32), np.array(triangles, np.uint32)


def mesh_of(context, positions, triangles):
    mesh = Mesh.create(context)
    mesh.add_material()
    mesh.add_part(positions, triangles, np.eye(4))
    return mesh


def adapted(context, target, **settings):
    job = start_adapt(mesh_of(context, *ball()), target, **{**QUICK, **settings})
    job.wait()
    return Mesh.of_job(job).read(), adapt_report(job)


EGG = np.float32([1.2, 0.8, 0.6])


def test_a_template_takes_the_shape_of_a_mesh(context):
    positions, triangles = ball(12)
    (places, faces), report = adapted(context, mesh_of(context, positions * EGG, triangles))
    np.testing.assert_array_equal(faces, ball()[1])
    assert report.is_measured and report.has_normals and not report.turned_normals
    assert report.place_count == len(places) and report.loose_count == 0
    assert report.distance_after < 0.2 * report.distance_before
    np.testing.assert_allclose(np.linalg.norm(places / EGG, axis=1), 1, atol=0.15)


def test_points_and_splats_are_targets(context):
    positions, _ = ball(16)
    normals = positions / EGG
    _, report = adapted(context, (positions * EGG, normals))
    assert report.distance_after < 0.06 and report.has_normals
    _, report = adapted(context, (positions * EGG, None))
    assert report.distance_after < 0.06 and not report.has_normals
    count = len(positions)
    cloud = SplatArrays(positions * EGG, np.tile(np.float32([1, 0, 0, 0]), (count, 1)),
                        np.full((count, 3), 0.02, np.float32), np.full(count, 0.8, np.float32),
                        np.zeros((count, 1, 3), np.float32)).to_cloud(context)
    _, report = adapted(context, cloud)
    assert report.distance_after < 0.06


def test_settings_reach_the_library(context):
    target = mesh_of(context, ball(12)[0] * EGG * 5 + np.float32([9, 0, 0]), ball(12)[1])
    _, report = adapted(context, target, alignment=MeshAlignment.SIZE, density=MeshDensity.OFF, report_count=0)
    assert not report.is_measured and report.distance_after == 0
    _, report = adapted(context, target, alignment=MeshAlignment.SIMILARITY)
    assert report.distance_after < 0.3


def test_a_job_can_be_cancelled(context):
    target = mesh_of(context, *ball(12))
    job = start_adapt(mesh_of(context, *ball()), target, steps=1000000)
    job.cancel()
    with pytest.raises(CancelledError):
        job.wait()
    with pytest.raises(StippleError):
        Mesh.of_job(job)


@pytest.mark.parametrize('target, settings, words', [
    ((np.zeros((0, 3)), None), {}, 'exactly one must be given|0 points'),
    ((np.full((5, 3), np.nan), None), {}, 'finite number'),
    ((np.ones((5, 3)), None), {}, 'no extent'),
    ((np.eye(3), np.eye(3)[:2]), {}, '2 normals'),
    ((np.eye(3), None), {'landmarks': [(10**6, [0, 0, 0])]}, 'vertex 1000000 of the template'),
    ((np.eye(3), None), {'strength': -1.0}, 'strength'),
    ((np.eye(3), None), {'density': 3}, 'options->density is 3'),
    ((np.eye(3), None), {'alignment': 4}, 'options->alignment is 4')])
def test_bad_input_gets_one_sentence(context, target, settings, words):
    with pytest.raises(StippleError, match=words) as caught:
        adapted(context, target, **settings)
    assert caught.value.status == Status.ERROR_INVALID_ARGUMENT
