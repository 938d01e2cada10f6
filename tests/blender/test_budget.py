# SPDX-License-Identifier: GPL-3.0-or-later
"""The slider on splats that are there already: imported, foreign, out of geometry nodes."""

import time

import bpy
import numpy as np
import pytest
from mathutils import Matrix

import scenes
from test_edits import box, import_arrays, in_box, read
from test_splat_data import assert_equal, make_arrays

COUNT = 400


@pytest.fixture
def arrays(stipple):
    made = make_arrays(stipple, count=COUNT, degree=1)
    made.scales *= np.float32(0.1)
    return made


@pytest.fixture
def budgeted(stipple, tmp_path, arrays):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    obj = import_arrays(stipple, tmp_path, arrays)
    scenes.select(obj)
    assert bpy.ops.stipple.add_budget() == {'FINISHED'}
    return obj


def count(stipple, obj):
    return stipple.scene.source.splat_data.count(obj.data)


def test_the_full_budget_is_the_file_bit_for_bit(stipple, budgeted, tmp_path):
    native = stipple.binding.cloud.Cloud.load(stipple.scene.source.sources.context(), str(tmp_path / 'in.ply')).read()
    assert budgeted.data.stipple.source_kind == 'TREE' and budgeted.data.stipple.source_count == COUNT
    assert budgeted.data.stipple.source.startswith('//stipple')
    assert_equal(read(stipple, budgeted), native)
    budgeted.data.stipple.ratio = 0.1
    budgeted.data.stipple.ratio = 1.0
    assert_equal(read(stipple, budgeted), native)


def test_ratio_and_count(stipple, budgeted):
    settings = budgeted.data.stipple
    for ratio in (0.5, 0.25, 0.0, 1.0, 0.333):
        settings.ratio = ratio
        assert count(stipple, budgeted) == max(1, round(COUNT * ratio))
    settings.anchors = 77
    settings.budget_by = 'COUNT'
    assert count(stipple, budgeted) == 77
    settings.anchors = 10 * COUNT
    assert count(stipple, budgeted) == COUNT
    for factor, expected in ((0.5, COUNT // 2), (0.5, COUNT // 4), (2.0, COUNT // 2)):
        scenes.select(budgeted)
        bpy.ops.stipple.scale_budget(factor=factor)
        assert count(stipple, budgeted) == expected
    settings.budget_by, settings.ratio = 'RATIO', 0.8
    bpy.ops.stipple.scale_budget(factor=2.0)
    assert settings.ratio == 1.0
    bpy.ops.stipple.scale_budget(factor=0.5, render=True)
    assert settings.ratio_render == 0.5 and settings.ratio == 1.0


def test_renders_have_their_own_budget(stipple, budgeted, tmp_path):
    settings = budgeted.data.stipple
    settings.ratio, settings.ratio_render = 0.25, 0.5
    sources = stipple.scene.source.sources
    assert sources.decode_settings(settings, 'RENDER').anchors == COUNT // 2
    for budget, expected in (('VIEWPORT', COUNT // 4), ('RENDER', COUNT // 2), ('FULL', COUNT)):
        scenes.select(budgeted)
        bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'out.ply'), budget=budget)
        cloud = stipple.binding.cloud.Cloud.load(sources.context(), str(tmp_path / 'out.ply'))
        assert cloud.info().count == expected
    scenes.camera((0, 0, 8), width=32, height=32)
    scene = bpy.context.scene
    scene.render.engine = 'STIPPLE'
    decoded = []
    decode = stipple.scene.instances.decoded.begin

    def noted(data, wanted, *more):
        decoded.append(wanted.anchors)
        return decode(data, wanted, *more)
    stipple.scene.instances.decoded.begin = noted
    try:
        pixels = scenes.render_pixels(tmp_path)
    finally:
        stipple.scene.instances.decoded.begin = decode
    assert decoded == [COUNT // 2] and pixels[..., 3].max() > 0.5


def test_detail_doubles_the_budget(stipple, budgeted):
    settings, sources = budgeted.data.stipple, stipple.scene.source.sources
    settings.ratio = settings.ratio_render = 0.5
    for detail, expected in ((-1.0, 100), (-2.0, 50), (0.5, 283), (3.0, COUNT), (-30.0, 1)):
        settings.detail = detail
        assert count(stipple, budgeted) == expected  # 200 times 2 to the power of it, rounded, as many as there are
        assert sources.decode_settings(settings, 'RENDER').anchors == expected
        assert sources.decode_settings(settings, 'FULL').anchors == COUNT
    settings.budget_by, settings.anchors, settings.detail = 'COUNT', 80, -1.0
    assert count(stipple, budgeted) == 40
    scenes.select(budgeted)
    bpy.ops.stipple.scale_budget(factor=2.0)
    assert count(stipple, budgeted) == 80 and settings.anchors == 160 and settings.detail == -1.0


def test_a_ramp_of_detail_is_even_and_smooth(stipple, budgeted):
    settings = budgeted.data.stipple
    settings.ratio, settings.smooth_budget = 0.25, True
    for frame, detail in ((1, -2.0), (41, 0.0)):
        settings.detail = detail
        settings.keyframe_insert('detail', frame=frame)
    scenes.make_linear(budgeted.data)

    def opacity(frame):
        bpy.context.scene.frame_set(frame)
        shown = read(stipple, budgeted)
        return len(shown.opacities), float(np.sum(shown.opacities, dtype=np.float64))
    counts = [opacity(frame) for frame in (1, 21, 41)]
    for (number, _), budget in zip(counts, (25, 50, 100)):
        assert budget < number <= int(np.ceil(budget * np.sqrt(2.0)))  # those that split on their way, too
    # From one splat more to the next, no opacity appears at once: each takes half a doubling, 20 splats here.
    sums = [opacity(frame)[1] for frame in range(21, 42)]
    assert max(np.abs(np.diff(sums))) < 0.05 * max(sums)


def test_smooth_budgets_keep_to_the_largest_number(stipple, budgeted):
    settings, scene = budgeted.data.stipple, bpy.context.scene
    settings.ratio, settings.smooth_budget = 0.5, True
    assert 200 < count(stipple, budgeted) <= 283
    scene.render.use_simplify, scene.stipple.max_splats = True, 100
    bpy.context.view_layer.update()
    assert count(stipple, budgeted) <= 100
    scene.stipple.max_splats = 0
    scene.render.use_simplify = False


def test_keyframes_undo_and_files(stipple, budgeted, tmp_path):
    settings = budgeted.data.stipple
    for frame, ratio in ((1, 0.25), (11, 0.75)):
        settings.ratio = ratio
        settings.keyframe_insert('ratio', frame=frame)
    bpy.context.scene.frame_set(11)
    assert count(stipple, budgeted) == 300
    bpy.context.scene.frame_set(1)
    assert count(stipple, budgeted) == 100
    name = budgeted.name
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'a.blend'))
    obj = bpy.data.objects[name]
    assert count(stipple, obj) == 100
    bpy.context.scene.frame_set(6)
    assert count(stipple, obj) == 200


@pytest.mark.parametrize('mask_first', [False, True])
def test_a_mask_holds_at_every_budget(stipple, tmp_path, arrays, mask_first):
    arrays.sh[:] = 0
    cube = box(size=0.7)
    bpy.context.view_layer.update()
    inside = in_box(arrays.positions, cube)
    arrays.sh[~inside, 0, 0] = 9.0  # red is what must never show
    obj = import_arrays(stipple, tmp_path, arrays)
    steps = [('crop_by_box', (obj, cube)), ('add_budget', (obj,))]
    for operator, chosen in steps if mask_first else steps[::-1]:
        scenes.select(*chosen)
        assert getattr(bpy.ops.stipple, operator)() == {'FINISHED'}
    kept = np.count_nonzero(inside)
    assert stipple.scene.source.sources.visible_count(obj.data.stipple) == kept
    np.testing.assert_array_equal(read(stipple, obj).positions, arrays.positions[inside])
    for ratio in (0.5, 0.1, 0.0):
        obj.data.stipple.ratio = ratio
        shown = read(stipple, obj)
        assert shown.count == max(1, round(kept * ratio))
        np.testing.assert_array_equal(shown.sh, 0)
        # A merge lies among what it is made of.
        assert np.abs(shown.positions).max() <= 0.7
    scenes.select(obj)
    obj.data.stipple.ratio = 1.0
    assert bpy.ops.stipple.clear_mask() == {'FINISHED'}
    np.testing.assert_array_equal(read(stipple, obj).positions, arrays.positions)


def test_floaters_of_a_tree_are_looked_for_in_all_its_splats(stipple, tmp_path, arrays):
    arrays.opacities[:] = 0.9
    arrays.opacities[:30] = 0.01
    obj = import_arrays(stipple, tmp_path, arrays)
    scenes.select(obj)
    bpy.ops.stipple.add_budget()
    obj.data.stipple.ratio = 0.1
    assert bpy.ops.stipple.delete_floaters(by_size=False, by_connectivity=False) == {'FINISHED'}
    assert stipple.scene.source.sources.visible_count(obj.data.stipple) == COUNT - 30
    assert count(stipple, obj) == round((COUNT - 30) * 0.1)


def test_apply_keeps_the_budget(stipple, budgeted):
    before = read(stipple, budgeted).positions
    budgeted.data.stipple.ratio = 0.5
    budgeted.matrix_world = Matrix.Translation((0, 0, 3)) @ Matrix.Scale(2, 4)
    scenes.select(budgeted)
    assert bpy.ops.stipple.apply_transform() == {'FINISHED'}
    assert budgeted.data.stipple.source_kind == 'TREE' and count(stipple, budgeted) == COUNT // 2
    budgeted.data.stipple.ratio = 1.0
    np.testing.assert_allclose(read(stipple, budgeted).positions, before * 2 + (0, 0, 3), atol=1e-5)


def foreign(stipple, arrays, name='foreign'):
    """Splats by their attributes alone, as another importer leaves them."""
    splat_data = stipple.scene.source.splat_data
    data = splat_data.new_data(name)
    splat_data.write(data, arrays)
    for key in [key for key in data.keys() if key.startswith('stipple_')]:
        del data[key]
    assert not splat_data.is_splats(data)
    return scenes.link(bpy.data.objects.new(name, data))


def test_foreign_splats_get_a_budget_in_place(stipple, tmp_path, arrays):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    obj = foreign(stipple, arrays)
    scenes.select(obj)
    assert bpy.ops.stipple.add_budget() == {'FINISHED'}
    assert bpy.context.object == obj
    assert_same_splats(read(stipple, obj), arrays)
    obj.data.stipple.ratio = 0.25
    assert count(stipple, obj) == COUNT // 4


def assert_same_splats(a, b):
    """Quaternions that come from attributes are given length 1, which moves the last bit of some."""
    np.testing.assert_allclose(a.rotations, b.rotations, atol=1.2e-7)
    a.rotations = b.rotations
    assert_equal(a, b)


def points_modifier(obj):
    """Geometry nodes that turn the object's vertices into points, attributes and all."""
    group = bpy.data.node_groups.new('points', 'GeometryNodeTree')
    if bpy.app.version >= (4, 0, 0):
        group.interface.new_socket('Geometry', in_out='INPUT', socket_type='NodeSocketGeometry')
        group.interface.new_socket('Geometry', in_out='OUTPUT', socket_type='NodeSocketGeometry')
    else:
        group.inputs.new('NodeSocketGeometry', 'Geometry')
        group.outputs.new('NodeSocketGeometry', 'Geometry')
    start, end = group.nodes.new('NodeGroupInput'), group.nodes.new('NodeGroupOutput')
    if obj.type == 'MESH':
        points = group.nodes.new('GeometryNodeMeshToPoints')
        group.links.new(start.outputs[0], points.inputs[0])
        group.links.new(points.outputs[0], end.inputs[0])
    else:
        group.links.new(start.outputs[0], end.inputs[0])
    modifier = obj.modifiers.new('points', 'NODES')
    modifier.node_group = group


def test_results_of_geometry_nodes_get_a_budget(stipple, tmp_path, arrays):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    maker = foreign(stipple, arrays)
    maker.matrix_world = Matrix.Translation((1, 2, 3))
    points_modifier(maker)
    scenes.select(maker)
    assert bpy.ops.stipple.add_budget() == {'FINISHED'}
    obj = bpy.context.object
    assert obj != maker and obj.matrix_world == maker.matrix_world and maker.hide_get() and maker.hide_render
    assert_same_splats(read(stipple, obj), arrays)
    obj.data.stipple.ratio = 0.5
    assert count(stipple, obj) == COUNT // 2


def test_what_has_no_splats_is_refused(stipple):
    quad = scenes.quad()
    scenes.select(quad)
    assert not bpy.ops.stipple.add_budget.poll()
    quad.modifiers.new('solid', 'SOLIDIFY')
    scenes.refuses(bpy.ops.stipple.add_budget, "'Quad' shows no splats")
    assert [o.name for o in bpy.data.objects] == ['Quad']


def test_a_dragged_slider_writes_what_fits_and_completes_at_rest(stipple, budgeted):
    sync, settings = stipple.scene.source.sync, budgeted.data.stipple
    with sync.paused():
        settings.ratio = 0.75
    slow = dict(sync._state)
    try:
        sync._state['seconds_per_splat'] = sync.MOVE_SECONDS / 120
        sync.follow(budgeted)
        assert count(stipple, budgeted) == 120 and bpy.app.timers.is_registered(sync.complete)
        assert sync.complete() is None
        assert count(stipple, budgeted) == 300
        with sync.paused():
            settings.ratio = 0.1
        sync.follow(budgeted)
        assert count(stipple, budgeted) == 40
    finally:
        sync._state.update(slow)
        bpy.app.timers.unregister(sync.complete)


def test_a_slider_does_not_wait_for_its_tree_to_be_read(stipple, budgeted, monkeypatch):
    """After a file is opened: the first move leaves the reading to the library's thread, and what it asked for
    follows."""
    sync, sources = stipple.scene.source.sync, stipple.scene.source.sources
    sources.forget()
    monkeypatch.setattr(sources.Model, 'load', None)  # reading on Blender's own thread
    with sync.paused():
        budgeted.data.stipple.ratio = 0.75
    try:
        sync.follow(budgeted)
        until = time.monotonic() + 60
        while sync.complete() is not None:
            assert time.monotonic() < until
            time.sleep(0.01)
        assert count(stipple, budgeted) == 300
        assert not sources.is_reading() and sources.is_at_hand(budgeted.data, 0.0)
    finally:
        bpy.app.timers.unregister(sync.complete)


def test_the_panel_says_what_is_shown(stipple, budgeted):
    budgeted.data.stipple.ratio = 0.5
    label = stipple.panels.data._shown_label(budgeted.data)
    # 14 numbers of a splat and 9 of degree 1, four bytes each.
    assert label == f'Showing 200 of 400 \u00b7 {200 * 92 / 1e6:.1f} MB'


def test_a_missing_tree_is_reported_and_the_splats_stay(stipple, budgeted, tmp_path):
    budgeted.data.stipple.ratio = 0.5
    for path in (tmp_path / 'stipple').iterdir():
        path.unlink()
    budgeted.data.stipple.ratio = 0.25
    assert count(stipple, budgeted) == COUNT // 2
    assert 'is missing' in stipple.scene.source.sync.problems[budgeted.data.name]
