# SPDX-License-Identifier: GPL-3.0-or-later
"""Holdouts and Indirect Only, of objects and of collections, under both engines."""

import bpy
import numpy as np
import pytest

import scenes
from shots import EMPTY, MESH, SPLAT, camera, mesh_between, prepare, set_world, splat_wall  # noqa: F401

ENGINES = ('STIPPLE', 'STIPPLE_CYCLES')
BLUE = (0.1, 0.1, 0.7)


def in_collection(obj, **settings):
    """Moves an object into a collection of its own with these settings of the view layer."""
    kept = bpy.data.collections.new('kept')
    for old in obj.users_collection:
        old.objects.unlink(obj)
    kept.objects.link(obj)
    bpy.context.scene.collection.children.link(kept)
    for name, value in settings.items():
        setattr(bpy.context.view_layer.layer_collection.children['kept'], name, value)
    return kept


def hold_out(obj, how):
    if how == 'collection':
        in_collection(obj, holdout=True)
    else:
        obj.is_holdout = True


# In mesh_between's pictures the quad covers pixels 20..40, the front splats 10..30 in x, and 20..40 in y both.

@pytest.mark.parametrize('how', ['object', 'collection'])
@pytest.mark.parametrize('engine', ENGINES)
def test_splats_hold_out_what_is_behind_them(stipple, camera, tmp_path, depths, engine, how):
    mesh_between(stipple)
    hold_out(bpy.data.objects['front'], how)
    prepare(engine).stipple.meshes_as_mattes = False
    bpy.context.view_layer.use_pass_z = True
    picture = scenes.render_pixels(tmp_path)
    # Three splats of 0.98 over each other let 1e-4 pass at most.
    assert np.abs(picture[25:35, 15:25]).max() < 2e-3
    assert picture[30, 45, 3] > 0.98 and abs(depths[-1][30, 45] - 7.0) < 0.01
    np.testing.assert_allclose(picture[30, 45, :3], SPLAT, atol=0.03)
    if engine == 'STIPPLE_CYCLES':
        np.testing.assert_allclose(picture[30, 35], (*MESH, 1.0), atol=1e-5)
    front = bpy.data.objects['front']
    front.hide_render = True
    assert scenes.render_pixels(tmp_path, 'without')[30, 25, 3] > 0.98


@pytest.mark.parametrize('how', ['object', 'collection'])
@pytest.mark.parametrize('engine', ENGINES)
def test_meshes_hold_splats_out_by_depth(stipple, camera, tmp_path, depths, engine, how):
    quad = mesh_between(stipple)
    hold_out(quad, how)
    prepare(engine).stipple.meshes_as_mattes = False  # holdouts are mattes all the same
    bpy.context.view_layer.use_pass_z = True
    picture = scenes.render_pixels(tmp_path)
    np.testing.assert_array_equal(picture[22:38, 33:38], 0.0)
    assert (depths[-1][22:38, 33:38] == EMPTY).all()
    # In front of it splats show, beside it those behind.
    np.testing.assert_allclose(picture[30, 25, :3], BLUE, atol=0.03)
    np.testing.assert_allclose(picture[30, 45, :3], SPLAT, atol=0.03)
    assert picture[30, 25, 3] > 0.98 and picture[30, 45, 3] > 0.98


@pytest.mark.parametrize('engine', ENGINES)
def test_a_matte_that_is_off_hides_nothing(stipple, camera, tmp_path, engine):
    """The picture of the test above without the holdout: what it must not be."""
    mesh_between(stipple)
    prepare(engine).stipple.meshes_as_mattes = False
    assert scenes.render_pixels(tmp_path)[30, 35, 3] > 0.98


@pytest.mark.parametrize('engine', ENGINES)
def test_half_transparent_holdouts_leave_their_share(stipple, camera, tmp_path, engine):
    """A thin holdout before splats: colour, alpha and what passes are shares of one light."""
    splat_wall(stipple, 'behind', -1.0, count=25)
    thin = splat_wall(stipple, 'thin', 1.0, count=25, opacity=0.1)
    scene = prepare(engine)
    whole = scenes.render_pixels(tmp_path, 'whole')
    thin.hide_render = True
    behind = scenes.render_pixels(tmp_path, 'behind')
    thin.hide_render, thin.is_holdout = False, True
    held = scenes.render_pixels(tmp_path, 'held')
    middle = np.s_[20:40, 20:40]
    share = held[middle][..., 3] / behind[middle][..., 3]
    assert 0.3 < share.min() and share.max() < 0.7
    # Colours of what shows do not change.
    np.testing.assert_allclose(held[middle][..., :3], share[..., None] * behind[middle][..., :3], atol=1e-4)
    assert (held[middle][..., 3] < whole[middle][..., 3] - 0.2).all()
    # Over an opaque world the hole stays a hole.
    set_world((0.5, 0.5, 0.5))
    scene.render.film_transparent = False
    opaque = scenes.render_pixels(tmp_path, 'opaque')
    np.testing.assert_allclose(opaque[middle][..., 3], share, atol=0.02)
    np.testing.assert_allclose(opaque[3, 3], (0.5, 0.5, 0.5, 1.0), atol=1e-5)


def test_holdouts_in_an_opaque_film_are_cycles_own(stipple, camera, tmp_path):
    """Without splats in view: alpha and world around a holdout are what Cycles makes of them."""
    splat_wall(stipple, 'far away', 0.0).location.x = 50.0
    ball = scenes.sphere(radius=0.8)
    ball.is_holdout = True
    set_world()
    scene = prepare('CYCLES', False, samples=64)
    expected = scenes.render_pixels(tmp_path, 'cycles')
    assert expected[30, 30, 3] == 0.0 and expected[3, 3, 3] == 1.0
    scene.render.engine = 'STIPPLE_CYCLES'
    seen = scenes.render_pixels(tmp_path, 'both')
    # At its edge our matte has 4 x 4 samples of a pixel, Cycles 64 with another filter.
    inside = np.abs(np.hypot(*np.meshgrid(np.arange(60) - 29.5, np.arange(60) - 29.5)) - 16) > 2.5
    np.testing.assert_allclose(seen[inside], expected[inside], atol=2e-6)
    assert np.abs(seen - expected).max() < 0.35


def test_an_instance_holds_out_as_its_instancer(stipple, camera, tmp_path):
    """As in Cycles: the object that is instanced is not asked."""
    splat_wall(stipple, 'behind', -1.0)
    front = splat_wall(stipple, 'front', 1.0, side=1.0, colour=BLUE)
    kept = bpy.data.collections.new('source')
    bpy.context.scene.collection.objects.unlink(front)
    kept.objects.link(front)
    empty = scenes.link(bpy.data.objects.new('empty', None))
    empty.instance_type, empty.instance_collection = 'COLLECTION', kept
    for engine in ENGINES:
        prepare(engine)
        front.is_holdout, empty.is_holdout = True, False
        np.testing.assert_allclose(scenes.render_pixels(tmp_path)[30, 30, :3], BLUE, atol=0.03)
        front.is_holdout, empty.is_holdout = False, True
        assert np.abs(scenes.render_pixels(tmp_path)[30, 30]).max() < 2e-3


@pytest.mark.parametrize('engine', ENGINES)
def test_indirect_only_is_not_seen(stipple, camera, tmp_path, engine):
    mesh_between(stipple)
    in_collection(bpy.data.objects['front'], indirect_only=True)
    prepare(engine)
    picture = scenes.render_pixels(tmp_path)
    if engine == 'STIPPLE':
        np.testing.assert_array_equal(picture[30, 25], 0.0)  # the quad's hole
    else:
        np.testing.assert_allclose(picture[30, 25], (*MESH, 1.0), atol=1e-5)
    assert picture[30, 45, 3] > 0.98


@pytest.mark.parametrize('engine', ENGINES)
def test_meshes_that_are_indirect_only_hide_nothing(stipple, camera, tmp_path, engine):
    quad = mesh_between(stipple)
    in_collection(quad, indirect_only=True)
    prepare(engine)
    np.testing.assert_allclose(scenes.render_pixels(tmp_path)[30, 35, :3], SPLAT, atol=0.03)


@pytest.mark.parametrize('engine', ENGINES)
def test_render_visibility(stipple, camera, tmp_path, engine):
    mesh_between(stipple)
    front = bpy.data.objects['front']
    prepare(engine)
    bpy.data.objects['Quad'].hide_render = True
    for name in ('hide_render', 'visible_camera', 'collection'):
        if name == 'collection':
            in_collection(front).hide_render = True
        else:
            setattr(front, name, name == 'hide_render')
        np.testing.assert_allclose(scenes.render_pixels(tmp_path, name)[30, 25, :3], SPLAT, atol=0.03)
        front.hide_render, front.visible_camera = False, True
