# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadow catchers under Cycles + Stipple: what they change, and what they do not, against plain Cycles."""

import bpy
import numpy as np
import pytest

import scenes
from shots import emission, prepare, set_panorama, splat_wall

SAMPLES = 24
# What has the same random numbers differs by rounding alone: of the world's light, which comes apart and is added
# again, by 2e-6, and of a shadow's factor in single precision over values of 2 at most.
ROUNDING = 1e-5


def sun(angle=0.0, energy=3.0):
    obj = scenes.link(bpy.data.objects.new('sun', bpy.data.lights.new('sun', 'SUN')))
    obj.data.energy, obj.data.angle = energy, angle
    obj.rotation_euler = (0.6, 0.5, 0.0)
    return obj


def catcher_plane(size=4.0):
    plane = scenes.quad('catcher', size=size)
    plane.is_shadow_catcher = True
    return plane


def look_along_the_floor():
    """The floor ends before the horizon, on three sides."""
    return scenes.camera((0.0, -7.0, 2.2), (1.3, 0.0, 0.0), width=120, height=90, lens=40)


def splats_out_of_sight(stipple):
    """So that the engine does its work, and no splat shows."""
    splat_wall(stipple, 'out of sight', 0.0, count=4).location.y = -50.0


def around(mask, steps):
    """The pixels of a mask, and those up to so many away."""
    for _ in range(steps):
        wide = np.pad(mask, 1)
        mask = wide[1:-1, 1:-1] | wide[2:, 1:-1] | wide[:-2, 1:-1] | wide[1:-1, 2:] | wide[1:-1, :-2]
    return mask


def edges_of(alpha):
    return (alpha > 0) & (alpha < 1)


@pytest.mark.parametrize('transparent', [True, False])
def test_where_no_splats_are_the_picture_is_plain_cycles(stipple, tmp_path, transparent):
    """At 24 samples, over a world of many colours: shadows on the catcher, and its ends before the world."""
    splats_out_of_sight(stipple)
    plane = catcher_plane()
    ball = scenes.sphere(radius=0.5)
    ball.location = (0.3, -0.2, 0.6)
    set_panorama()
    sun(angle=0.05)
    look_along_the_floor()
    scene = prepare('CYCLES', transparent, SAMPLES)
    expected = scenes.render_pixels(tmp_path, 'cycles')
    scene.render.engine = 'STIPPLE_CYCLES'
    seen = scenes.render_pixels(tmp_path, 'both')
    scene.render.engine, plane.hide_render = 'CYCLES', True
    bare = scenes.render_pixels(tmp_path, 'bare')
    scene.render.film_transparent = True
    ball_edge = around(edges_of(scenes.render_pixels(tmp_path, 'ball')[..., 3]), 1)
    plane.hide_render, plane.is_shadow_catcher, ball.hide_render = False, False, True
    plane_end = around(edges_of(scenes.render_pixels(tmp_path, 'plane')[..., 3]), 1) & ~ball_edge
    # At a mesh's edge Cycles counts what is behind twice over: its catcher is an approximation there.
    rest = ~ball_edge & ~plane_end
    np.testing.assert_allclose(seen[rest], expected[rest], atol=ROUNDING)
    # A quarter of a step of 8 bits: at its end Cycles has the world behind the catcher from other directions of the
    # pixel than beside it, which makes 4e-4 here.
    np.testing.assert_allclose(seen[plane_end], expected[plane_end], atol=1e-3)
    assert np.abs(bare - expected)[plane_end].max() > 0.01, 'no shadow crosses the end of the plane'
    assert ball_edge.mean() < 0.06 and 0.01 < plane_end.mean() < 0.1


def test_a_catcher_that_catches_nothing_changes_nothing(stipple, tmp_path):
    """Its end before the world, before splats, and a mesh behind it."""
    floor = splat_wall(stipple, 'floor', 0.0, side=3.0, colour=(0.5, 0.5, 0.5), count=60, opacity=0.6)
    floor.location.y = -0.5
    behind = scenes.quad('behind', size=1.5)
    # Below the catcher's face: Blender 5.2 lets it shine on catchers though diffuse rays do not see it.
    behind.rotation_euler.x, behind.location = 1.5708, (-1.0, 3.0, -0.8)
    emission(behind)
    behind.visible_diffuse = behind.visible_shadow = False
    set_panorama()
    look_along_the_floor()
    scene = prepare('STIPPLE_CYCLES', False, SAMPLES)
    expected = scenes.render_pixels(tmp_path, 'without')
    plane = catcher_plane()
    seen = scenes.render_pixels(tmp_path, 'with')
    np.testing.assert_allclose(seen, expected, atol=ROUNDING)
    # A closed one, as Splats to Mesh makes it, around a part of it all.
    bpy.data.objects.remove(plane)
    behind.hide_render = True
    expected = scenes.render_pixels(tmp_path, 'alone')
    box = scenes.sphere('box', segments=16, rings=8, radius=1.2)
    box.is_shadow_catcher, box.visible_shadow = True, False
    box.location.y = 1.0
    np.testing.assert_allclose(scenes.render_pixels(tmp_path, 'closed'), expected, atol=ROUNDING)
    assert scene.render.film_transparent is False and box.is_shadow_catcher and box.visible_camera


def test_a_soft_shadow_is_no_noisier_at_the_end_of_its_catcher(stipple, tmp_path):
    """The end of a plane in half shadow, under a floor of splats that goes on: the pixels there have their part of the
    shadow, with no more noise, and no dark line."""
    splat_wall(stipple, 'floor', 0.0, side=5.0, colour=(0.5, 0.5, 0.5), count=100)
    catcher_plane(2.03)  # its end is in the middle of a pixel
    card = scenes.quad('card', size=2.0)
    card.location = (0.0, 0.0, 1.0)
    card.visible_camera = False
    sun(angle=1.5).rotation_euler = (0.0, 0.9, 0.0)
    scenes.camera((0.0, 0.0, 6.0), width=90, height=90, type='ORTHO', ortho_scale=3.0)
    scene = prepare('STIPPLE_CYCLES', True, SAMPLES)
    few = scenes.render_pixels(tmp_path, 'few')[..., 0]
    scene.cycles.samples = 512
    many = scenes.render_pixels(tmp_path, 'many')[..., 0]
    assert 0.1 < (many[45, 45] / many[3, 3]) < 0.8  # in half shadow; splats beyond the plane have none
    error = np.abs(few - many)
    # 30 pixels to the metre: the plane is from 0.55 of column 14 to 0.45 of column 75.
    inside, end = error[20:70, 20:70], np.concatenate([error[20:70, 13:17].ravel(), error[13:17, 20:70].ravel(),
                                                       error[20:70, 73:77].ravel()])
    noise = np.sqrt((inside ** 2).mean())
    assert noise > 1e-3
    # The largest of 600 normal deviates is 4.3 at most in 99 of 100 draws; one pixel of the edge belongs to it by half.
    assert np.sqrt((end ** 2).mean()) <= 1.2 * noise and end.max() <= 5 * noise
    # And the shadow of the pixel at the end is as deep as the plane's part of it, about a half.
    for picture in (few, many):
        along = picture[20:70].mean(axis=0)
        for end_column, inner, outer in ((14, slice(15, 18), 11), (75, slice(72, 75), 78)):
            half = 0.5 * (along[inner].mean() + along[outer])
            assert abs(along[end_column] - half) < 0.1 * along[outer], (along[9:20], along[70:81])


def test_the_catcher_of_an_instance_is_one(stipple, tmp_path):
    splats_out_of_sight(stipple)
    kept = bpy.data.collections.new('kept')
    kept.objects.link(scenes.quad('plane', size=4.0))
    bpy.context.scene.collection.objects.unlink(bpy.data.objects['plane'])
    empty = scenes.link(bpy.data.objects.new('empty', None))
    empty.instance_type, empty.instance_collection, empty.is_shadow_catcher = 'COLLECTION', kept, True
    ball = scenes.sphere(radius=0.5)
    ball.location = (0.3, -0.2, 0.6)
    sun()
    look_along_the_floor()
    scene = prepare('CYCLES', True, SAMPLES)
    expected = scenes.render_pixels(tmp_path, 'cycles')
    assert expected[30:45, 30:60, 3].max() > 0.5
    scene.render.engine = 'STIPPLE_CYCLES'
    seen = scenes.render_pixels(tmp_path, 'both')
    np.testing.assert_allclose(seen[..., :3], expected[..., :3], atol=ROUNDING)
    np.testing.assert_allclose(seen[..., 3], expected[..., 3], atol=ROUNDING)


@pytest.mark.parametrize('is_kept', [False, True])
def test_an_animation_has_both_pictures_of_each_frame(stipple, tmp_path, is_kept):
    """With persistent data Cycles keeps the scene of the last image, which has no catchers."""
    splat_wall(stipple, 'floor', 0.0, side=3.0, colour=(0.5, 0.5, 0.5), count=60)
    catcher_plane(3.0)
    ball = scenes.sphere(radius=0.4)
    for frame, x in ((1, -0.5), (2, 0.5)):
        ball.location = (x, 0.0, 0.8)
        ball.keyframe_insert('location', frame=frame)
    sun()
    scenes.camera((0.0, 0.0, 6.0), width=60, height=60, type='ORTHO', ortho_scale=3.0)
    scene = prepare('STIPPLE_CYCLES', True, SAMPLES)
    scene.frame_set(2)
    expected = scenes.render_pixels(tmp_path, 'one')
    scene.frame_set(1)
    first = scenes.render_pixels(tmp_path, 'first')
    assert np.abs(expected - first).max() > 0.3
    scene.render.use_persistent_data = is_kept
    scene.frame_start, scene.frame_end = 1, 2
    scene.render.filepath = str(tmp_path / 'frame_')
    bpy.ops.render.render(animation=True)
    np.testing.assert_allclose(scenes.picture_pixels(tmp_path / 'frame_0001.exr'), first, atol=ROUNDING)
    np.testing.assert_allclose(scenes.picture_pixels(tmp_path / 'frame_0002.exr'), expected, atol=ROUNDING)


def test_the_pass_of_shadows_is_cycles_own(stipple, tmp_path, monkeypatch):
    splats_out_of_sight(stipple)
    catcher_plane()
    ball = scenes.sphere(radius=0.5)
    ball.location.z = 0.6
    sun()
    look_along_the_floor()
    bpy.context.view_layer.cycles.use_pass_shadow_catcher = True
    prepare('STIPPLE_CYCLES', True, SAMPLES)
    made = []
    engine = stipple.cycles_engine.classes[0]
    insert = engine._insert_splats

    def note(self, passes, *others):
        insert(self, passes, *others)
        made.append(stipple.version.read_pass(passes['Shadow Catcher'], 120, 90))

    monkeypatch.setattr(engine, '_insert_splats', note)
    scenes.render_pixels(tmp_path)
    assert made[0].min() < 0.1 and np.median(made[0]) == 1.0
