# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that take another shape, through the binding."""

import time

import numpy as np
import pytest

from stipple.binding.cloud import SplatArrays
from stipple.binding.cloud_edit import select_mesh_start
from stipple.binding.errors import CancelledError, StippleError
from stipple.binding.mesh import Mesh
from stipple.binding.mesh_adapt import Adaptation, adapt_report, start_adapt
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


def test_a_job_shows_its_shape_and_ends_with_it(context):
    template, target = mesh_of(context, *ball()), mesh_of(context, ball(12)[0] * EGG, ball(12)[1])
    job = start_adapt(template, target, steps=1000000, target_count=2000, report_count=0)
    while (shown := job.preview()) is None:
        time.sleep(0.001)
    job.finish()
    job.wait()
    positions, triangles = shown.read()
    np.testing.assert_array_equal(triangles, ball()[1])
    assert not np.array_equal(positions, ball()[0])
    assert 1 <= adapt_report(job).step_count < 1000000
    assert not np.array_equal(Mesh.of_job(job).read()[0], ball()[0])


def test_other_jobs_show_no_shape(context):
    count = 4
    cloud = SplatArrays(np.eye(4, 3, dtype=np.float32), np.tile(np.float32([1, 0, 0, 0]), (count, 1)),
                        np.full((count, 3), 0.02, np.float32), np.full(count, 0.8, np.float32),
                        np.zeros((count, 1, 3), np.float32)).to_cloud(context)
    job = select_mesh_start(cloud, np.eye(4), mesh_of(context, *ball())).job
    job.wait()
    for function in (Adaptation.preview, Adaptation.finish):
        with pytest.raises(StippleError, match='does not adapt a mesh'):
            function(job)


def test_vertices_slide_along_their_own_surface(context):
    """A ball whose vertices were drawn to its top."""
    positions, triangles = ball(12)
    squeezed = positions + np.float32([0, 0, 0.35]) * (1 - positions[:, 2:] ** 2)
    given = (squeezed / np.linalg.norm(squeezed, axis=1, keepdims=True)).astype(np.float32)
    job = start_adapt(mesh_of(context, given, triangles), mesh_of(context, given, triangles), steps=200,
                      target_count=4000, density=MeshDensity.UNIFORM, lands_on_target=1)
    job.wait()
    places, _ = Mesh.of_job(job).read()
    assert spread_of_edges(places, triangles) < 0.8 * spread_of_edges(given, triangles)
    # Vertices land on faces, whose corners are on the unit sphere: an edge of length e lies e²/8 inside it, and the
    # middle of a triangle e²/6.
    longest = np.linalg.norm(given[triangles] - given[np.roll(triangles, 1, axis=1)], axis=2).max()
    radii = np.linalg.norm(places, axis=1)
    assert radii.max() < 1 + 1e-6 and radii.min() > 1 - longest ** 2 / 6
    assert adapt_report(job).distance_after < 0.01


def spread_of_edges(positions, triangles):
    """Standard deviation of the edges' lengths, of their mean."""
    edges = np.linalg.norm(positions[triangles] - positions[np.roll(triangles, 1, axis=1)], axis=2)
    return edges.std() / edges.mean()


@pytest.mark.parametrize('target, settings, words', [
    ((np.zeros((0, 3)), None), {}, 'exactly one must be given|0 points'),
    ((np.full((5, 3), np.nan), None), {}, 'finite number'),
    ((np.ones((5, 3)), None), {}, 'no extent'),
    ((np.eye(3), np.eye(3)[:2]), {}, '2 normals'),
    ((np.eye(3), None), {'landmarks': [(10**6, [0, 0, 0])]}, 'vertex 1000000 of the template'),
    ((np.eye(3), None), {'strength': -1.0}, 'strength'),
    ((np.eye(3), None), {'lands_on_target': 1}, 'no triangles'),
    ((np.eye(3), None), {'lands_on_target': 2}, 'options->lands_on_target is 2'),
    ((np.eye(3), None), {'density': 3}, 'options->density is 3'),
    ((np.eye(3), None), {'alignment': 4}, 'options->alignment is 4')])
def test_bad_input_gets_one_sentence(context, target, settings, words):
    with pytest.raises(StippleError, match=words) as caught:
        adapted(context, target, **settings)
    assert caught.value.status == Status.ERROR_INVALID_ARGUMENT
