# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats that follow a mesh as it deforms: Bind to Mesh."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

import scenes
import series
from test_files import write_ply
from test_source_travel import reopen, save
from test_splat_data import make_arrays

COUNT = 500


def splats_of(stipple, obj):
    return stipple.scene.source.splat_data.read(obj.data)


def positions(stipple, obj):
    return splats_of(stipple, obj).positions


def animate_up(mesh, height=1.0):
    """A shape key that lifts the mesh by height from frame 1 to 11, by half of it at 6."""
    mesh.shape_key_add(name='Basis')
    key = mesh.shape_key_add(name='Up')
    for point in key.data:
        point.co.z += height
    for frame, value in ((1, 0.0), (11, 1.0)):
        key.value = value
        key.keyframe_insert('value', frame=frame)
    bpy.context.scene.frame_set(1)


def animated_square():
    mesh = scenes.quad()
    scenes.material('Red', obj=mesh)
    animate_up(mesh)
    return mesh


@pytest.fixture
def bound(stipple):
    """(splats, mesh): splats of an animated square, bound to it at frame 1."""
    mesh = animated_square()
    splats = scenes.make_splats(mesh, anchors=COUNT)
    assert bpy.ops.stipple.bind_to_mesh() == {'FINISHED'}
    return splats, mesh


def scan(stipple, folder, name='scan'):
    """Splats of a file, as they are, selected."""
    folder.mkdir(exist_ok=True)
    arrays = make_arrays(stipple, COUNT, degree=2)
    arrays.positions *= np.float32(0.5) / np.abs(arrays.positions).max()
    write_ply(stipple, folder / f'{name}.ply', arrays)
    assert bpy.ops.stipple.splats_import(filepath=str(folder / f'{name}.ply'), up_axis='Z') == {'FINISHED'}
    return bpy.context.object


def cage(height=1.0):
    """A box of a few faces around the splats of scan(), which a lattice of shape keys lifts."""
    bpy.ops.mesh.primitive_cube_add(size=2.0)
    mesh = bpy.context.object
    mesh.modifiers.new('Subdivision', 'SUBSURF').subdivision_type = 'SIMPLE'
    animate_up(mesh, height)
    return mesh


# ---- following ----------------------------------------------------------------------------------

def test_splats_follow_a_shape_key(stipple, bound):
    splats, mesh = bound
    assert mesh.hide_get() and splats.parent == mesh
    rest = positions(stipple, splats)
    for frame, height in ((6, 0.5), (11, 1.0), (1, 0.0)):
        bpy.context.scene.frame_set(frame)
        np.testing.assert_allclose(positions(stipple, splats), rest + np.float32([0, 0, height]), atol=1e-6)
    # Between two frames, too.
    bpy.context.scene.frame_set(5, subframe=0.5)
    assert 0.1 < positions(stipple, splats)[:, 2].mean() - rest[:, 2].mean() < 0.5


def test_shapes_and_colours_turn_with_an_armature(stipple, tmp_path):
    """One bone that carries the whole mesh is a rigid motion: splats go as their object would."""
    splats = scan(stipple, tmp_path)
    mesh = scenes.sphere(segments=12, rings=6, radius=0.6)
    armature = scenes.link(bpy.data.objects.new('Rig', bpy.data.armatures.new('Rig')))
    scenes.select(armature)
    bpy.ops.object.mode_set(mode='EDIT')
    bone = armature.data.edit_bones.new('Bone')
    bone.tail = (0, 0, 1)
    bpy.ops.object.mode_set(mode='OBJECT')
    mesh.vertex_groups.new(name='Bone').add(range(len(mesh.data.vertices)), 1.0, 'REPLACE')
    mesh.modifiers.new('Armature', 'ARMATURE').object = armature
    scenes.select(mesh, splats)
    assert bpy.ops.stipple.bind_to_mesh(reach='AROUND') == {'FINISHED'}
    rest = splats_of(stipple, splats)
    matrix = Matrix.Translation((0.3, -0.2, 0.5)) @ Matrix.Rotation(0.7, 4, 'X')
    armature.pose.bones['Bone'].matrix = matrix @ armature.data.bones['Bone'].matrix_local
    bpy.context.view_layer.update()
    native = stipple.scene.source.sources.context()
    wanted = rest.to_cloud(native).transformed(np.array(matrix)).read()
    found = splats_of(stipple, splats)
    # Float32 in Blender's armature and in the triangles' frames.
    np.testing.assert_allclose(found.positions, wanted.positions, atol=5e-6)
    np.testing.assert_allclose(found.scales, wanted.scales, rtol=1e-4)
    np.testing.assert_allclose(np.abs((found.rotations * wanted.rotations).sum(axis=1)), 1, atol=1e-4)
    np.testing.assert_allclose(found.sh, wanted.sh, atol=1e-4)
    assert np.abs(found.sh[:, 1:] - rest.sh[:, 1:]).max() > 0.01


def test_the_mesh_may_move_and_the_splats_too(stipple, bound):
    splats, mesh = bound
    rest = positions(stipple, splats)
    mesh.location.x = 3
    splats.location.y = 2
    bpy.context.scene.frame_set(11)
    np.testing.assert_allclose(positions(stipple, splats), rest + np.float32([0, 0, 1]), atol=1e-6)
    assert tuple(splats.matrix_world.translation) == (3, 2, 0)


def test_without_a_parent_the_object_stays(stipple):
    mesh = animated_square()
    mesh.location.x, mesh.scale = 1, (2, 2, 2)
    splats = scenes.make_splats(mesh, anchors=COUNT)
    splats.matrix_world = Matrix.Rotation(0.5, 4, 'Z')
    bpy.context.view_layer.update()
    assert bpy.ops.stipple.bind_to_mesh(parent=False) == {'FINISHED'}
    assert splats.parent is None
    rest = positions(stipple, splats)
    bpy.context.scene.frame_set(11)
    # The mesh is twice as large as its shape key.
    np.testing.assert_allclose(positions(stipple, splats), rest + np.float32([0, 0, 2]), atol=2e-6)


@pytest.mark.parametrize('hide', ['object', 'collection'])
def test_hidden_meshes_are_followed(stipple, bound, hide, tmp_path):
    splats, mesh = bound
    if hide == 'object':
        mesh.hide_viewport = mesh.hide_render = True
    else:
        collection = bpy.data.collections.new('cages')
        bpy.context.scene.collection.children.link(collection)
        collection.objects.link(mesh)
        bpy.context.scene.collection.objects.unlink(mesh)
        bpy.context.view_layer.layer_collection.children['cages'].exclude = True
    rest = positions(stipple, splats)
    bpy.context.scene.frame_set(11)
    np.testing.assert_allclose(positions(stipple, splats), rest + np.float32([0, 0, 1]), atol=1e-6)
    assert picture_height(tmp_path) == pytest.approx(1.0, abs=0.05)


def picture_height(tmp_path, engine='STIPPLE'):
    """How high the splats of the square are in a render of the present frame, seen from the side."""
    bpy.context.scene.render.engine = engine
    bpy.context.scene.render.film_transparent = True
    scenes.camera((0, -6, 0), (np.pi / 2, 0, 0), width=64, height=64, type='ORTHO', ortho_scale=4.0)
    opacity = scenes.render_pixels(tmp_path, engine)[..., 3].sum(axis=1)
    assert opacity.sum() > 1
    return (opacity @ (np.arange(64) + 0.5) / opacity.sum() - 32) / 64 * 4


def test_cycles_and_stipple_follow_too(stipple, bound, tmp_path):
    mesh = bound[1]
    mesh.hide_render = True
    bpy.context.scene.frame_set(11)
    bpy.context.scene.cycles.samples = 2
    bpy.context.scene.cycles.use_denoising = False
    assert picture_height(tmp_path, 'STIPPLE_CYCLES') == pytest.approx(1.0, abs=0.05)


# ---- images -------------------------------------------------------------------------------------

@pytest.mark.parametrize('kind', ['file', 'budget', 'model'])
def test_renders_have_the_shape_of_their_frame(stipple, tmp_path, kind):
    """Whatever the viewport showed last: an image is that of the carried splats as an object of their own."""
    mesh = cage() if kind != 'model' else animated_square()
    splats = scenes.make_splats(mesh, anchors=COUNT) if kind == 'model' else scan(stipple, tmp_path)
    if kind == 'budget':
        assert bpy.ops.stipple.add_budget() == {'FINISHED'}
        splats.data.stipple.ratio = 0.3
        splats.data.stipple.ratio_render = 0.8
    scenes.select(mesh, splats)
    assert bpy.ops.stipple.bind_to_mesh(reach='SURFACE' if kind == 'model' else 'AROUND') == {'FINISHED'}
    mesh.hide_render = True
    scene = bpy.context.scene
    scene.render.engine = 'STIPPLE'
    scenes.camera((0, 0, 6), width=48, height=48)
    scene.frame_set(11)
    scenes.select(splats)
    assert bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'posed.ply'), budget='RENDER', use_selection=True,
                                         up_axis='Z') == {'FINISHED'}
    # The window's frame is another one when the animation is rendered.
    scene.frame_set(1)
    scenes.write_exact_pictures()
    scene.frame_start = scene.frame_end = 11
    scene.render.filepath = str(tmp_path / 'out_####.exr')
    bpy.ops.render.render(animation=True)
    found = scenes.picture_pixels(tmp_path / 'out_0011.exr')
    bpy.data.objects.remove(splats)
    assert bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'posed.ply'), up_axis='Z') == {'FINISHED'}
    wanted = scenes.render_pixels(tmp_path, 'wanted')
    assert wanted[..., 3].max() > 0.3
    np.testing.assert_allclose(found, wanted, atol=2e-4)


def test_a_budget_moves_while_splats_follow(stipple, bound):
    splats, _ = bound
    bpy.context.scene.frame_set(11)
    for budget in (50, 300, COUNT):
        splats.data.stipple.anchors = budget
        found = positions(stipple, splats)
        assert len(found) == budget
        np.testing.assert_allclose(found[:, 2], 1.0, atol=1e-6)


def test_frames_of_an_animation_are_files(stipple, bound, tmp_path):
    splats, _ = bound
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 5, 7
    scenes.select(splats)
    assert bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'a.ply'), frames='SCENE', use_selection=True,
                                         up_axis='Z') == {'FINISHED'}
    heights = []
    for number in (5, 6, 7):
        path = next(p for p in tmp_path.iterdir() if p.name.endswith(f'{number}.ply'))
        cloud = stipple.binding.cloud.Cloud.load(stipple.scene.source.sources.context(), str(path))
        heights.append(cloud.positions()[:, 2].mean())
    assert heights[0] < heights[1] < heights[2] and heights[1] == pytest.approx(0.5, abs=1e-5)


# ---- files --------------------------------------------------------------------------------------

def test_a_binding_is_saved_and_appended(stipple, bound, tmp_path):
    splats, mesh = bound
    rest, name = positions(stipple, splats), splats.name
    save(tmp_path / 'here' / 'a.blend')
    reopen(tmp_path / 'here' / 'a.blend')
    stipple.scene.source.decoded.forget()
    bpy.context.scene.frame_set(11)
    np.testing.assert_allclose(positions(stipple, bpy.data.objects[name]), rest + np.float32([0, 0, 1]), atol=1e-6)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    save(tmp_path / 'there' / 'b.blend')
    with bpy.data.libraries.load(str(tmp_path / 'here' / 'a.blend')) as (_, loaded):
        loaded.objects = [name, mesh_name(name)]
    for obj in loaded.objects:
        scenes.link(obj)
    bpy.context.scene.frame_set(6)
    appended = bpy.data.objects[name]
    assert stipple.scene.source.sync.problems == {}
    np.testing.assert_allclose(positions(stipple, appended), rest + np.float32([0, 0, 0.5]), atol=1e-6)


def mesh_name(name):
    return name.partition(' ')[0]


def test_duplicates_follow_alike(stipple, bound):
    splats, _ = bound
    scenes.select(splats)
    bpy.ops.object.duplicate(linked=False)
    copy = bpy.context.object
    assert copy.data != splats.data
    bpy.context.scene.frame_set(11)
    np.testing.assert_allclose(positions(stipple, copy), positions(stipple, splats))
    assert positions(stipple, copy)[:, 2].mean() == pytest.approx(1.0, abs=1e-5)


def test_unbind_goes_back_to_rest(stipple, bound):
    splats, _ = bound
    rest = positions(stipple, splats)
    bpy.context.scene.frame_set(11)
    scenes.select(splats)
    assert bpy.ops.stipple.unbind() == {'FINISHED'}
    np.testing.assert_allclose(positions(stipple, splats), rest, atol=1e-6)
    bpy.context.scene.frame_set(6)
    np.testing.assert_allclose(positions(stipple, splats), rest, atol=1e-6)
    assert len(splats.constraints) == 0 and splats.data.stipple.bind_object is None
    assert not any(mesh.name.endswith('at rest') for mesh in bpy.data.meshes)
    assert not bpy.ops.stipple.unbind.poll()


def test_edits_wait_until_splats_rest(stipple, tmp_path):
    splats, mesh = scan(stipple, tmp_path), cage()
    scenes.select(mesh, splats)
    assert bpy.ops.stipple.bind_to_mesh(reach='AROUND') == {'FINISHED'}
    bpy.context.scene.frame_set(11)
    scenes.select(splats)
    scenes.refuses(lambda: bpy.ops.stipple.delete_floaters(), 'turn Follow Mesh off')
    splats.data.stipple.bind_follow = False
    before = positions(stipple, splats)
    assert abs(before[:, 2].mean()) < 0.2
    assert bpy.ops.stipple.delete_floaters(min_opacity=0.5) == {'FINISHED'}
    left = positions(stipple, splats)
    assert 0 < len(left) < len(before)
    splats.data.stipple.bind_follow = True
    np.testing.assert_allclose(positions(stipple, splats), left + np.float32([0, 0, 1]), atol=5e-6)


def test_a_new_source_is_at_rest_in_the_present_shape(stipple, bound):
    """Update from Source takes the mesh as it is: from there its splats follow."""
    splats, mesh = bound
    bpy.context.scene.frame_set(11)
    scenes.select(splats)
    with bpy.context.temp_override(object=splats):
        assert bpy.ops.stipple.update_from_source() == {'FINISHED'}
    np.testing.assert_allclose(positions(stipple, splats)[:, 2], 1.0, atol=1e-5)
    bpy.context.scene.frame_set(1)
    np.testing.assert_allclose(positions(stipple, splats)[:, 2], 0.0, atol=1e-5)


def test_a_budget_is_added_to_the_source_at_rest(stipple, tmp_path):
    """Not to what the mesh has made of it."""
    splats, mesh = scan(stipple, tmp_path), cage()
    rest = positions(stipple, splats)
    scenes.select(mesh, splats)
    assert bpy.ops.stipple.bind_to_mesh(reach='AROUND') == {'FINISHED'}
    bpy.context.scene.frame_set(11)
    scenes.select(splats)
    assert bpy.ops.stipple.add_budget() == {'FINISHED'}
    order = np.lexsort(positions(stipple, splats).round(4).T)
    wanted = rest + np.float32([0, 0, 1])
    np.testing.assert_allclose(positions(stipple, splats)[order], wanted[np.lexsort(wanted.round(4).T)], atol=2e-4)
    bpy.context.scene.frame_set(1)
    assert abs(positions(stipple, splats)[:, 2].mean() - rest[:, 2].mean()) < 1e-4


def test_hand_edits_become_the_rest(stipple, bound):
    """Use as New Source keeps the splats that are shown, and they follow from there."""
    splats, _ = bound
    bpy.context.scene.frame_set(11)
    data = splats.data
    arrays = splats_of(stipple, splats)
    arrays.positions[:, 0] += 0.25
    stipple.scene.source.splat_data.write(data, arrays)
    scenes.select(splats)
    with bpy.context.temp_override(object=splats):
        assert bpy.ops.stipple.use_as_new_source() == {'FINISHED'}
    np.testing.assert_allclose(positions(stipple, splats), arrays.positions, atol=1e-6)
    bpy.context.scene.frame_set(1)
    np.testing.assert_allclose(positions(stipple, splats), arrays.positions - np.float32([0, 0, 1]), atol=2e-6)


def test_merged_splats_follow_no_mesh_and_keep_their_shape(stipple, bound):
    splats, _ = bound
    other = scenes.make_splats(scenes.quad('Other'), anchors=100)
    bpy.context.scene.frame_set(11)
    scenes.select(splats, other)
    assert bpy.ops.stipple.merge_splats() == {'FINISHED'}
    assert splats.data.stipple.bind_object is None and len(splats.constraints) == 0
    before = positions(stipple, splats)
    bpy.context.scene.frame_set(1)
    np.testing.assert_array_equal(positions(stipple, splats), before)


def test_a_mesh_in_edit_mode_is_followed(stipple, bound):
    """While somebody moves its vertices."""
    splats, mesh = bound
    mesh.hide_set(False)
    scenes.select(mesh)
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.select_all(action='SELECT')
    bpy.ops.transform.translate(value=(0, 0, 0.75))
    bpy.context.view_layer.update()
    bpy.ops.object.mode_set(mode='OBJECT')
    bpy.context.view_layer.update()
    assert stipple.scene.source.sync.problems == {}
    bpy.context.scene.frame_set(2)
    bpy.context.scene.frame_set(1)
    np.testing.assert_allclose(positions(stipple, splats)[:, 2], 0.75, atol=1e-5)


# ---- what goes wrong ----------------------------------------------------------------------------

def problem_of(stipple, obj):
    return stipple.scene.source.sync.problems.get(obj.data.name, '')


def test_another_number_of_faces_is_said_and_nothing_is_lost(stipple, bound):
    splats, mesh = bound
    bpy.context.scene.frame_set(11)
    before = positions(stipple, splats)
    modifier = mesh.modifiers.new('Subdivision', 'SUBSURF')
    bpy.context.scene.frame_set(6)
    assert '9 vertices now, 4 then' in problem_of(stipple, splats)
    np.testing.assert_array_equal(positions(stipple, splats), before)
    mesh.modifiers.remove(modifier)
    bpy.context.scene.frame_set(11)
    assert problem_of(stipple, splats) == ''


def test_more_subdivision_in_renders_is_followed(stipple, tmp_path):
    """A Subdivision Surface modifier has two levels in renders and one in the viewport from the start."""
    mesh = animated_square()
    modifier = mesh.modifiers.new('Subdivision', 'SUBSURF')
    assert modifier.levels != modifier.render_levels
    splats = scenes.make_splats(mesh, anchors=COUNT)
    assert bpy.ops.stipple.bind_to_mesh() == {'FINISHED'}
    assert (modifier.levels, modifier.render_levels) == (1, 2)
    bpy.context.scene.frame_set(11)
    np.testing.assert_allclose(positions(stipple, splats)[:, 2], 1.0, atol=1e-5)
    assert picture_height(tmp_path) == pytest.approx(1.0, abs=0.05)


def test_renders_of_other_faces_end_with_a_message(stipple, bound, tmp_path):
    splats, mesh = bound
    modifier = mesh.modifiers.new('Subdivision', 'SUBSURF')
    modifier.levels, modifier.render_levels = 0, 2
    bpy.context.view_layer.update()
    bpy.context.scene.render.engine = 'STIPPLE'
    scenes.camera()
    scenes.refuses(lambda: bpy.ops.render.render(), 'must make the same faces')


def test_a_mesh_that_is_deleted_is_said(stipple, bound):
    splats, mesh = bound
    before = positions(stipple, splats)
    mesh.hide_set(False)
    scenes.select(mesh)
    bpy.ops.object.delete()
    bpy.context.scene.frame_set(11)
    assert 'is gone; choose Unbind' in problem_of(stipple, splats)
    np.testing.assert_array_equal(positions(stipple, splats), before)
    scenes.select(splats)
    assert bpy.ops.stipple.unbind() == {'FINISHED'}
    bpy.context.scene.frame_set(6)
    assert problem_of(stipple, splats) == ''


@pytest.mark.parametrize('spoil, words', [
    ('none', 'No meshes are selected'), ('two', '2 meshes are selected'), ('empty', 'has no faces'),
    ('twice', 'bound to a mesh already'), ('flat', 'scaled to zero'), ('child', 'is a child of')])
def test_what_cannot_be_bound_is_refused(stipple, tmp_path, spoil, words):
    splats = scan(stipple, tmp_path)
    meshes = [scenes.quad(f'Quad{i}') for i in range({'none': 0, 'two': 2}.get(spoil, 1))]
    if spoil == 'empty':
        meshes = [scenes.mesh_object('Points', [(0, 0, 0), (1, 0, 0)], [])]
    if spoil == 'flat':
        meshes[0].scale = (0, 1, 1)
    if spoil == 'child':
        meshes[0].parent = splats
    scenes.select(splats, *meshes)
    if spoil == 'twice':
        assert bpy.ops.stipple.bind_to_mesh() == {'FINISHED'}
    before = positions(stipple, splats)
    scenes.refuses(bpy.ops.stipple.bind_to_mesh, words)
    np.testing.assert_array_equal(positions(stipple, splats), before)
    assert (splats.data.stipple.bind_object is not None) == (spoil == 'twice')


def test_a_series_is_refused(stipple, tmp_path):
    splats = series.load(series.write(stipple, tmp_path / 'swarm', range(1, 4)))
    scenes.select(splats, scenes.quad())
    scenes.refuses(bpy.ops.stipple.bind_to_mesh, 'is a series of files')


# ---- motion blur --------------------------------------------------------------------------------

def test_deformation_is_blurred(stipple, tmp_path):
    """A square that rises by 2 m in the ten frames: over a shutter of two frames its splats are spread as far as it
    moves, and half as much light is anywhere as where it would stand still."""
    mesh = scenes.quad()
    scenes.material('White', (1.0, 1.0, 1.0), mesh)
    animate_up(mesh, 2.0)
    splats = scenes.make_splats(mesh, anchors=COUNT)
    assert bpy.ops.stipple.bind_to_mesh() == {'FINISHED'}
    scene = bpy.context.scene
    scene.frame_set(6)
    scene.render.use_motion_blur = False
    heights = side_heights(tmp_path, 'sharp')
    assert heights.std() < 0.06
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 2.0
    scene.stipple.blur_samples = 64
    blurred = side_heights(tmp_path, 'blurred')
    # Frames 5 to 7: what the shape key says there.
    low, high = (np.float64(mesh_height(mesh, frame)) for frame in (5, 7))
    assert high - low > 0.5
    assert blurred.mean() == pytest.approx(heights.mean(), abs=0.03)
    # Evenly spread light has a deviation of a twelfth of its square.
    assert blurred.std() == pytest.approx((high - low) / np.sqrt(12), rel=0.15)
    scene.frame_set(6)
    if hasattr(splats, 'cycles') and hasattr(splats.cycles, 'use_deform_motion'):
        splats.cycles.use_deform_motion = False
        assert side_heights(tmp_path, 'off').std() < 0.06


def mesh_height(mesh, frame):
    bpy.context.scene.frame_set(frame)
    evaluated = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get())
    height = evaluated.data.vertices[0].co.z
    bpy.context.scene.frame_set(6)
    return height


class side_heights:
    """Mean and deviation of the heights at which a side view has light."""

    def __init__(self, tmp_path, name):
        scene = bpy.context.scene
        scene.render.engine, scene.render.film_transparent = 'STIPPLE', True
        scenes.camera((0, -6, 1), (np.pi / 2, 0, 0), width=64, height=64, type='ORTHO', ortho_scale=4.0)
        opacity = scenes.render_pixels(tmp_path, name)[..., 3].sum(axis=1)
        self._heights = (np.arange(64) + 0.5 - 32) / 64 * 4 + 1
        self._shares = opacity / opacity.sum()

    def mean(self):
        return self._shares @ self._heights

    def std(self):
        return np.sqrt(self._shares @ np.square(self._heights - self.mean()))


def test_a_file_brings_the_mesh_at_rest(stipple, tmp_path):
    """Bound in any frame, the splats follow from the shape that their file says they fit."""
    from stipple.binding.structs import BindingReach
    from stipple.binding.surface_binding import bind_asset
    mesh = animated_square()
    splats = scenes.make_splats(mesh, anchors=COUNT)
    source = stipple.scene.source.source_paths.file_of(splats.data)
    before = positions(stipple, splats)
    vertices, triangles = np.empty(12, np.float32), np.empty(6, np.int32)
    mesh.data.vertices.foreach_get('co', vertices)
    mesh.data.calc_loop_triangles()
    mesh.data.loop_triangles.foreach_get('vertices', triangles)
    native = stipple.scene.source.sources.context()
    brought = tmp_path / 'brought.stipple.safetensors'
    bind_asset(native, source, vertices.reshape(-1, 3), triangles.reshape(-1, 3), BindingReach.AROUND, brought)
    assert bpy.ops.stipple.splats_import(filepath=str(brought), up_axis='Z') == {'FINISHED'}
    found = bpy.context.object
    bpy.context.scene.frame_set(11)
    mesh.hide_set(False)
    mesh.select_set(True)
    bpy.context.view_layer.objects.active = mesh
    splats.select_set(False)
    assert bpy.ops.stipple.bind_to_mesh() == {'FINISHED'}
    assert found.data.stipple.bind_reach == 'AROUND'
    rest = positions(stipple, found)
    bpy.context.scene.frame_set(1)
    # Lifted by 1 m at frame 11, where it was bound; at frame 1 where the file's own shape has it.
    np.testing.assert_allclose(rest[:, 2].mean() - positions(stipple, found)[:, 2].mean(), 1, atol=1e-5)
    np.testing.assert_allclose(np.sort(positions(stipple, found)[:, 2]).mean(), np.sort(before[:, 2]).mean(), atol=1e-4)
