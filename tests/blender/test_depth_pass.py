# SPDX-License-Identifier: GPL-3.0-or-later
"""The pass Depth beside the image's alpha: silhouettes of splats, alone, before meshes and among them."""

import bpy
import numpy as np
import pytest

import scenes
from shots import EMPTY, emission, prepare, set_panorama, splat_wall

ENGINES = ('STIPPLE', 'STIPPLE_CYCLES')


@pytest.fixture
def soft(stipple):
    """A square whose edges fade over eleven pixels: wide splats of 0.25 m, 20 pixels to the metre."""
    wall = splat_wall(stipple, 'soft', 1.0, side=1.0, colour=(0.1, 0.6, 0.2), count=8, opacity=0.8)
    arrays = stipple.scene.source.splat_data.read(wall.data)
    arrays.scales[:, :2] = 0.25
    stipple.scene.source.splat_data.write(wall.data, arrays)
    scenes.camera((0, 0, 6), width=60, height=60, type='ORTHO', ortho_scale=3.0)
    bpy.context.view_layer.use_pass_z = True
    return wall


def union_and_intersection(a, b):
    return (a & b).sum() / (a | b).sum()


@pytest.mark.parametrize('engine', ENGINES)
@pytest.mark.parametrize('behind', [None, 'world'])
def test_the_silhouette_is_where_half_of_a_pixel_is_covered(soft, tmp_path, depths, engine, behind):
    prepare(engine, True)
    alpha = scenes.render_pixels(tmp_path, 'alone')[..., 3]
    if behind == 'world':
        set_panorama()
        prepare(engine, False)
        depths.clear()
        assert (scenes.render_pixels(tmp_path, 'world')[..., 3] == 1).all()
    seen = depths[-1] < EMPTY
    # All that shows at all is twice as many pixels.
    assert (alpha > 1 / 255).sum() > 1.8 * seen.sum() and seen.sum() > 400
    # A pixel whose alpha is a half but for rounding may be either.
    assert union_and_intersection(seen, alpha >= 0.5) > 0.995
    np.testing.assert_allclose(depths[-1][seen], 5.0, atol=1e-3)


def test_a_mesh_behind_has_its_own_depth_up_to_there(soft, tmp_path, depths):
    prepare('STIPPLE_CYCLES', True)
    alpha = scenes.render_pixels(tmp_path, 'alone')[..., 3]
    emission(scenes.quad(size=6.0, offset=(0.0, 0.0, -4.0)))
    scenes.render_pixels(tmp_path, 'before')
    depth = depths[-1]
    np.testing.assert_allclose(np.where(depth < 7.5, depth - 5.0, depth - 10.0), 0.0, atol=2e-3)
    assert union_and_intersection(depth < 7.5, alpha >= 0.5) > 0.995


@pytest.mark.parametrize('engine', ENGINES)
def test_it_is_as_thin_as_a_meshs(soft, tmp_path, depths, engine):
    """The silhouettes of a ball of splats and of the mesh that it was made from differ by a pixel's width."""
    bpy.data.objects.remove(soft)
    ball = scenes.sphere(segments=64, rings=32)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    splats = scenes.make_splats(ball, anchors=8000)
    splats.hide_render, ball.hide_render = True, False
    bpy.context.view_layer.use_pass_z = True
    prepare('STIPPLE_CYCLES', True, 16)  # without splats Cycles' own
    mesh = scenes.render_pixels(tmp_path, 'mesh')[..., 3] >= 0.5
    splats.hide_render, ball.hide_render = False, True
    prepare(engine, True)
    scenes.render_pixels(tmp_path, 'splats')
    seen = depths[-1] < EMPTY
    # Radii in pixels, of discs of those areas: the ball has 20.
    radii = np.sqrt(np.array([mesh.sum(), seen.sum()]) / np.pi)
    assert abs(radii[0] - 20) < 0.3 and abs(radii[1] - radii[0]) < 1.0, radii


def test_a_matte_cuts_it(soft, tmp_path, depths):
    prepare('STIPPLE', True)
    scenes.quad(size=0.5, offset=(0.0, 0.0, 3.0))
    alpha = scenes.render_pixels(tmp_path)[..., 3]
    assert alpha[30, 30] == 0 and depths[-1][30, 30] == EMPTY
    assert union_and_intersection(depths[-1] < EMPTY, alpha >= 0.5) > 0.99
