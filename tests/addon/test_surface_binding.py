# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats bound to a mesh, through the binding."""

import numpy as np
import pytest

from stipple.binding.cloud import SplatArrays
from stipple.binding.errors import StippleError
from stipple.binding.model import DecodeSettings, Model
from stipple.binding.structs import BindingReach, Status
from stipple.binding.surface_binding import SurfaceBinding, asset_rest, bind_asset

REST = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)


def splats_on_the_square(context, count=50):
    rng = np.random.default_rng(3)
    positions = np.concatenate([rng.uniform(0.05, 0.95, (count, 2)), np.zeros((count, 1))], axis=1)
    return SplatArrays(positions.astype(np.float32), np.tile(np.float32([1, 0, 0, 0]), (count, 1)),
                       np.full((count, 3), 0.01, np.float32), np.full(count, 0.5, np.float32),
                       rng.normal(size=(count, 4, 3)).astype(np.float32)).to_cloud(context)


def bound(cloud, reach=BindingReach.SURFACE, rest=REST, triangles=TRIANGLES):
    job = SurfaceBinding.start(cloud, rest, triangles, reach)
    job.wait()
    return SurfaceBinding.of_job(job)


def test_splats_go_where_their_triangles_go(context):
    cloud = splats_on_the_square(context)
    binding = bound(cloud)
    # A quarter turn about X, and 3 m along Y: a rotation of the whole mesh moves every splat likewise.
    turned = np.stack([REST[:, 0], 3 - REST[:, 2], REST[:, 1]], axis=1)
    before, after = cloud.read(), binding.carry(cloud, turned).read()
    wanted = np.stack([before.positions[:, 0], 3 - before.positions[:, 2], before.positions[:, 1]], axis=1)
    # Float32 at places of 3 m, after two sums.
    np.testing.assert_allclose(after.positions, wanted, atol=2e-6)
    half = np.sqrt(0.5)
    np.testing.assert_allclose(np.abs(after.rotations @ [half, half, 0, 0]), 1, atol=1e-6)
    np.testing.assert_allclose(after.scales, before.scales, rtol=1e-5)
    np.testing.assert_array_equal(after.opacities, before.opacities)
    np.testing.assert_array_equal(after.sh[:, 0], before.sh[:, 0])
    # Harmonics of degree 1 are a vector and turn with the mesh: their size stays, they do not.
    np.testing.assert_allclose(np.linalg.norm(after.sh[:, 1:], axis=1), np.linalg.norm(before.sh[:, 1:], axis=1),
                               rtol=1e-5)
    assert np.abs(after.sh[:, 1:] - before.sh[:, 1:]).max() > 0.1


def test_at_rest_nothing_moves(context):
    cloud = splats_on_the_square(context)
    for reach in BindingReach:
        after = bound(cloud, reach).carry(cloud, REST).read()
        np.testing.assert_allclose(after.positions, cloud.read().positions, atol=1e-6)


def test_info_tells_meshes_apart(context):
    cloud = splats_on_the_square(context)
    info = bound(cloud).info()
    assert (info.splat_count, info.vertex_count, info.triangle_count, info.influences) == (50, 4, 2, 1)
    assert bound(cloud, rest=2 * REST).info().topology == info.topology
    assert bound(cloud, triangles=TRIANGLES[::-1].copy()).info().topology != info.topology


@pytest.mark.parametrize('spoil, words', [
    (lambda: (REST * np.float32('nan'), TRIANGLES), 'not finite'),
    (lambda: (REST, TRIANGLES + 2), 'vertex 4 of 4'),
    (lambda: (np.zeros_like(REST), TRIANGLES), 'no triangle with an area'),
    (lambda: (REST, np.empty((0, 3), np.uint32)), 'no triangle with an area')])
def test_meshes_that_nothing_can_follow_are_refused(context, spoil, words):
    with pytest.raises(StippleError, match=words) as caught:
        bound(splats_on_the_square(context), rest=spoil()[0], triangles=spoil()[1])
    assert caught.value.status == Status.ERROR_INVALID_ARGUMENT


def test_shapes_that_do_not_fit_are_refused(context):
    cloud = splats_on_the_square(context)
    binding = bound(cloud)
    with pytest.raises(StippleError, match='3 vertices; splats are bound to one of 4'):
        binding.carry(cloud, REST[:3])
    with pytest.raises(StippleError, match='not finite'):
        binding.carry(cloud, REST + np.float32('inf'))
    with pytest.raises(StippleError, match='binding is of 50 splats; there are 20'):
        binding.carry(splats_on_the_square(context, 20), REST)
    with pytest.raises(StippleError, match=r'\[V,3\] is needed'):
        binding.carry(cloud, REST[0])


def test_a_small_limit_refuses_before_anything_is_made(library):
    from stipple.binding.context import Context
    small = Context(library, 1, 4096)
    cloud = splats_on_the_square(small, 20)
    with pytest.raises(StippleError) as caught:
        bound(cloud, rest=np.tile(REST, (1000, 1)))
    assert caught.value.status == Status.ERROR_MEMORY_LIMIT


def test_an_asset_brings_the_mesh_that_its_splats_follow(context, root, tmp_path):
    asset, out = root / 'tests' / 'data' / 'assets' / 'surface_1.0.stipple.safetensors', tmp_path / 'bound.safetensors'
    assert asset_rest(context, asset) is None
    bind_asset(context, asset, REST, TRIANGLES, BindingReach.AROUND, out)
    rest, triangles, reach = asset_rest(context, out)
    assert rest.tolist() == REST.tolist() and triangles.tolist() == TRIANGLES.tolist()
    assert reach == BindingReach.AROUND
    # The model beside it is the same.
    before, after = (Model.load(context, path).decode(DecodeSettings(50)).read() for path in (asset, out))
    assert before.positions.tolist() == after.positions.tolist()
    with pytest.raises(StippleError, match='name vertex 5'):
        bind_asset(context, asset, REST, TRIANGLES + 2, BindingReach.SURFACE, out)
    # A file whose faces were changed without its topology.
    damaged = bytearray(out.read_bytes())
    where = damaged.find(np.ascontiguousarray(TRIANGLES, '<u4').tobytes())
    damaged[where] ^= 1
    out.write_bytes(damaged)
    with pytest.raises(StippleError, match='the file is damaged'):
        asset_rest(context, out)
