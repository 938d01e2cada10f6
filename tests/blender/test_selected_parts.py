# SPDX-License-Identifier: GPL-3.0-or-later
"""Selected splats that become an object of their own, and ground that is filled where they were."""

import bpy
import numpy as np
import pytest

import scenes
from drawn_views import View
from test_edits import import_arrays, read
from test_selection import ball, brush, in_stroke, own, selected, splats  # noqa: F401: three are fixtures
from test_splat_data import make_arrays


@pytest.mark.parametrize('with_budget', [False, True])
def test_separate_moves_splats_to_an_object_of_their_own(stipple, own, splats, tmp_path, with_budget):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    if with_budget:
        assert bpy.ops.stipple.add_budget() == {'FINISHED'}
        splats.data.stipple.ratio = 1.0
    splats.data.stipple.exposure = 0.5
    before, view = own('splat_data').read_ungraded(splats.data), View()
    brush(view)
    expected = in_stroke(stipple, view, splats)
    assert bpy.ops.stipple.separate_selected() == {'FINISHED'}
    new = bpy.context.object
    bpy.context.view_layer.update()
    assert new != splats and new.matrix_world == splats.matrix_world and new.select_get() and not splats.select_get()
    assert own('source_paths').file_of(new.data) != own('source_paths').file_of(splats.data)
    assert new.data.stipple.source_kind == splats.data.stipple.source_kind == ('TREE' if with_budget else 'CLOUD')
    assert new.data.stipple.exposure == 0.5
    parts = [own('splat_data').read_ungraded(obj.data) for obj in (new, splats)]
    for part, mask in zip(parts, (expected, ~expected)):
        order = np.lexsort(part.positions.T), np.lexsort(before.positions[mask].T)
        np.testing.assert_array_equal(part.positions[order[0]], before.positions[mask][order[1]])
        np.testing.assert_array_equal(part.sh[order[0]], before.sh[mask][order[1]])
    assert own('masks').counts(new.data) is None
    assert own('selections').is_empty(new.data) and own('selections').is_empty(splats.data)


def test_separate_of_a_mesh_takes_the_render_budget(stipple, own, ball):
    ball.data.stipple.anchors_render = 3000
    bpy.ops.stipple.select_sphere(center=(0, 0, 1), radius=0.6)
    assert bpy.ops.stipple.separate_selected() == {'FINISHED'}
    new = bpy.context.object
    assert new.data.stipple.source_kind == 'CLOUD' and ball.data.stipple.source_kind == 'MODEL'
    ball.data.stipple.anchors = 3000
    both = np.concatenate([read(stipple, obj).positions for obj in (new, ball)])
    assert len(both) == 3000 and 0 < len(read(stipple, new).positions) < 1000
    assert not own('erased').any_of(new.data) and own('erased').any_of(ball.data)


def floor_with_a_box(stipple, tmp_path, extra=0):
    rng = np.random.default_rng(8)
    arrays = make_arrays(stipple, count=5000 + extra, degree=0)
    arrays.positions[:] = rng.uniform(-2, 2, (5000 + extra, 3)) * (1, 1, 0.005)
    arrays.positions[4500:5000] = rng.uniform(-0.3, 0.3, (500, 3)) + (0, 0, 0.35)
    hidden = (np.abs(arrays.positions[:4500, :2]) < 0.3).all(axis=1)  # a scan sees no floor under a box
    arrays.positions[:4500][hidden] += (1.0, 0, 0)
    arrays.scales[:], arrays.opacities[:] = (0.05, 0.05, 0.01), 0.9
    arrays.rotations[:] = (1, 0, 0, 0)
    return import_arrays(stipple, tmp_path, arrays, 'floor'), arrays


@pytest.mark.parametrize('with_budget', [False, True])
@pytest.mark.parametrize('erased_before', [False, True])
def test_fill_covers_the_ground(stipple, own, tmp_path, with_budget, erased_before):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    obj, arrays = floor_with_a_box(stipple, tmp_path)
    if with_budget:
        assert bpy.ops.stipple.add_budget() == {'FINISHED'}
        obj.data.stipple.ratio = 1.0
    view = View((0.0, 0.0, 6.0))
    bpy.context.scene.render.engine, bpy.context.scene.render.film_transparent = 'STIPPLE', True
    bpy.ops.stipple.select_sphere(center=(0, 0, 0.35), radius=0.53)
    gone = selected(own, obj)
    assert gone.sum() >= 500
    old = own('source_paths').file_of(obj.data)
    if erased_before:
        assert bpy.ops.stipple.erase_selected() == {'FINISHED'}
        hole = scenes.render_pixels(tmp_path, 'hole')[..., 3]
        x, y = (view.pixels(np.array([[0.0, 0, 0]]))[0][0]).astype(int)
        assert hole[y - 4:y + 5, x - 4:x + 5].max() < 0.5
    assert bpy.ops.stipple.fill_erased() == {'FINISHED'}
    filled = read(stipple, obj)
    assert own('source_paths').file_of(obj.data) != old
    assert obj.data.stipple.source_kind == ('TREE' if with_budget else 'CLOUD')
    assert own('masks').counts(obj.data) is None and own('selections').is_empty(obj.data)
    known = {tuple(p) for p in arrays.positions}
    new = np.array([tuple(p) not in known for p in filled.positions])
    assert 20 < new.sum() < 2000 and (~new).sum() == 5000 - gone.sum()
    assert np.abs(filled.positions[new, :2]).max() < 0.8 and np.abs(filled.positions[new, 2]).max() < 0.15
    x, y = (view.pixels(np.array([[0.0, 0, 0]]))[0][0]).astype(int)
    assert scenes.render_pixels(tmp_path, 'filled')[y - 4:y + 5, x - 4:x + 5, 3].min() > 0.8


def test_fill_leaves_what_was_hidden_elsewhere_hidden(stipple, own, tmp_path):
    obj, _ = floor_with_a_box(stipple, tmp_path)
    bpy.ops.stipple.select_sphere(center=(1.7, 1.7, 0), radius=0.4)
    corner = np.count_nonzero(selected(own, obj))
    bpy.ops.stipple.erase_selected()
    bpy.ops.stipple.select_sphere(center=(0, 0, 0.35), radius=0.53)
    gone = np.count_nonzero(selected(own, obj))
    assert bpy.ops.stipple.fill_erased() == {'FINISHED'}
    total, kept = own('masks').counts(obj.data)
    assert total - kept == corner and kept > 5000 - corner - gone
    assert np.linalg.norm(read(stipple, obj).positions - (1.7, 1.7, 0), axis=1).min() > 0.4
    assert bpy.ops.stipple.clear_mask() == {'FINISHED'}
    assert len(read(stipple, obj).positions) == total


def test_fill_of_a_mesh_becomes_splats_of_a_file(stipple, own, tmp_path):
    floor = scenes.quad(size=4)
    obj = scenes.make_splats(floor, anchors=4000, source_path=str(tmp_path / 'f.stipple.safetensors'))
    bpy.ops.stipple.select_sphere(center=(0, 0, 0), radius=0.4)
    gone = np.count_nonzero(selected(own, obj))
    assert bpy.ops.stipple.fill_erased() == {'FINISHED'}
    assert obj.data.stipple.source_kind == 'CLOUD'
    inside = np.linalg.norm(read(stipple, obj).positions, axis=1) < 0.3
    assert gone > 50 and inside.sum() > 0.2 * gone


def test_a_new_source_has_the_hole_and_an_updated_one_too(stipple, own, ball):
    bpy.ops.stipple.select_sphere(center=(0, 0, 1), radius=0.6)
    assert bpy.ops.stipple.erase_selected() == {'FINISHED'}
    mesh = bpy.data.objects['Sphere']
    mesh.hide_set(False)
    mesh.data.transform(np.diag([1.2, 1.2, 1.0, 1.0]).tolist())
    mesh.data.update()
    assert bpy.ops.stipple.update_from_source() == {'FINISHED'}
    wide = read(stipple, ball).positions
    assert np.abs(wide[:, 0]).max() > 1.15 and np.linalg.norm(wide - (0, 0, 1), axis=1).min() > 0.6
    assert bpy.ops.stipple.use_as_new_source() == {'FINISHED'}
    assert not own('erased').any_of(ball.data) and not bpy.ops.stipple.clear_mask.poll()
    np.testing.assert_array_equal(read(stipple, ball).positions, wide)


def test_merge_and_series_out_have_the_hole(stipple, own, ball, tmp_path):
    bpy.ops.stipple.select_sphere(center=(0, 0, 1), radius=0.6)
    assert bpy.ops.stipple.erase_selected() == {'FINISHED'}
    left = len(read(stipple, ball).positions)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 2
    path = tmp_path / 'out.ply'
    assert bpy.ops.stipple.splats_export(filepath=str(path), frames='SCENE', use_selection=True) == {'FINISHED'}
    cloud = stipple.binding.cloud.Cloud
    for number in (1, 2):
        out = cloud.load(own('sources').context(), str(tmp_path / f'out_000{number}.ply'))
        assert out.info().count == left < 2000
    other = scenes.link(ball.copy())
    other.data = ball.data.copy()  # with its hole
    scenes.select(ball, other)
    assert bpy.ops.stipple.merge_splats(budget='FULL') == {'FINISHED'}
    assert len(read(stipple, ball).positions) == 2 * left
