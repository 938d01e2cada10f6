# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats selected by brush, lasso, sphere and colour, and what is done with them: of files, meshes and fields."""

import importlib
import shutil
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

import drawn_views
import scenes
from drawn_views import View, path
from test_edits import box, import_arrays, read, select
from test_splat_data import make_arrays

COUNT = 600
STROKE = ((100, 90), (180, 130), (220, 100))
OUTLINE = [(90, 60), (240, 70), (200, 190), (150, 120), (100, 180)]


@pytest.fixture
def own(stipple):
    """Modules of the add-on that tests look into."""
    def module(name):
        return importlib.import_module('.scene.source.' + name, stipple.__name__)
    return module


@pytest.fixture
def splats(stipple, tmp_path):
    """A file's splats, in an object that is moved, rotated and scaled differently along its axes."""
    obj = import_arrays(stipple, tmp_path, make_arrays(stipple, count=COUNT, degree=1))
    obj.matrix_world = Matrix.Translation((0.2, -0.1, 0.3)) @ Euler((0.3, 0.2, 0.5)).to_matrix().to_4x4() @ (
        Matrix.Diagonal((1.2, 0.7, 0.9, 1)))
    bpy.context.view_layer.update()
    return obj


@pytest.fixture
def ball(tmp_path):
    """Splats of a mesh, decoded anew at each budget."""
    obj = scenes.make_splats(scenes.sphere(), anchors=2000, source_path=str(tmp_path / 'ball.stipple.safetensors'))
    bpy.data.objects['Sphere'].hide_set(True)
    return obj


@pytest.fixture
def field(stipple, tmp_path):
    """Splats of a learned field."""
    ball = scenes.two_coloured_ball(tmp_path)
    settings = bpy.context.scene.stipple.fit
    for name, value in {'view_count': 4, 'view_size': 32, 'engine': 'WORKBENCH', 'max_splats': 4000, 'quality': 'FAST',
                        'model': 'FIELD'}.items():
        setattr(settings, name, value)
    assert bpy.ops.stipple.splats_fit() == {'FINISHED'}
    ball.hide_set(True)
    obj = next(o for o in bpy.data.objects if o.name.endswith(' Fit'))
    scenes.select(obj)
    return obj


def selected(own, obj):
    """[N] of the source's splats, or of those that are shown."""
    selections, selecting = own('selections'), own('selecting')
    if not selections.takes_mask(obj.data):
        return selecting.mask_of_regions(obj) != 0
    count = own('sources').whole_cloud(obj.data).info().count
    return selections.read_mask(obj.data, count) != 0


def brush(view, places=STROKE, radius=25.0, **more):
    return bpy.ops.stipple.select_brush(path=path(*places), radius=radius, **view.given, **more)


def in_stroke(stipple, view, obj, places=STROKE, radius=25.0, positions=None):
    positions = read(stipple, obj).positions if positions is None else positions
    pixels, is_before = view.pixels(drawn_views.of_world(obj, positions))
    return is_before & drawn_views.near_path(pixels, places, radius)


def assert_same(found, expected, most=0):
    assert np.any(expected) and not np.all(expected)
    assert np.count_nonzero(found != expected) <= most, (np.count_nonzero(found), np.count_nonzero(expected))


@pytest.mark.parametrize('camera', [{}, {'type': 'ORTHO', 'ortho_scale': 7.0}, {'lens': 30, 'shift_x': 0.1}])
def test_a_stroke_selects_what_it_passes_in_any_camera(stipple, own, splats, camera):
    view = View((0.4, 0.2, 6.0), (0.1, 0.05, 0.0), **camera)
    assert brush(view) == {'FINISHED'}
    assert_same(selected(own, splats), in_stroke(stipple, view, splats))
    assert own('selecting').counts(splats.data) == (COUNT, np.count_nonzero(in_stroke(stipple, view, splats)))


def test_nothing_behind_the_camera_is_selected(stipple, own, splats):
    view = View((0.0, 0.0, 0.2))  # amid the splats
    assert brush(view, ((160, 120),), 400.0) == {'FINISHED'}
    expected = in_stroke(stipple, view, splats, ((160, 120),), 400.0)
    assert_same(selected(own, splats), expected)
    depth = (np.c_[drawn_views.of_world(splats, read(stipple, splats).positions), np.ones(COUNT)]
             @ np.array(view.given['view_matrix']).reshape(4, 4)[2])
    assert (depth[selected(own, splats)] < 0).all() and (depth > 0).sum() > 100


def test_a_lasso_selects_what_it_surrounds(stipple, own, splats):
    view = View()
    assert bpy.ops.stipple.select_lasso(path=path(*OUTLINE), **view.given) == {'FINISHED'}
    pixels, _ = view.pixels(drawn_views.of_world(splats, read(stipple, splats).positions))
    assert_same(selected(own, splats), drawn_views.in_outline(pixels, OUTLINE))


def test_a_sphere_is_round_in_the_world(stipple, own, splats):
    world = drawn_views.of_world(splats, read(stipple, splats).positions)
    assert bpy.ops.stipple.select_sphere(center=(0.5, 0.1, 0.2), radius=0.9) == {'FINISHED'}
    assert_same(selected(own, splats), np.linalg.norm(world - (0.5, 0.1, 0.2), axis=1) <= 0.9, most=1)


@pytest.mark.parametrize('within', [0.0, 1.2])
def test_colors_are_those_of_degree_0(stipple, own, splats, within):
    linear = np.maximum(scenes.colours_of(stipple, splats), 0)
    wanted = linear[5]
    assert bpy.ops.stipple.select_color(color=wanted, tolerance=0.15, center=(0.2, 0, 0.3), radius=within) == {
        'FINISHED'}
    distance = np.linalg.norm(drawn_views.oklab(linear) - drawn_views.oklab(wanted), axis=1)
    world = drawn_views.of_world(splats, read(stipple, splats).positions)
    near = np.linalg.norm(world - (0.2, 0, 0.3), axis=1) <= within
    expected = (distance <= 0.15) & (near if within else True)
    assert_same(selected(own, splats), expected, most=3)


def test_operations_compose(stipple, own, splats):
    view = View()
    first, second = ((120, 120),), ((170, 120),)
    a, b = (in_stroke(stipple, view, splats, place, 40.0) for place in (first, second))
    for operation, expected in (('ADD', a | b), ('SUBTRACT', a & ~b), ('INTERSECT', a & b), ('SET', b)):
        brush(view, first, 40.0)
        brush(view, second, 40.0, operation=operation)
        assert_same(selected(own, splats), expected)
    bpy.ops.stipple.select_all(action='INVERT')
    assert_same(selected(own, splats), ~b)
    bpy.ops.stipple.select_all(action='SELECT')
    assert selected(own, splats).all()
    bpy.ops.stipple.select_all(action='DESELECT')
    assert not selected(own, splats).any() and own('selections').is_empty(splats.data)


def neighbours(positions, mask, distance):
    """[N] whether a masked splat is that near."""
    apart = np.linalg.norm(positions[:, None] - positions[None, mask], axis=2)
    return (apart <= distance).any(axis=1) if mask.any() else np.zeros(len(positions), bool)


def test_selections_grow_and_shrink(stipple, own, splats):
    splats.matrix_world = Matrix.Scale(2, 4)  # distances are the world's
    bpy.context.view_layer.update()
    positions = read(stipple, splats).positions.astype(float)
    bpy.ops.stipple.select_sphere(center=(0, 0, 0), radius=2.0)
    before = selected(own, splats)
    bpy.ops.stipple.select_grow(distance=0.5)
    grown = before | neighbours(positions, before, 0.25)
    assert_same(selected(own, splats), grown)
    assert np.count_nonzero(grown) > np.count_nonzero(before) + 10
    bpy.ops.stipple.select_shrink(distance=0.4)
    assert_same(selected(own, splats), grown & ~neighbours(positions, ~grown, 0.2))
    before = selected(own, splats)
    bpy.ops.stipple.select_grow()
    grown = selected(own, splats)
    assert (grown | before == grown).all() and np.count_nonzero(grown) > np.count_nonzero(before)
    bpy.ops.stipple.select_shrink()
    assert np.count_nonzero(selected(own, splats)) < np.count_nonzero(grown)


def test_erased_splats_are_neither_selected_nor_an_edge(stipple, own, splats):
    splats.matrix_world = Matrix.Identity(4)
    bpy.context.view_layer.update()
    positions = read(stipple, splats).positions.astype(float)
    bpy.ops.stipple.select_sphere(center=(0, 0, 0), radius=0.8)
    gone = selected(own, splats)
    assert bpy.ops.stipple.erase_selected() == {'FINISHED'}
    assert own('selections').is_empty(splats.data)
    bpy.ops.stipple.select_sphere(center=(0, 0, 0), radius=1.5)
    ring = (np.linalg.norm(positions, axis=1) <= 1.5) & ~gone
    assert_same(selected(own, splats), ring, most=1)
    bpy.ops.stipple.select_shrink(distance=0.2)
    outside = ~ring & ~gone
    assert_same(selected(own, splats), ring & ~neighbours(positions, outside, 0.2), most=1)
    bpy.ops.stipple.select_all(action='INVERT')
    assert not (selected(own, splats) & gone).any()


def test_a_stroke_is_of_the_source_and_not_of_the_budget(stipple, own, splats, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    positions = read(stipple, splats).positions
    scenes.select(splats)
    assert bpy.ops.stipple.add_budget() == {'FINISHED'}
    stored = splats.data.stipple
    stored.ratio = 0.1
    view = View()
    brush(view)
    whole = own('sources').whole_cloud(splats.data).positions()
    expected = in_stroke(stipple, view, splats, positions=whole)
    assert_same(selected(own, splats), expected)
    assert np.count_nonzero(expected) > 0.1 * COUNT
    assert bpy.ops.stipple.erase_selected() == {'FINISHED'}
    left = COUNT - np.count_nonzero(expected)
    for ratio in (0.1, 0.5, 1.0):
        stored.ratio = ratio
        shown = read(stipple, splats).positions
        assert len(shown) == round(ratio * left)
    assert {tuple(p) for p in shown} == {tuple(p) for p in whole[~expected]}
    assert len(positions) == len(whole)


def test_keep_only_hides_the_rest_and_clear_mask_brings_it_back(stipple, own, splats):
    before = read(stipple, splats).positions
    view = View()
    brush(view)
    expected = in_stroke(stipple, view, splats)
    assert bpy.ops.stipple.keep_selected() == {'FINISHED'}
    np.testing.assert_array_equal(read(stipple, splats).positions, before[expected])
    assert bpy.ops.stipple.clear_mask() == {'FINISHED'}
    np.testing.assert_array_equal(read(stipple, splats).positions, before)


def test_each_stroke_is_undone_and_survives_files(stipple, own, splats, tmp_path):
    name, view = splats.name, View()
    bpy.ops.ed.undo_push(message='imported')
    brush(view, ((120, 120),), 40.0)
    bpy.ops.ed.undo_push(message='one')
    one = selected(own, splats)
    brush(view, ((170, 120),), 40.0, operation='ADD')
    bpy.ops.ed.undo_push(message='two')
    two = selected(own, bpy.data.objects[name])
    assert (one != two).any()
    bpy.ops.ed.undo()
    np.testing.assert_array_equal(selected(own, bpy.data.objects[name]), one)
    bpy.ops.ed.undo()
    assert own('selections').is_empty(bpy.data.objects[name].data)
    bpy.ops.ed.redo()
    bpy.ops.ed.redo()
    np.testing.assert_array_equal(selected(own, bpy.data.objects[name]), two)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'a.blend'))
    obj = bpy.data.objects[name]
    np.testing.assert_array_equal(selected(own, obj), two)
    copy = obj.data.copy()
    assert own('selections').stored_counts(copy) == own('selections').stored_counts(obj.data)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(tmp_path / 'a.blend')) as (_, wanted):
        wanted.objects = [name]
    obj = scenes.link(bpy.data.objects[name])
    np.testing.assert_array_equal(selected(own, obj), two)
    scenes.select(obj)
    assert bpy.ops.stipple.erase_selected() == {'FINISHED'}
    assert len(read(stipple, obj).positions) == COUNT - np.count_nonzero(two)


@pytest.mark.parametrize('kind', ['ball', 'field'])
def test_regions_erase_what_is_decoded_at_any_budget(stipple, own, kind, request, tmp_path):
    obj, view = request.getfixturevalue(kind), View((0.0, 0.0, 5.0))
    stroke = ((140, 130), (200, 110))
    brush(view, stroke, 20.0)
    expected = in_stroke(stipple, view, obj, stroke, 20.0)
    assert_same(selected(own, obj), expected)
    brush(view, ((140, 130),), 12.0, operation='SUBTRACT')
    expected &= ~in_stroke(stipple, view, obj, ((140, 130),), 12.0)
    assert_same(selected(own, obj), expected)
    whole = read(stipple, obj).positions
    bpy.ops.ed.undo_push(message='selected')
    assert bpy.ops.stipple.erase_selected() == {'FINISHED'}
    bpy.ops.ed.undo_push(message='erased')
    np.testing.assert_array_equal(read(stipple, obj).positions, whole[~expected])
    stored, each, name = obj.data.stipple, max(obj.data.stipple.learned_gaussians, 1), obj.name
    for anchors in (90, 700):
        stored.anchors = anchors
        left = read(stipple, obj).positions
        inside = in_stroke(stipple, view, obj, stroke, 20.0) & ~in_stroke(stipple, view, obj, ((140, 130),), 12.0)
        assert 0 < len(left) < anchors * each and not inside.any()
    # Wherever the object goes, its hole goes along.
    obj.matrix_world = Matrix.Translation((3, 0, 0))
    stored.anchors = 90
    stored.anchors = 700
    np.testing.assert_array_equal(read(stipple, obj).positions, left)
    cloud = own('exporting').cloud_at(obj.evaluated_get(bpy.context.evaluated_depsgraph_get()), 'RENDER')
    np.testing.assert_array_equal(cloud.positions(), left)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'b.blend'))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'b.blend'))
    obj = bpy.data.objects[name]
    obj.data.stipple.anchors = 90
    obj.data.stipple.anchors = 700
    np.testing.assert_array_equal(read(stipple, obj).positions, left)
    scenes.select(obj)
    assert bpy.ops.stipple.clear_mask() == {'FINISHED'}
    assert len(read(stipple, obj).positions) == 700 * each
    assert not bpy.ops.stipple.clear_mask.poll()


def test_regions_invert_grow_and_keep(stipple, own, ball):
    positions = read(stipple, ball).positions.astype(float)
    bpy.ops.stipple.select_sphere(center=(0, 0, 1), radius=0.6)
    top = np.linalg.norm(positions - (0, 0, 1), axis=1) <= 0.6
    assert_same(selected(own, ball), top)
    bpy.ops.stipple.select_grow(distance=0.15)
    grown = top | neighbours(positions, top, 0.15)
    assert_same(selected(own, ball), grown)
    bpy.ops.stipple.select_all(action='INVERT')
    assert_same(selected(own, ball), ~grown)
    assert bpy.ops.stipple.keep_selected() == {'FINISHED'}
    np.testing.assert_array_equal(read(stipple, ball).positions, positions[~grown].astype(np.float32))
    # A second time, on top of the first.
    bpy.ops.stipple.select_sphere(center=(0, 0, -1), radius=0.5)
    assert bpy.ops.stipple.erase_selected() == {'FINISHED'}
    bottom = np.linalg.norm(positions - (0, 0, -1), axis=1) <= 0.5
    np.testing.assert_array_equal(read(stipple, ball).positions, positions[~grown & ~bottom].astype(np.float32))
    ball.data.stipple.anchors = 1999
    left = read(stipple, ball).positions
    assert 0 < len(left) < 1999 and np.linalg.norm(left - (0, 0, -1), axis=1).min() > 0.5


def test_erased_regions_undo(stipple, own, ball):
    name = ball.name
    bpy.ops.ed.undo_push(message='made')
    bpy.ops.stipple.select_sphere(center=(0, 0, 1), radius=0.6)
    bpy.ops.ed.undo_push(message='selected')
    bpy.ops.stipple.erase_selected()
    bpy.ops.ed.undo_push(message='erased')
    left = len(read(stipple, ball).positions)
    assert left < 2000
    bpy.ops.ed.undo()
    assert len(read(stipple, bpy.data.objects[name]).positions) == 2000
    assert not own('selections').is_empty(bpy.data.objects[name].data)
    bpy.ops.ed.redo()
    obj = bpy.data.objects[name]
    assert len(read(stipple, obj).positions) == left
    obj.data.stipple.seed = 5
    assert np.linalg.norm(read(stipple, obj).positions - (0, 0, 1), axis=1).min() > 0.6


@pytest.mark.parametrize('kind', ['splats', 'ball'])
def test_a_render_shows_the_hole(stipple, kind, request, tmp_path):
    obj = request.getfixturevalue(kind)
    obj.matrix_world = Matrix.Identity(4)
    if kind == 'splats':  # a wall
        arrays = make_arrays(stipple, count=2000, degree=0)
        rng = np.random.default_rng(2)
        arrays.positions[:] = rng.uniform(-1.5, 1.5, (2000, 3)) * (1, 1, 0)
        arrays.scales[:], arrays.opacities[:] = 0.06, 0.95
        bpy.data.objects.remove(obj)
        obj = import_arrays(stipple, tmp_path, arrays, 'wall')
    view = View((0.0, 0.0, 5.0))
    scene = bpy.context.scene
    scene.render.engine, scene.render.film_transparent = 'STIPPLE', True
    before = scenes.render_pixels(tmp_path, 'before')[..., 3]
    bpy.ops.stipple.select_sphere(center=(0, 0, 0.0), radius=0.35) if kind == 'splats' else (
        bpy.ops.stipple.select_lasso(path=path((140, 100), (180, 100), (180, 140), (140, 140)), **view.given))
    assert bpy.ops.stipple.erase_selected() == {'FINISHED'}
    after = scenes.render_pixels(tmp_path, 'after')[..., 3]
    middle, edge = np.s_[115:125, 155:165], np.s_[115:125, 195:200]
    # Splats around the hole reach into it: 0.23 at the corner of its middle that is nearest to one of them.
    assert before[middle].min() > 0.7 and after[middle].mean() < 0.15 and after[middle].max() < 0.35
    np.testing.assert_allclose(after[edge], before[edge], atol=0.02)


def two_walls(stipple, tmp_path):
    arrays = make_arrays(stipple, count=4000, degree=0)
    rng = np.random.default_rng(2)
    arrays.positions[:] = rng.uniform(-1.5, 1.5, (4000, 3)) * (1, 1, 0)
    arrays.positions[2000:, 2] = -1.0  # behind the first
    arrays.scales[:], arrays.opacities[:] = 0.06, 0.95
    return import_arrays(stipple, tmp_path, arrays, 'walls'), arrays


@pytest.mark.parametrize('camera', [{}, {'type': 'ORTHO', 'ortho_scale': 4.0}])
def test_front_only_leaves_what_lies_behind(stipple, own, tmp_path, camera):
    obj, arrays = two_walls(stipple, tmp_path)
    view = View((0.0, 0.0, 5.0), **camera)
    expected = in_stroke(stipple, view, obj)
    brush(view)
    assert_same(selected(own, obj), expected)
    brush(view, front_only=True)
    front = expected & (arrays.positions[:, 2] == 0)
    assert expected[2000:].sum() > 20
    found = selected(own, obj)
    assert not found[2000:].any()
    assert_same(found, front, most=0.02 * front.sum())
    bpy.ops.stipple.select_lasso(path=path(*OUTLINE), front_only=True, **view.given)
    assert selected(own, obj)[:2000].sum() > 20 and not selected(own, obj)[2000:].any()


def test_meshes_hide_what_is_behind_them(stipple, own, tmp_path):
    """A plane before the left half of the first wall; Through Meshes and wires leave it out."""
    obj, arrays = two_walls(stipple, tmp_path)
    view = View((0.0, 0.0, 5.0))
    plane = scenes.quad('Plane', size=4.0, offset=(-2.0, 0.0, 1.0))
    scenes.select(obj)
    brush(view, front_only=True, through_meshes=True)
    front = selected(own, obj)
    left = drawn_views.of_world(obj, arrays.positions)[:, 0] < -0.1
    assert front[left].sum() > 20 and front[~left].sum() > 20
    brush(view, front_only=True)
    assert not selected(own, obj)[left].any()
    right = drawn_views.of_world(obj, arrays.positions)[:, 0] > 0.1
    assert_same(selected(own, obj)[right], front[right], most=3)
    plane.display_type = 'WIRE'
    brush(view, front_only=True)
    assert_same(selected(own, obj), front)


def test_preparing_a_stroke_changes_nothing_of_it(stipple, own, splats, tmp_path):
    """The source is read in a thread while nobody waits, once, and the next stroke takes it."""
    sources = stipple.scene.source.sources
    view = View()
    brush(view)
    expected = selected(own, splats)
    bpy.ops.stipple.select_all(action='DESELECT')
    sources._whole.clear()
    while not own('selecting').prepare([splats]):
        pass
    whole = next(iter(sources._whole.values()))
    brush(view)
    assert_same(selected(own, splats), expected)
    assert next(iter(sources._whole.values())) is whole
    # What is wrong with a file is said by the stroke itself.
    sources._whole.clear()
    path = stipple.scene.source.source_paths.file_of(splats.data)
    Path(path).rename(f'{path}.gone')
    with pytest.raises(stipple.binding.errors.StippleError, match='cannot be read'):
        own('selecting').prepare([splats])
    scenes.refuses(lambda: brush(view), 'cannot be read')
    Path(f'{path}.gone').rename(path)
    brush(view)
    assert_same(selected(own, splats), expected)


def test_front_only_is_stored_with_regions(stipple, own, ball):
    view = View((0.0, 0.0, 5.0))
    brush(view, ((160, 120),), 30.0, front_only=True)
    mask = selected(own, ball)
    positions = read(stipple, ball).positions
    both = in_stroke(stipple, view, ball, ((160, 120),), 30.0)
    assert (positions[both, 2] < 0).sum() > 20
    assert (positions[mask, 2] > 0).all() and mask.sum() > 0.9 * (positions[both, 2] > 0).sum()
    bpy.ops.stipple.erase_selected()
    ball.data.stipple.anchors = 1500
    shown = read(stipple, ball).positions
    both = in_stroke(stipple, view, ball, ((160, 120),), 30.0)
    assert (shown[both, 2] < 0).sum() > 20 and (shown[both, 2] > 0).sum() < 5


def test_crop_and_floaters_trim_selections(stipple, own, splats):
    splats.matrix_world = Matrix.Identity(4)
    bpy.ops.stipple.select_all(action='SELECT')
    select(splats, box(size=0.9))
    assert bpy.ops.stipple.crop_by_box() == {'FINISHED'}
    kept = len(read(stipple, splats).positions)
    assert own('selecting').counts(splats.data) == (kept, kept)
    assert np.count_nonzero(selected(own, splats)) == kept < COUNT


def test_another_source_selects_nothing(stipple, own, splats, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    bpy.ops.stipple.select_sphere(center=(0, 0, 0), radius=1)
    assert bpy.ops.stipple.apply_transform() == {'FINISHED'}
    assert not selected(own, splats).any()
    scenes.refuses(lambda: bpy.ops.stipple.erase_selected(), 'poll()')
    bpy.ops.stipple.select_sphere(center=(0, 0, 0), radius=1)
    before = selected(own, splats)
    file, moved = own('source_paths').file_of(splats.data), tmp_path / 'moved.ply'
    shutil.copy(file, moved)
    assert bpy.ops.stipple.relink(filepath=str(moved)) == {'FINISHED'}
    np.testing.assert_array_equal(selected(own, splats), before)
    own('sources').ungraded_cloud(splats).transformed(np.diag([2, 1, 1, 1])).save(str(tmp_path / 'wide.ply'))
    assert bpy.ops.stipple.relink(filepath=str(tmp_path / 'wide.ply')) == {'FINISHED'}
    assert not selected(own, splats).any() and own('selecting').counts(splats.data) is None
    bpy.ops.stipple.select_sphere(center=(0, 0, 0), radius=1)
    other = import_arrays(stipple, tmp_path, make_arrays(stipple, count=50, degree=0), 'other')
    scenes.select(splats, other)
    assert bpy.ops.stipple.merge_splats() == {'FINISHED'}
    assert own('selections').is_empty(splats.data)


def test_what_cannot_be_edited_says_what_to_do(stipple, own, splats, ball, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    view = View()
    bpy.ops.stipple.select_sphere(center=(0, 0, 1), radius=0.6)
    for obj, name in ((splats, 'in'), (ball, 'ball')):
        scenes.select(obj)
        elements, attribute = (obj.data.vertices, 'co') if obj.type == 'MESH' else (
            obj.data.attributes['position'].data, 'vector')
        setattr(elements[0], attribute, (9, 9, 9))
        obj.data.update_tag()
        scenes.refuses(lambda: brush(view), 'edited by hand')
        assert bpy.ops.stipple.revert_to_source() == {'FINISHED'}
        assert brush(view) == {'FINISHED'}
    for i in (1, 2):
        own('sources').ungraded_cloud(splats).save(str(tmp_path / f's_000{i}.ply'))
    bpy.ops.stipple.splats_import(filepath=str(tmp_path / 's_0001.ply'), as_sequence=True)
    scenes.refuses(lambda: brush(view), 'series of files')
    scenes.select(splats)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(tmp_path / 'a.blend'), link=True) as (_, wanted):
        wanted.objects = ['in']
    scenes.select(scenes.link(bpy.data.objects['in']))
    scenes.refuses(lambda: brush(View()), 'linked from another file')


def test_errors_of_operators(stipple, own, splats):
    view = View()
    scenes.refuses(lambda: bpy.ops.stipple.select_brush(path=path((3, 4)), radius=5), 'view_matrix')
    scenes.refuses(lambda: bpy.ops.stipple.select_brush(radius=5, **view.given), 'no path')
    scenes.refuses(lambda: bpy.ops.stipple.select_lasso(path=path((3, 4), (5, 6)), **view.given), 'at least 3')
    scenes.refuses(lambda: bpy.ops.stipple.select_sphere(center=(0, 0, 0)), 'radius of the sphere is 0')
    assert not bpy.ops.stipple.erase_selected.poll() and not bpy.ops.stipple.fill_erased.poll()
    bpy.ops.stipple.select_all(action='SELECT')
    scenes.refuses(bpy.ops.stipple.erase_selected, 'at least one has to')
    scenes.refuses(bpy.ops.stipple.separate_selected, 'at least one has to')
    assert len(read(stipple, splats).positions) == COUNT
    scenes.link(bpy.data.objects.new('empty', None))
    scenes.select(bpy.data.objects['empty'])
    assert not bpy.ops.stipple.select_brush.poll()


@pytest.mark.parametrize('text', ['', '{', '[' * 100_000, '{"version": 1}', '{"version": 7, "steps": []}', '[]', '3',
                                  '{"version": 1, "steps": [{"keeps": false, "regions": [{"kind": 77}]}]}'])
def test_texts_from_elsewhere(stipple, own, ball, text):
    """As a .blend may hold them: a selection is none, and what was erased says how to go on."""
    ball.data[own('selections').KEY] = text
    assert not selected(own, ball).any()
    ball.data[own('erased').KEY] = text
    ball.data.stipple.anchors = 300
    assert 'Clear Mask' in own('sync').problems[ball.data.name]
    assert bpy.ops.stipple.clear_mask() == {'FINISHED'}
    assert len(read(stipple, ball).positions) == 300


def test_a_packed_mask_that_claims_too_much_is_refused(own):
    import base64
    import zlib
    masks = own('masks')
    bomb = base64.b64encode(zlib.compress(bytes(50_000_000))).decode()
    with pytest.raises((ValueError, zlib.error)):
        masks.unpacked(bomb, 100)
    mask = np.random.default_rng(1).integers(0, 2, 1001).astype(np.uint8)
    np.testing.assert_array_equal(masks.unpacked(masks.packed(mask), 1001), mask)


def test_two_objects_are_selected_at_once(stipple, own, splats, ball):
    scenes.select(splats, ball)
    view = View()
    assert brush(view) == {'FINISHED'}
    for obj in (splats, ball):
        assert_same(selected(own, obj), in_stroke(stipple, view, obj))
    assert bpy.ops.stipple.erase_selected() == {'FINISHED'}
    for obj in (splats, ball):
        assert not in_stroke(stipple, view, obj).any()
