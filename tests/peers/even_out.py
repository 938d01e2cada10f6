# SPDX-License-Identifier: GPL-3.0-or-later
"""How even Even Out Mesh leaves two meshes, beside a slow reference that needs no library.

    python3 tests/blender/run.py tests/peers/even_out.py -s

One is a ball with a side that was pulled out, as by the Grab brush, the other a box whose loop cuts crowd together at
one corner. The reference takes implicit steps: each vertex is drawn to its neighbours, to those of larger area more, all
at once by one dense system; edges of the box are divided evenly first, and then held. It prints a table and judges nothing.
"""

import bpy
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

import scenes
from uneven_meshes import CUTS, SIDE, crowded_box, pulled_ball


def arrays(obj):
    """Places [n,3] as they are shown, and triangles [F,3]."""
    mesh = obj.data
    key = mesh.shape_keys.key_blocks[-1].data if mesh.shape_keys else mesh.vertices
    places = np.empty(len(mesh.vertices) * 3)
    key.foreach_get('co', places)
    mesh.calc_loop_triangles()
    mesh_triangles = np.empty(len(mesh.loop_triangles) * 3, np.int32)
    mesh.loop_triangles.foreach_get('vertices', mesh_triangles)
    return places.reshape(-1, 3), mesh_triangles.reshape(-1, 3)


def area_vectors(places, triangles):
    a, b, c = (places[triangles[:, k]] for k in range(3))
    return 0.5 * np.cross(b - a, c - a)


def evened(places, triangles, land, normals, held, seconds, steps):
    """The reference: `steps` implicit steps of `seconds` each. land(places) brings places to the surface,
    normals(places) are its own there, or None where land() alone keeps places to it."""
    n, free = len(places), ~held
    edges = np.unique(np.sort(np.concatenate([triangles[:, k] for k in ([0, 1], [1, 2], [2, 0])]), 1), axis=0)
    i, j = edges.T
    for _ in range(steps):
        areas = np.zeros(n)
        np.add.at(areas, triangles, np.linalg.norm(area_vectors(places, triangles), axis=1)[:, None] / 3)
        weights = 0.5 * (areas[i] + areas[j]) / areas.mean()
        laplacian = np.zeros((n, n))
        laplacian[i, j] = laplacian[j, i] = -weights
        laplacian[np.arange(n), np.arange(n)] = -laplacian.sum(1)
        pull = -laplacian @ places
        across = normals(places)
        if across is not None:
            pull -= across * (pull * across).sum(1)[:, None]
        moved = np.zeros((n, 3))
        moved[free] = np.linalg.solve(laplacian[np.ix_(free, free)] + np.eye(free.sum()) / seconds, pull[free])
        places = land(places + moved)
    return places


def figures(name, places, triangles, before, normals):
    vectors = area_vectors(places, triangles)
    areas = np.linalg.norm(vectors, axis=1)
    lengths = np.stack([np.linalg.norm(places[triangles[:, k]] - places[triangles[:, k - 1]], axis=1)
                        for k in range(3)])
    shape = 4 * np.sqrt(3) * areas / (lengths ** 2).sum(0)
    turned = int(((vectors * normals(places[triangles].mean(1), before)).sum(1) <= 0).sum())
    print(f'{name:22} areas {areas.std() / areas.mean():5.2f}  edges {lengths.std() / lengths.mean():5.2f}  '
          f'shape {shape.mean():.3f}, of the worst hundredth {np.quantile(shape, 0.01):.3f}  turned over {turned}')


def by_operator(make, **settings):
    obj = make()
    scenes.select(obj)
    bpy.ops.stipple.mesh_even_out(**settings)
    return arrays(obj)[0]


def test_a_box_whose_loop_cuts_crowd(stipple):
    places, triangles = arrays(crowded_box())
    before = area_vectors(places, triangles)
    on = np.abs(np.abs(places) - SIDE / 2) < 1e-6
    lines = places.copy()
    on_lines = on.sum(1) == 2
    share = np.sqrt(places / SIDE + 0.5)  # of the way along its edge, counted in loop cuts
    lines[on_lines] = np.where(on, places, SIDE * (np.round(CUTS * share) / CUTS - 0.5))[on_lines]
    reference = evened(lines, triangles, lambda p: np.where(on, lines, p), lambda _: None, on.sum(1) > 1, 10.0, 20)
    report('box', crowded_box, places, reference, triangles, lambda _centres, first: first, before)


def test_a_ball_that_was_pulled(stipple):
    places, triangles = arrays(pulled_ball())
    tree = BVHTree.FromPolygons([Vector(p) for p in places], triangles.tolist())

    def nearest(which):
        return lambda points, *_: np.array([tree.find_nearest(Vector(p))[which] for p in points])
    reference = evened(places, triangles, nearest(0), nearest(1), np.zeros(len(places), bool), 1.0, 24)
    report('ball', pulled_ball, places, reference, triangles, nearest(1), None)


def report(name, make, places, reference, triangles, normals, before):
    print()
    figures(f'{name}, given', places, triangles, before, normals)
    for density in ('UNIFORM', 'ADAPTIVE'):
        made = by_operator(make, density=density)
        figures(f'{name}, {density.title()}', made, triangles, before, normals)
    figures(f'{name}, reference', reference, triangles, before, normals)
