# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that take the shape of a target, or even out: Adapt Mesh to Target, Even Out Mesh."""

import importlib
import math
import re

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from mathutils.bvhtree import BVHTree

import photo_set
import scenes

QUICK = {'steps': 120, 'points': 4000}
# What a ball of 482 vertices, which cannot have the ears' rims, is away from a head of 2 m after few steps: less than a
# fifth of before.
NEAR = 0.03


def head(levels=1, size=2.0):
    """Suzanne, smooth."""
    bpy.ops.mesh.primitive_monkey_add(size=size)
    obj = bpy.context.object
    obj.name = 'Head'
    obj.modifiers.new('Subdivision', 'SUBSURF').levels = levels
    return obj


def template(segments=32, rings=16):
    """A sphere with a UV map, weights and a material."""
    obj = scenes.sphere('Ball', segments, rings)
    scenes.material('Skin', obj=obj)
    group = obj.vertex_groups.new(name='Top')
    for vertex in obj.data.vertices:
        if vertex.co.z > 0:
            group.add([vertex.index], vertex.co.z, 'REPLACE')
    return obj


def coordinates(elements):
    values = np.empty(len(elements) * 3, np.float32)
    elements.foreach_get('co', values)
    return values.reshape(-1, 3)


def shown(obj):
    """[V,3] of what an object shows, in the world."""
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    matrix = np.array(obj.matrix_world)
    values = coordinates(mesh.vertices) @ matrix[:3, :3].T + matrix[:3, 3]
    evaluated.to_mesh_clear()
    return values


def distances(points, obj):
    """From points of the world to what an object shows."""
    tree = BVHTree.FromObject(obj, bpy.context.evaluated_depsgraph_get())
    back = np.linalg.inv(np.array(obj.matrix_world))
    scale = np.array(obj.matrix_world.to_scale())
    assert np.ptp(scale) < 1e-6, 'distances are those of one scale'
    local = points @ back[:3, :3].T + back[:3, 3]
    return np.array([tree.find_nearest(tuple(point))[3] for point in local]) * scale[0]


def keeps(obj):
    """All that must stay, as values that can be compared."""
    mesh = obj.data
    loops, uvs = np.empty(len(mesh.loops), np.int32), np.empty(len(mesh.loops) * 2, np.float32)
    mesh.loops.foreach_get('vertex_index', loops)
    mesh.uv_layers[0].data.foreach_get('uv', uvs)
    weights = [[(g.group, g.weight) for g in vertex.groups] for vertex in mesh.vertices]
    polygons = [(p.loop_start, p.loop_total, p.material_index) for p in mesh.polygons]
    return loops.tobytes(), uvs.tobytes(), weights, polygons, [m.name for m in mesh.materials]


def adapt(target, obj, **settings):
    scenes.select(obj, target)
    return bpy.ops.stipple.mesh_adapt(**{**QUICK, **settings})


def refusal(action):
    with pytest.raises(RuntimeError) as caught:
        action()
    return str(caught.value)


# ---- the shape ----------------------------------------------------------------------------------

def test_a_ball_becomes_a_head_as_a_shape_key(stipple):
    target, obj = head(), template()
    before, kept = coordinates(obj.data.vertices), keeps(obj)
    modifier = obj.modifiers.new('Bevel', 'BEVEL')
    modifier.show_viewport = False
    assert adapt(target, obj) == {'FINISHED'}
    keys = obj.data.shape_keys
    assert [key.name for key in keys.key_blocks] == ['Basis', 'Adapted to Head']
    key = keys.key_blocks[1]
    assert key.value == 1.0 and key.relative_key == keys.reference_key and obj.active_shape_key == key
    np.testing.assert_array_equal(coordinates(keys.reference_key.data), before)
    np.testing.assert_array_equal(coordinates(obj.data.vertices), before)
    assert keeps(obj) == kept and [m.name for m in obj.modifiers] == ['Bevel']
    places = shown(obj)
    np.testing.assert_allclose(places, coordinates(key.data), atol=1e-6)
    assert distances(before, target).mean() > 0.1
    assert distances(places, target).mean() < NEAR
    # The other way round the ears count, too.
    assert distances(shown(target), obj).mean() < 3 * NEAR


def test_both_objects_may_be_turned_moved_and_scaled(stipple, capfd):
    target, obj = head(), template()
    matrix = Matrix.Translation((20, -3, 5)) @ Matrix.Rotation(0.8, 4, 'X') @ Matrix.Scale(3, 4)
    target.matrix_world = matrix
    # Mirrored and of another scale along each axis; its surface lies about the target's.
    obj.matrix_world = matrix @ Matrix.Diagonal((-1.5, 1.1, 0.8, 1))
    assert adapt(target, obj) == {'FINISHED'}
    np.testing.assert_allclose(np.array(obj.matrix_world),
                               np.array(matrix @ Matrix.Diagonal((-1.5, 1.1, 0.8, 1))), atol=1e-5)
    assert distances(shown(obj), target).mean() < 3 * NEAR
    said = capfd.readouterr().out
    assert "'Ball' was" in said and 'point inwards' not in said  # a mirrored object is not inside out


def test_the_shape_can_be_applied(stipple):
    target, obj = head(), template()
    kept, before = keeps(obj), coordinates(obj.data.vertices)
    assert adapt(target, obj, result='APPLY') == {'FINISHED'}
    assert obj.data.shape_keys is None and keeps(obj) == kept
    assert not np.array_equal(coordinates(obj.data.vertices), before)
    assert distances(shown(obj), target).mean() < NEAR


def test_what_is_shown_is_the_new_shape_among_other_keys(stipple):
    """Two targets, one after the other: each adaptation begins with the basis, and the older one goes to 0."""
    target, obj = head(), template()
    obj.shape_key_add(name='Basis')
    smile = obj.shape_key_add(name='Smile')
    smile.value = 0.5
    for point in smile.data:
        point.co.x += 1
    box = scenes.link(bpy.data.objects.new('Box', scenes.quad().data))
    bpy.data.objects.remove(bpy.data.objects['Quad'])
    assert adapt(target, obj) == {'FINISHED'} and smile.value == 0
    first = shown(obj)
    assert adapt(box, obj) == {'FINISHED'}
    keys = obj.data.shape_keys.key_blocks
    assert keys[0].name == 'Basis'
    assert [(key.name, key.value) for key in keys[1:]] == [('Smile', 0.0), ('Adapted to Head', 0.0),
                                                           ('Adapted to Box', 1.0)]
    keys['Adapted to Box'].value, keys['Adapted to Head'].value = 0.0, 1.0
    bpy.context.view_layer.update()
    np.testing.assert_allclose(shown(obj), first, atol=1e-6)


def test_modifiers_of_the_target_count_and_those_of_the_template_do_not(stipple):
    obj, target = template(), scenes.sphere('Target', 16, 8)
    cast = target.modifiers.new('Displace', 'DISPLACE')
    cast.strength = 0.5  # along normals, around a grey of one half: none without a texture
    cast.mid_level = 0.0
    squash = obj.modifiers.new('Displace', 'DISPLACE')
    squash.strength, squash.mid_level = -0.3, 0.0
    assert adapt(target, obj) == {'FINISHED'}
    radii = np.linalg.norm(coordinates(obj.data.shape_keys.key_blocks[1].data), axis=1)
    # Faces of the target's 16 segments lie up to 4 % inside the radius of 1.5.
    np.testing.assert_allclose(radii, 1.47, atol=0.06)


def test_landmarks_are_vertex_groups_with_empties_of_their_names(stipple):
    """A ball onto a larger one: nothing but the landmark tells how it is turned."""
    target = scenes.sphere('Target', 32, 16, radius=1.2)
    obj = template()
    vertex = int(np.argmax(coordinates(obj.data.vertices)[:, 0]))
    obj.vertex_groups.new(name='Nose').add([vertex], 0.7, 'REPLACE')
    obj.vertex_groups['Nose'].add([0], 0.2, 'REPLACE')
    marks = bpy.data.collections.new('Marks')
    bpy.context.scene.collection.children.link(marks)
    nose = bpy.data.objects.new('Nose', None)
    marks.objects.link(nose)
    nose.location = (1.2 * np.cos(0.3), 1.2 * np.sin(0.3), 0)
    assert adapt(target, obj) == {'FINISHED'}
    free = shown(obj)[vertex]
    assert adapt(target, obj, landmarks='Marks') == {'FINISHED'}
    held = shown(obj)[vertex]
    # 0.36 where the free vertex stays. Nothing holds a ball from turning a little on a ball, and Blender 3.4 gives
    # normals that differ in their last bits from run to run: it has come as near as 0.28.
    assert np.linalg.norm(free - nose.location) > 0.2
    assert np.linalg.norm(held - nose.location) < 0.15
    assert distances(shown(obj), target).mean() < NEAR


def test_alignment_brings_a_distant_template_over(stipple):
    target, obj = head(), template()
    obj.location, obj.scale = (30, 0, 0), (0.2, 0.2, 0.2)
    assert adapt(target, obj, alignment='SIZE') == {'FINISHED'}
    assert distances(shown(obj), target).mean() < NEAR


def test_a_target_that_is_inside_out_is_told(stipple, capfd):
    target, obj = head(), template()
    target.data.flip_normals()
    assert adapt(target, obj) == {'FINISHED'}
    assert "The normals of 'Head' point inwards where those of 'Ball' point outwards" in capfd.readouterr().out
    assert distances(shown(obj), target).mean() < NEAR


def test_one_set_of_splats_blends_between_two_targets(stipple):
    """The template's splats follow its keys, whatever shapes these are."""
    obj = template()
    tall, wide = scenes.sphere('Tall', 32, 16), scenes.sphere('Wide', 32, 16)
    tall.scale.z, wide.scale.x = 1.6, 1.6
    for target in (tall, wide):
        assert adapt(target, obj) == {'FINISHED'}
    keys = obj.data.shape_keys.key_blocks
    keys['Adapted to Wide'].value = 0.0
    bpy.context.view_layer.update()
    splats = scenes.make_splats(obj, anchors=500)
    assert bpy.ops.stipple.bind_to_mesh() == {'FINISHED'}
    seen = []
    for values in ((1, 0), (0, 1), (0.5, 0.5)):
        keys['Adapted to Tall'].value, keys['Adapted to Wide'].value = values
        bpy.context.scene.frame_set(bpy.context.scene.frame_current)
        seen.append(stipple.scene.source.splat_data.read(splats.data).positions.copy())
    assert len(seen[0]) == len(seen[1]) == 500
    assert np.ptp(seen[0][:, 2]) > 3 and np.ptp(seen[1][:, 0]) > 3
    # A splat lies on its triangle, whose corners are at the mean; its distance from it is tiny, and turns with it.
    np.testing.assert_allclose(seen[2], (seen[0] + seen[1]) / 2, atol=0.02)


# ---- kinds of targets ---------------------------------------------------------------------------

def test_splats_are_a_target_as_they_are_shown(stipple):
    ball = scenes.sphere('Source', 32, 16, radius=0.7)
    scenes.material('Red', obj=ball)
    splats = scenes.make_splats(ball, anchors=3000)
    splats.location = (0.3, 0, 0)
    obj = template()
    assert adapt(splats, obj) == {'FINISHED'}
    radii = np.linalg.norm(shown(obj) - np.float32([0.3, 0, 0]), axis=1)
    # The ball's faces lie up to 2 % inside; splats lie on them.
    np.testing.assert_allclose(radii, 0.69, atol=0.05)


def test_vertices_without_faces_are_a_target(stipple):
    ball = scenes.sphere('Source', 48, 24, radius=1.4)
    points = scenes.mesh_object('Points', [tuple(v.co) for v in ball.data.vertices], [])
    bpy.data.objects.remove(ball)
    obj = template()
    assert adapt(points, obj) == {'FINISHED'}
    # Vertices lie close together at the poles, and pull there more.
    np.testing.assert_allclose(np.linalg.norm(shown(obj), axis=1), 1.4, atol=0.08)


def test_points_of_geometry_nodes_are_a_target(stipple):
    ball = scenes.sphere('Points', 48, 24, radius=1.4)
    group = bpy.data.node_groups.new('Points', 'GeometryNodeTree')
    if bpy.app.version < (4, 0, 0):
        group.inputs.new('NodeSocketGeometry', 'Geometry')
        group.outputs.new('NodeSocketGeometry', 'Geometry')
    else:
        for way in ('INPUT', 'OUTPUT'):
            group.interface.new_socket('Geometry', in_out=way, socket_type='NodeSocketGeometry')
    start, points, end = (group.nodes.new(kind) for kind in ('NodeGroupInput', 'GeometryNodeMeshToPoints',
                                                             'NodeGroupOutput'))
    group.links.new(start.outputs[0], points.inputs['Mesh'])
    group.links.new(points.outputs[0], end.inputs[0])
    ball.modifiers.new('Points', 'NODES').node_group = group
    ball.location.x = 2
    obj = template()
    obj.location.x = 2
    assert adapt(ball, obj) == {'FINISHED'}
    np.testing.assert_allclose(np.linalg.norm(shown(obj) - np.float32([2, 0, 0]), axis=1), 1.4, atol=0.08)


def test_texts_and_curves_are_targets(stipple):
    bpy.ops.object.text_add()
    text = bpy.context.object
    text.data.extrude = 0.1
    obj = template()
    assert adapt(text, obj, alignment='SIZE') == {'FINISHED'}
    assert obj.data.shape_keys.key_blocks[1].name == 'Adapted to Text'


# ---- evening out --------------------------------------------------------------------------------

def edges_of(obj, positions):
    ends = np.empty(len(obj.data.edges) * 2, np.int32)
    obj.data.edges.foreach_get('vertices', ends)
    ends = ends.reshape(-1, 2)
    return np.linalg.norm(positions[ends[:, 0]] - positions[ends[:, 1]], axis=1)


def cube_ball(squeeze=0.0):
    """A unit sphere of 1,536 quads, with a UV map. squeeze: by how much they are drawn to the top."""
    bpy.ops.mesh.primitive_cube_add(size=2)
    obj = bpy.context.object
    modifier = obj.modifiers.new('Subdivision', 'SUBSURF')
    modifier.levels, modifier.subdivision_type = 4, 'SIMPLE'
    bpy.ops.object.modifier_apply(modifier=modifier.name)
    places = coordinates(obj.data.vertices)
    places /= np.linalg.norm(places, axis=1, keepdims=True)
    places[:, 2] += squeeze * (1 - places[:, 2] ** 2)
    places /= np.linalg.norm(places, axis=1, keepdims=True)
    obj.data.vertices.foreach_set('co', places.ravel())
    obj.data.update()
    return obj


def test_edges_become_even_and_the_shape_stays(stipple):
    obj = cube_ball(squeeze=0.5)
    scenes.select(obj)
    before = shown(obj)
    kept = keeps(obj)
    assert bpy.ops.stipple.mesh_even_out() == {'FINISHED'}
    keys = obj.data.shape_keys.key_blocks
    assert [key.name for key in keys] == ['Basis', 'Evened Out'] and keys[1].value == 1.0
    after = shown(obj)
    spread = [edges_of(obj, places).std() / edges_of(obj, places).mean() for places in (before, after)]
    assert spread[1] < 0.7 * spread[0]
    assert keeps(obj) == kept
    keys[1].value = 0.0
    bpy.context.view_layer.update()
    # They land on the faces; float32 positions of about 1.
    assert distances(after, obj).max() < 1e-5


@pytest.mark.parametrize('angle, keeps_edges', [(math.radians(45), True), (math.pi, False)])
def test_a_box_keeps_its_edges_and_corners(stipple, angle, keeps_edges):
    """A box whose vertices crowd at one corner. With a sharp angle of 180 degrees nothing is sharp."""
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.subdivide(number_cuts=9)
    bpy.ops.object.mode_set(mode='OBJECT')
    obj = bpy.context.object
    for vertex in obj.data.vertices:
        vertex.co = [2 * ((c + 1) / 2) ** 2 - 1 for c in vertex.co]
    before = shown(obj)
    assert bpy.ops.stipple.mesh_even_out(sharp_angle=angle) == {'FINISHED'}
    after = shown(obj)
    lengths = [edges_of(obj, places) for places in (before, after)]
    assert lengths[1].std() / lengths[1].mean() < 0.5 * lengths[0].std() / lengths[0].mean()
    planes = [(np.abs(np.abs(places) - 1) < 1e-6).sum(axis=1) for places in (before, after)]
    assert (planes[1] >= planes[0]).all() == keeps_edges


def test_detail_gets_more_vertices(stipple):
    """A sheet with a narrow bump: edges on it are shorter afterwards."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=30, y_subdivisions=30, size=2)
    obj = bpy.context.object
    for vertex in obj.data.vertices:
        vertex.co.z = 0.4 * np.exp(-40 * ((vertex.co.x - 0.2) ** 2 + vertex.co.y ** 2))
    def on_bump(places):
        middles = np.array([(places[a] + places[b]) / 2 for a, b in (e.vertices for e in obj.data.edges)])
        near = np.hypot(middles[:, 0] - 0.2, middles[:, 1]) < 0.25
        return edges_of(obj, places)[near].mean()
    scenes.select(obj)
    before = shown(obj)
    assert bpy.ops.stipple.mesh_even_out(density='ADAPTIVE') == {'FINISHED'}
    after = shown(obj)
    assert on_bump(after) < 0.85 * on_bump(before)
    # Borders stay on the border.
    border = np.abs(before[:, :2]).max(axis=1) > 0.999
    np.testing.assert_allclose(np.abs(after[border, :2]).max(axis=1), 1, atol=1e-6)


def test_the_present_mix_of_shape_keys_is_evened_out(stipple):
    obj = template()
    obj.shape_key_add(name='Basis')
    key = obj.shape_key_add(name='Up')
    for point in key.data:
        point.co.z += 3
    key.value = 0.5
    scenes.select(obj)
    assert bpy.ops.stipple.mesh_even_out() == {'FINISHED'}
    assert [k.name for k in obj.data.shape_keys.key_blocks] == ['Basis', 'Up', 'Evened Out']
    assert shown(obj)[:, 2].mean() == pytest.approx(1.5, abs=0.05)


# ---- undo, and what is refused -------------------------------------------------------------------

def test_undo_is_one_step(stipple):
    target, obj = head(), template()
    scenes.select(obj, target)
    bpy.ops.ed.undo_push(message='before')
    assert bpy.ops.stipple.mesh_adapt('EXEC_DEFAULT', True, **QUICK) == {'FINISHED'}  # True: with its undo step
    assert bpy.data.objects['Ball'].data.shape_keys is not None
    bpy.ops.ed.undo()
    assert bpy.data.objects['Ball'].data.shape_keys is None
    bpy.ops.ed.redo()
    assert bpy.data.objects['Ball'].data.shape_keys.key_blocks['Adapted to Head'].value == 1.0


def test_selections_that_do_not_fit_are_refused(stipple):
    target, obj = head(), template()
    scenes.select(obj)
    assert 'Select the target first' in refusal(lambda: bpy.ops.stipple.mesh_adapt())
    extra = scenes.quad()
    scenes.select(obj, target, extra)
    assert '2 targets are selected; one is allowed' in refusal(lambda: bpy.ops.stipple.mesh_adapt())
    empty = scenes.link(bpy.data.objects.new('Empty', None))
    scenes.select(empty, target)
    for function in (bpy.ops.stipple.mesh_adapt, bpy.ops.stipple.mesh_even_out):
        assert 'The active object is no mesh' in refusal(function)
    scenes.select(obj, target)
    bpy.ops.object.mode_set(mode='EDIT')
    for function in (bpy.ops.stipple.mesh_adapt, bpy.ops.stipple.mesh_even_out):
        assert 'Go to Object Mode first' in refusal(function)
    bpy.ops.object.mode_set(mode='OBJECT')
    assert obj.data.shape_keys is None


@pytest.mark.parametrize('change, settings, words', [
    (lambda obj, target: setattr(obj, 'scale', (1, 0, 1)), {}, "'Ball' is scaled to zero"),
    (lambda obj, target: setattr(target, 'scale', (0, 0, 0)), {}, 'scaled to zero|no extent'),
    (lambda obj, target: setattr(target, 'data', obj.data), {}, 'share one mesh'),
    (lambda obj, target: obj.shape_key_add(name='Basis'), {'result': 'APPLY'}, 'has shape keys'),
    (lambda obj, target: (obj.shape_key_add(name='Basis'), setattr(obj.data.shape_keys, 'use_relative', False)), {},
     'absolute shape keys'),
    (lambda obj, target: obj.data.clear_geometry(), {}, "'Ball' has no faces"),
    (lambda obj, target: target.data.clear_geometry(), {}, "'Head' has neither faces nor points"),
    (lambda obj, target: setattr(obj.data.vertices[5], 'co', (float('nan'), 0, 0)), {}, 'finite'),
    (lambda obj, target: None, {'landmarks': 'Nowhere'}, "no collection 'Nowhere'")])
def test_what_cannot_be_adapted_is_refused_in_one_sentence(stipple, change, settings, words):
    target, obj = head(), template()
    change(obj, target)
    keys = obj.data.shape_keys and len(obj.data.shape_keys.key_blocks)
    text = refusal(lambda: adapt(target, obj, **settings))
    assert re.search(words, text) and text.strip().count('\n') == 0, text
    assert (obj.data.shape_keys and len(obj.data.shape_keys.key_blocks)) == keys


def test_landmarks_need_a_group_with_a_vertex(stipple):
    target, obj = head(), template()
    marks = bpy.data.collections.new('Marks')
    marks.objects.link(bpy.data.objects.new('Ear', None))
    assert "'Ball' has no vertex group 'Ear'" in refusal(lambda: adapt(target, obj, landmarks='Marks'))
    obj.vertex_groups.new(name='Ear')
    assert "No vertex of 'Ball' is in the vertex group 'Ear'" in refusal(lambda: adapt(target, obj, landmarks='Marks'))


def test_linked_meshes_are_refused(stipple, tmp_path):
    template()
    path = str(tmp_path / 'library.blend')
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(path, link=True) as (_, into):
        into.objects = ['Ball']
    target, obj = head(), scenes.link(bpy.data.objects['Ball'])
    assert "'Ball' is linked from another file" in refusal(lambda: adapt(target, obj))


# ---- images --------------------------------------------------------------------------------------

@pytest.fixture
def photographed(stipple, tmp_path):
    """(the head, its data set: 12 images around it in the light of a world)."""
    target = head()
    target.rotation_euler = (0.3, 0.0, 0.8)
    scenes.material('Clay', obj=target)
    bpy.context.view_layer.update()
    capture = importlib.import_module('.scene.fit.view_capture', stipple.__name__)
    rigs = importlib.import_module('.scene.fit.view_rigs', stipple.__name__)
    photo_set.write(rigs, capture, target, tmp_path / 'set', 12, capture.CaptureSettings('CYCLES', 64, 4))
    return target, tmp_path / 'set'


@pytest.mark.parametrize('drawing', ['TRIANGLES', 'SPLATS'])
def test_a_ball_takes_the_shape_that_images_show(stipple, photographed, capfd, drawing):
    target, folder = photographed
    obj = template()
    obj.location, obj.scale = (1.0, 0.2, -0.5), (0.5, 0.5, 0.5)
    scenes.select(obj)
    weights = [[entry.weight for entry in vertex.groups] for vertex in obj.data.vertices]
    done = bpy.ops.stipple.mesh_adapt_to_images(filepath=str(folder / 'transforms.json'), alignment='SIZE', steps=150,
                                                image_size=64, drawing=drawing)
    assert done == {'FINISHED'}
    assert re.search(r"'Ball' differed from the images of 'set' by \d+\.\d\d% on average, and differs by 0\.\d\d% now",
                     capfd.readouterr().out)
    key = obj.data.shape_keys.key_blocks['Adapted to set']
    assert key.value == 1.0
    assert [[entry.weight for entry in vertex.groups] for vertex in obj.data.vertices] == weights
    # A pixel is 0.06 where the head is. Half of the vertices, since the back of the eyes shows in no outline; and
    # splats have softer ones than triangles.
    assert np.median(distances(shown(obj), target)) < (0.03 if drawing == 'TRIANGLES' else 0.05)


def test_images_without_transparency_are_refused(stipple, photographed):
    _, folder = photographed
    for path in folder.glob('*.png'):
        image = bpy.data.images.load(str(path))
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        pixels[3::4] = 1
        image.pixels.foreach_set(pixels)
        image.alpha_mode = 'NONE'
        image.save()
    obj = template()
    scenes.select(obj)
    words = refusal(lambda: bpy.ops.stipple.mesh_adapt_to_images(filepath=str(folder / 'transforms.json'), steps=5))
    assert 'fitted to images that show where it ends' in words and obj.data.shape_keys is None


# ---- what a preview leaves -----------------------------------------------------------------------

@pytest.mark.parametrize('result, has_keys', [('SHAPE_KEY', False), ('SHAPE_KEY', True), ('APPLY', False)])
def test_a_preview_can_be_taken_back(stipple, result, has_keys):
    adapting = stipple.scene.adapting
    obj = template()
    if has_keys:
        obj.shape_key_add(name='Basis')
        obj.shape_key_add(name='Smile').value = 0.25
    before = coordinates(obj.data.vertices)
    given = adapting.template_of(obj, result, False)
    place = adapting.Shown(given, result, 'New')
    place.write(given.positions + np.float32([0, 0, 2]))
    place.write(given.positions + np.float32([0, 0, 5]))
    bpy.context.view_layer.update()
    assert shown(obj)[:, 2].mean() == pytest.approx(5, abs=1e-5)
    place.take_back()
    bpy.context.view_layer.update()
    np.testing.assert_array_equal(coordinates(obj.data.vertices), before)
    keys = obj.data.shape_keys
    assert (keys is not None) == has_keys
    if has_keys:
        assert [key.name for key in keys.key_blocks] == ['Basis', 'Smile'] and keys.key_blocks[1].value == 0.25


def test_a_mesh_that_was_changed_meanwhile_is_left_alone(stipple):
    adapting = stipple.scene.adapting
    obj = template()
    given = adapting.template_of(obj, 'SHAPE_KEY', False)
    place = adapting.Shown(given, 'SHAPE_KEY', 'New')
    obj.data.vertices.add(1)
    with pytest.raises(stipple.binding.errors.StippleError, match='are others now'):
        place.write(given.positions)
    bpy.data.objects.remove(obj)
    with pytest.raises(stipple.binding.errors.StippleError, match='is not there any more'):
        place.write(given.positions)
