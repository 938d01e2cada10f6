# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine: passes, film, border, instances, colour, cancel."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

import scenes

RED = (0.8, 0.1, 0.05)

# A quarter of the square's size: 200 splats a pixel, each of which the mip low-pass makes so faint that the cut-off at
# 1/255 takes some of it. Closed surfaces have 0.98 where splats are larger.
SMALL_SQUARE_ALPHA = 0.96


@pytest.fixture
def square():
    """An opaque red square of 2 x 2 metres under a camera that sees 3 x 3 metres of its plane."""
    quad = scenes.quad()
    scenes.material('red', RED, quad)
    obj = scenes.make_splats(quad, anchors=20000)
    scenes.camera((0, 0, 6), width=60, height=60, type='ORTHO', ortho_scale=3.0)
    scene = bpy.context.scene
    scene.render.engine = 'STIPPLE'
    scene.render.film_transparent = True
    return obj


def test_combined_is_premultiplied_scene_linear(square, tmp_path):
    picture = scenes.render_pixels(tmp_path)
    inside = picture[15:45, 15:45]
    assert inside[..., 3].min() >= 0.98
    # Colours pass through display space in single precision; a splat at its edge is no darker than alpha says.
    straight = inside[..., :3] / inside[..., 3:]
    np.testing.assert_allclose(straight.mean(axis=(0, 1)), RED, atol=2e-3)
    assert np.abs(picture[:5]).max() == 0 and np.abs(picture[:, -5:]).max() == 0


def test_rows_are_bottom_up_and_columns_left_to_right(square, tmp_path):
    square.location = (0.3, 0.25, 0.0)
    alpha = scenes.render_pixels(tmp_path)[..., 3]
    rows, columns = np.nonzero(alpha > 0.5)
    # Pixels of 1/20 metre; the centre of the square lands within half a pixel.
    assert abs(columns.mean() + 0.5 - 36) < 0.5
    assert abs(rows.mean() + 0.5 - 35) < 0.5


def test_world_background_fills_the_film(square, tmp_path):
    scene = bpy.context.scene
    scene.render.film_transparent = False
    scene.world = bpy.data.worlds.new('world')
    if bpy.app.version < (5, 0, 0):
        scene.world.use_nodes = True
    background = next(n for n in scene.world.node_tree.nodes if n.type == 'BACKGROUND')
    background.inputs['Color'].default_value, background.inputs['Strength'].default_value = (0.1, 0.2, 0.3, 1), 2.0
    picture = scenes.render_pixels(tmp_path)
    np.testing.assert_allclose(picture[0, 0], (0.2, 0.4, 0.6, 1.0), atol=1e-5)
    assert picture[..., 3].min() > 0.9999


def test_depth_is_planar_and_huge_where_nothing_is(square, tmp_path, depths):
    bpy.context.view_layer.use_pass_z = True
    square.location.z = 1.0
    scenes.render_pixels(tmp_path)
    depth = depths[-1]
    # A square at z = 1 under a camera at z = 6.
    np.testing.assert_allclose(depth[20:40, 20:40], 5.0, atol=1e-3)
    assert (depth[:5] == np.float32(1e10)).all()


def test_border_is_a_part_of_the_whole(square, tmp_path):
    scene = bpy.context.scene
    whole = scenes.render_pixels(tmp_path, 'whole')
    render = scene.render
    render.use_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.2, 0.7, 0.3, 0.55
    part = scenes.render_pixels(tmp_path, 'part')
    assert part.shape == whole.shape
    np.testing.assert_allclose(part[18:33, 12:42], whole[18:33, 12:42], atol=1e-6)
    assert np.abs(part[:18]).max() == 0 and np.abs(part[33:]).max() == 0 and np.abs(part[:, :12]).max() == 0
    render.use_crop_to_border = True
    np.testing.assert_allclose(scenes.render_pixels(tmp_path, 'crop'), whole[18:33, 12:42], atol=1e-6)


def test_resolution_percentage(square, tmp_path):
    bpy.context.scene.render.resolution_percentage = 50
    assert scenes.render_pixels(tmp_path).shape == (30, 30, 4)


def test_instances_and_duplicates_render_together(square, tmp_path):
    square.scale = (0.25, 0.25, 0.25)
    kept = bpy.data.collections.new('kept')
    bpy.context.scene.collection.objects.unlink(square)
    kept.objects.link(square)
    for x in (-0.9, 0.0, 0.9):
        empty = scenes.link(bpy.data.objects.new('empty', None))
        empty.instance_type, empty.instance_collection = 'COLLECTION', kept
        empty.matrix_world = Matrix.Translation((x, 0, 0))
    alpha = scenes.render_pixels(tmp_path)[..., 3]
    np.testing.assert_array_equal(alpha[30, [12, 30, 48]] > SMALL_SQUARE_ALPHA, True)
    np.testing.assert_array_equal(alpha[30, [3, 21, 39, 57]] == 0, True)


def test_hidden_objects_are_left_out(square, tmp_path):
    square.hide_render = True
    assert scenes.render_pixels(tmp_path)[..., 3].max() == 0


def test_objects_in_an_excluded_collection_are_left_out(square, tmp_path):
    kept = bpy.data.collections.new('kept')
    bpy.context.scene.collection.objects.unlink(square)
    kept.objects.link(square)
    bpy.context.scene.collection.children.link(kept)
    assert scenes.render_pixels(tmp_path, 'a')[..., 3].max() > 0.98
    bpy.context.view_layer.layer_collection.children['kept'].exclude = True
    assert scenes.render_pixels(tmp_path, 'b')[..., 3].max() == 0


def test_render_budget_is_used_and_nothing_is_written(square, tmp_path, stipple, monkeypatch):
    asked = []
    decode = stipple.binding.model.Model.decode_start
    monkeypatch.setattr(stipple.binding.model.Model, 'decode_start',
                        lambda self, settings: asked.append(settings.anchors) or decode(self, settings))
    square.data.stipple.anchors_render = 30000
    before = stipple.scene.source.splat_data.fingerprint(square.data)
    scenes.render_pixels(tmp_path)
    assert asked == [30000]
    assert stipple.scene.source.splat_data.count(square.data) == 20000
    assert stipple.scene.source.splat_data.fingerprint(square.data) == before
    scenes.render_pixels(tmp_path)
    assert asked == [30000]  # kept from the first picture


def test_render_budget_out_of_range_is_one_error(square, tmp_path):
    square.data.stipple.anchors_render = -3
    scenes.refuses(lambda: scenes.render_pixels(tmp_path), 'Anchor budget is -3; allowed are 1 to 268,435,456')


def test_edited_attributes_are_rendered_as_they_are(square, tmp_path):
    data = square.data
    collection, field = (data.vertices, 'co') if isinstance(data, bpy.types.Mesh) else (
        data.attributes['position'].data, 'vector')
    values = np.empty(len(collection) * 3, np.float32)
    collection.foreach_get(field, values)
    values[0::3] += 10.0
    collection.foreach_set(field, values)
    data.update_tag()
    assert scenes.render_pixels(tmp_path)[..., 3].max() == 0


def test_scene_linear_and_as_trained_differ_only_where_splats_mix(stipple, tmp_path):
    """Half-transparent white over black: 0.5 in display space is 0.214 in light, 0.5 in scene linear."""
    cloud = stipple.binding.cloud
    dc = 0.28209479177387814
    arrays = cloud.SplatArrays(
        np.array([[0, 0, 1], [0, 0, 0]], np.float32), np.array([[1, 0, 0, 0]] * 2, np.float32),
        np.full((2, 3), 0.5, np.float32), np.array([0.5, 0.99], np.float32),
        np.array([[[0.5 / dc] * 3], [[-0.5 / dc] * 3]], np.float32))
    data = stipple.scene.source.splat_data.new_data('two')
    stipple.scene.source.splat_data.write(data, arrays)
    scenes.link(bpy.data.objects.new('two', data))
    scenes.camera((0, 0, 6), width=101, height=101, type='ORTHO', ortho_scale=4.0)
    scene = bpy.context.scene
    scene.render.engine, scene.render.film_transparent = 'STIPPLE', True
    scene.stipple.splat_color = 'AS_TRAINED'
    trained = scenes.render_pixels(tmp_path, 'trained')[50, 50]
    scene.stipple.splat_color = 'SCENE_LINEAR'
    linear = scenes.render_pixels(tmp_path, 'linear')[50, 50]
    assert abs(linear[0] - 0.5) < 2e-3
    # Alpha is 0.995, so the straight display value is 0.5 / 0.995.
    assert abs(trained[0] - 0.214) < 4e-3
    assert abs(trained[3] - linear[3]) < 1e-6


def test_standard_view_is_offered_and_set(stipple):
    scene = bpy.context.scene
    scene.view_settings.view_transform = 'Filmic' if bpy.app.version < (4, 0, 0) else 'AgX'
    assert not stipple.scene.view.facts.uses_standard_view(scene)
    assert bpy.ops.stipple.use_standard_view() == {'FINISHED'}
    assert stipple.scene.view.facts.uses_standard_view(scene)


def test_cancel_half_way_leaves_no_damage(square, tmp_path, stipple, monkeypatch):
    """A large picture is stopped at the second look; afterwards the same scene renders as before."""
    reference = scenes.render_pixels(tmp_path, 'before')
    looks = []
    monkeypatch.setattr(stipple.engine, 'POLL_SECONDS', 0.0)
    kept = stipple.engine.STIPPLE_RE_engine._cancelled

    def cancelled(self):
        looks.append(True)
        return len(looks) > 1

    monkeypatch.setattr(stipple.engine.STIPPLE_RE_engine, '_cancelled', cancelled)
    scene = bpy.context.scene
    scene.render.resolution_percentage = 5000
    before = stipple.scene.source.splat_data.fingerprint(square.data)
    bpy.ops.render.render()
    assert len(looks) > 1
    monkeypatch.setattr(stipple.engine.STIPPLE_RE_engine, '_cancelled', kept)
    scene.render.resolution_percentage = 100
    assert stipple.scene.source.splat_data.fingerprint(square.data) == before
    np.testing.assert_array_equal(scenes.render_pixels(tmp_path, 'after'), reference)


def test_modifiers_are_rendered(square, tmp_path):
    """An array modifier on splats: the engine shows the evaluated attributes."""
    if not isinstance(square.data, bpy.types.Mesh):
        pytest.skip('array modifiers work on meshes')
    square.scale = (0.25, 0.25, 0.25)
    array = square.modifiers.new('array', 'ARRAY')
    array.use_relative_offset, array.use_constant_offset = False, True
    array.constant_offset_displace = (4.0, 0.0, 0.0)
    alpha = scenes.render_pixels(tmp_path)[..., 3]
    assert alpha[30, 30] > SMALL_SQUARE_ALPHA and alpha[30, 50] > SMALL_SQUARE_ALPHA and alpha[30, 40] == 0
