# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats with meshes: Cycles + Stipple, and meshes as mattes under Stipple."""

from pathlib import Path

import bpy
import numpy as np
import pytest

import scenes
import screen
from shots import EMPTY, MESH, SPLAT, camera, emission, mesh_between, prepare, set_world, splat_wall  # noqa: F401

HERE = Path(__file__).resolve().parent

# ---- Cycles + Stipple ---------------------------------------------------------------------------

def test_splats_before_and_behind_a_mesh(stipple, camera, tmp_path, depths):
    mesh_between(stipple)
    prepare('STIPPLE_CYCLES')
    picture = scenes.render_pixels(tmp_path)
    # Pixels of 1/20 metre: the quad covers 20..40, the front splats 10..30 in x.
    np.testing.assert_allclose(picture[30, 35], (*MESH, 1.0), atol=1e-5)  # no splat in front: Cycles' own
    np.testing.assert_allclose(picture[30, 25, :3], (0.1, 0.1, 0.7), atol=0.03)
    np.testing.assert_allclose(picture[30, 45, :3], SPLAT, atol=0.03)
    assert picture[30, 45, 3] > 0.98 and picture[30, 25, 3] == 1.0 and picture[3, 3, 3] == 0.0
    assert abs(depths[-1][30, 35] - 6.0) < 1e-4 and abs(depths[-1][30, 45] - 7.0) < 0.01
    assert abs(depths[-1][30, 25] - 5.0) < 0.05 and depths[-1][3, 3] == EMPTY


@pytest.mark.parametrize('transparent', [True, False])
def test_without_splats_in_view_the_picture_is_cycles_own(stipple, camera, tmp_path, transparent):
    splat_wall(stipple, 'far away', 0.0).location.x = 50.0
    ball = scenes.sphere(radius=0.8)
    ball.rotation_euler.x = 0.3
    set_world()
    scene = prepare('CYCLES', transparent, samples=8)
    expected = scenes.render_pixels(tmp_path, 'cycles')
    scene.render.engine = 'STIPPLE_CYCLES'
    seen = scenes.render_pixels(tmp_path, 'both')
    if transparent:
        np.testing.assert_array_equal(seen, expected)
    else:
        # The world's light comes apart and is added again: rounding of one sum.
        np.testing.assert_allclose(seen, expected, atol=2e-6)
    assert scene.render.film_transparent == transparent


def test_the_world_is_behind_splats(stipple, camera, tmp_path):
    splat_wall(stipple, 'half', 0.0, opacity=0.2, count=20)
    set_world()
    scene = prepare('STIPPLE_CYCLES', True)
    scene.stipple.splat_color = 'SCENE_LINEAR'
    alone = scenes.render_pixels(tmp_path, 'alone')
    scene.render.film_transparent = False
    over = scenes.render_pixels(tmp_path, 'over')
    expected = alone[..., :3] + (1 - alone[..., 3:]) * np.float32((0.2, 0.4, 0.8))
    assert 0.3 < alone[30, 30, 3] < 0.98
    np.testing.assert_allclose(over[..., :3], expected, atol=1e-5)
    assert (over[..., 3] == 1).all()


def test_both_engines_draw_splats_alike(stipple, camera, tmp_path):
    splat_wall(stipple, 'half', 0.0, opacity=0.3, count=25)
    scene = prepare('STIPPLE')
    for blending in ('AS_TRAINED', 'SCENE_LINEAR'):
        scene.stipple.splat_color = blending
        scene.render.engine = 'STIPPLE'
        expected = scenes.render_pixels(tmp_path, 'stipple')
        scene.render.engine = 'STIPPLE_CYCLES'
        np.testing.assert_allclose(scenes.render_pixels(tmp_path, 'both'), expected, atol=2e-6)


def test_splats_are_no_points_to_cycles(stipple, camera, tmp_path):
    """Splats that other modifiers turn into points, also as an instance, and a mirror that would show them."""
    wall = splat_wall(stipple, 'wall', 0.0, count=10, opacity=0.003)  # too faint to show as splats
    add_points(wall)
    kept = bpy.data.collections.new('kept')
    kept.objects.link(wall)
    empty = scenes.link(bpy.data.objects.new('empty', None))
    empty.instance_type, empty.instance_collection = 'COLLECTION', kept
    empty.location.x = 0.3
    set_world()
    scene = prepare('CYCLES')
    with_points = scenes.render_pixels(tmp_path, 'points')
    assert with_points[..., 3].max() > 0.5
    scene.render.engine = 'STIPPLE_CYCLES'
    assert scenes.render_pixels(tmp_path, 'both')[..., 3].max() == 0
    # And Cycles sees them again afterwards.
    scene.render.engine = 'CYCLES'
    np.testing.assert_array_equal(scenes.render_pixels(tmp_path, 'again'), with_points)


def add_points(obj):
    tree = bpy.data.node_groups.new('points', 'GeometryNodeTree')
    if bpy.app.version >= (4, 0, 0):
        for side in ('INPUT', 'OUTPUT'):
            tree.interface.new_socket('Geometry', in_out=side, socket_type='NodeSocketGeometry')
    else:
        tree.inputs.new('NodeSocketGeometry', 'Geometry')
        tree.outputs.new('NodeSocketGeometry', 'Geometry')
    source, target = tree.nodes.new('NodeGroupInput'), tree.nodes.new('NodeGroupOutput')
    if isinstance(obj.data, bpy.types.Mesh):
        points = tree.nodes.new('GeometryNodeMeshToPoints')
    else:
        points = tree.nodes.new('GeometryNodeSetPointRadius')
    points.inputs['Radius'].default_value = 0.1
    tree.links.new(source.outputs[0], points.inputs[0])
    tree.links.new(points.outputs[0], target.inputs[0])
    obj.modifiers.new('points', 'NODES').node_group = tree


def shadow_scene(stipple):
    """A ball over a floor of splats, and under the sun; the floor's place is held by a shadow catcher."""
    floor = splat_wall(stipple, 'floor', 0.0, side=4.0, colour=(0.5, 0.5, 0.5), count=80)
    catcher = scenes.quad('catcher', size=4.0)
    catcher.is_shadow_catcher = True
    ball = scenes.sphere(radius=0.4)
    ball.location = (0, 0, 1.0)
    sun = scenes.link(bpy.data.objects.new('sun', bpy.data.lights.new('sun', 'SUN')))
    sun.data.energy, sun.data.angle = 5.0, 0.0
    sun.rotation_euler = (0.0, 0.7, 0.0)  # shadows fall towards -x
    return floor, catcher, ball


def test_characters_cast_shadows_on_splats(stipple, camera, tmp_path):
    floor, catcher, ball = shadow_scene(stipple)
    camera.data.ortho_scale = 3.0
    scene = prepare('STIPPLE_CYCLES', samples=16)
    picture = scenes.render_pixels(tmp_path)
    shadow_x = 30 - round(np.tan(0.7) * 1.0 * 20)
    lit, dark = picture[10, 50], picture[30, shadow_x]
    assert np.all(picture[5:55, 5:55, 3] > 0.98)
    assert 0.47 < lit[:3].min() and lit[:3].max() < 0.6  # a little brighter than the floor: light from the ball
    assert dark[:3].max() < 0.1 * lit[:3].min()  # only the sun lights this scene
    bpy.context.view_layer.cycles.use_pass_shadow_catcher = True
    np.testing.assert_array_equal(scenes.render_pixels(tmp_path, 'with pass'), picture)
    # The catcher hides nothing and the mesh is there.
    ball.hide_render = True
    np.testing.assert_allclose(scenes.render_pixels(tmp_path, 'without')[30, shadow_x, :3], 0.5, atol=0.03)


def test_shadows_do_not_fall_on_splats_before_the_catcher(stipple, camera, tmp_path):
    """A pane of splats over the shadow, as bright as without the ball; half transparent, the floor's shadow shows."""
    floor, _, ball = shadow_scene(stipple)
    scene = prepare('STIPPLE_CYCLES', samples=16)
    shadow = np.s_[28:32, 11:15]
    without = scenes.render_pixels(tmp_path, 'without')
    dark = without[shadow][..., :3].mean()
    pane = splat_wall(stipple, 'pane', 1.5, side=0.8, colour=(0.6, 0.6, 0.6))
    pane.location.x = -0.85
    seen = scenes.render_pixels(tmp_path, 'pane')
    np.testing.assert_allclose(seen[shadow][..., :3], 0.6, atol=0.03)
    # Away from the pane, which ends at column 24, nothing changes: not the ball's edges before the catcher either.
    np.testing.assert_allclose(seen[:, 26:], without[:, 26:], atol=1e-5)
    scene.stipple.shadow_margin = 2.0  # farther than the pane: it counts as the floor
    assert scenes.render_pixels(tmp_path, 'margin')[shadow][..., :3].max() < 0.1
    scene.stipple.shadow_margin = 0.5
    bpy.data.objects.remove(pane)
    thin = splat_wall(stipple, 'thin', 1.5, side=0.8, colour=(0.6, 0.6, 0.6), count=10, opacity=0.2)
    thin.location.x = -0.85
    for blending in ('AS_TRAINED', 'SCENE_LINEAR'):
        scene.stipple.splat_color = blending
        half = scenes.render_pixels(tmp_path, 'half')[shadow][..., :3]
        ball.hide_render = True
        lit = scenes.render_pixels(tmp_path, 'lit')[shadow][..., :3]
        ball.hide_render = False
        assert dark + 0.05 < half.min() and half.mean() < lit.mean() - 0.02
    # As light it is the thin pane over the dark floor.
    floor.hide_render, scene.render.engine = True, 'STIPPLE'
    scene.stipple.meshes_as_mattes = False
    alone = scenes.render_pixels(tmp_path, 'alone')[shadow]
    assert 0.3 < alone[..., 3].min()
    np.testing.assert_allclose(half, alone[..., :3] + (1 - alone[..., 3:]) * dark, atol=0.02)


@pytest.mark.parametrize('transparent', [True, False])
def test_a_shadow_catcher_without_splats_is_cycles_own(stipple, camera, tmp_path, transparent):
    floor, _, _ = shadow_scene(stipple)
    floor.location.z = 50.0  # behind the camera
    set_world((0.2, 0.3, 0.4))
    scene = prepare('CYCLES', transparent, samples=16)
    expected = scenes.render_pixels(tmp_path, 'cycles')
    scene.render.engine = 'STIPPLE_CYCLES'
    seen = scenes.render_pixels(tmp_path, 'both')
    differs = np.abs(seen - expected).max(axis=2) > 2e-6
    if transparent:
        # From 5.0 on a few pixels at the ball's edge sum up otherwise when the pass of shadows is there.
        assert differs.mean() < 0.01 and np.abs(seen - expected).max() < 0.01
        assert bpy.app.version >= (5, 0, 0) or not differs.any()
        assert expected[..., 3].max() == 1.0 and 0 < np.median(expected[..., 3][expected[..., 3] > 0.01]) < 1
    else:
        # At the ball's edge Cycles counts what is behind twice over: its catcher is an approximation there.
        assert differs.mean() < 0.06 and not differs[:, :5].any()


def test_border_and_resolution_are_those_of_blender(stipple, camera, tmp_path):
    mesh_between(stipple)
    scene = prepare('STIPPLE_CYCLES')
    whole = scenes.render_pixels(tmp_path, 'whole')
    render = scene.render
    render.use_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.2, 0.7, 0.3, 0.55
    part = scenes.render_pixels(tmp_path, 'part')
    np.testing.assert_allclose(part[18:33, 12:42], whole[18:33, 12:42], atol=1e-6)
    assert np.abs(part[:18]).max() == 0 and np.abs(part[33:]).max() == 0 and np.abs(part[:, :12]).max() == 0
    render.use_crop_to_border = True
    np.testing.assert_allclose(scenes.render_pixels(tmp_path, 'crop'), whole[18:33, 12:42], atol=1e-6)
    render.use_border = False
    render.resolution_percentage = 50
    half = scenes.render_pixels(tmp_path, 'half')
    assert half.shape == (30, 30, 4)
    np.testing.assert_allclose(half[15, 17], (*MESH, 1.0), atol=1e-5)


def test_large_pictures_are_made_in_one_piece(stipple, camera, tmp_path):
    mesh_between(stipple)
    scene = prepare('STIPPLE_CYCLES')
    whole = scenes.render_pixels(tmp_path, 'whole')
    scene.cycles.use_auto_tile, scene.cycles.tile_size = True, 16
    np.testing.assert_array_equal(scenes.render_pixels(tmp_path, 'tiles'), whole)
    assert scene.cycles.use_auto_tile


def test_every_view_layer_has_its_own_picture(stipple, camera, tmp_path, monkeypatch):
    mesh_between(stipple)
    scene = prepare('STIPPLE_CYCLES')
    only = bpy.data.collections.new('only')
    scene.collection.children.link(only)
    front = bpy.data.objects['front']
    scene.collection.objects.unlink(front)
    only.objects.link(front)
    second = scene.view_layers.new('second')
    second.layer_collection.children['only'].exclude = True
    made = []
    insert = stipple.cycles_engine.classes[0]._insert_splats

    def note(self, passes, *others):
        insert(self, passes, *others)
        made.append(stipple.version.read_pass(passes['Combined'], 60, 60))

    monkeypatch.setattr(stipple.cycles_engine.classes[0], '_insert_splats', note)
    bpy.ops.render.render()
    with_front, without = made
    assert with_front[30, 25, 2] > 0.6
    np.testing.assert_allclose(without[30, 25], (*MESH, 1.0), atol=1e-5)


@pytest.mark.parametrize('is_kept', [False, True])
def test_an_animation_moves_meshes_and_splats(stipple, camera, tmp_path, is_kept):
    quad = mesh_between(stipple)
    bpy.context.scene.render.use_persistent_data = is_kept
    for frame, z in ((1, 0.0), (2, 2.0), (3, 0.0)):
        quad.location.z = z
        quad.keyframe_insert('location', frame=frame)
    scene = prepare('STIPPLE_CYCLES')
    scene.frame_start, scene.frame_end = 1, 3
    scene.render.image_settings.file_format = 'PNG'
    scene.view_settings.view_transform = 'Standard'
    scene.render.filepath = str(tmp_path / 'frame_')
    bpy.ops.render.render(animation=True)
    blue = []
    for frame in (1, 2, 3):
        image = bpy.data.images.load(str(tmp_path / f'frame_{frame:04d}.png'))
        blue.append(np.array(image.pixels[:]).reshape(60, 60, 4)[30, 25, 2])
    assert blue[0] > 0.75 and blue[2] > 0.75  # the front splats
    assert blue[1] < 0.4  # the mesh passes before them


def test_a_render_can_be_cancelled_between_cycles_and_splats(stipple, camera, tmp_path, monkeypatch):
    mesh_between(stipple)
    prepare('STIPPLE_CYCLES')
    before = scenes.render_pixels(tmp_path, 'before')
    engine = stipple.cycles_engine.classes[0]
    looks = []

    def cancelled(self):
        looks.append(True)
        return len(looks) > 1

    with monkeypatch.context() as patch:
        patch.setattr(engine, '_cancelled', cancelled, raising=False)
        bpy.context.scene.render.resolution_percentage = 1000
        bpy.ops.render.render()
    assert looks
    bpy.context.scene.render.resolution_percentage = 100
    np.testing.assert_array_equal(scenes.render_pixels(tmp_path, 'after'), before)


@pytest.mark.parametrize('engine', ['STIPPLE', 'STIPPLE_CYCLES'])
def test_stereo_pictures_are_one_error(stipple, camera, tmp_path, engine):
    mesh_between(stipple)
    scene = prepare(engine)
    scene.render.use_multiview = True
    scenes.refuses(lambda: scenes.render_pixels(tmp_path), 'Stereoscopy is on with 2 views')
    scene.render.use_multiview = False
    assert scenes.render_pixels(tmp_path, 'one')[30, 45, 3] > 0.98


@pytest.mark.parametrize('engine', ['STIPPLE', 'STIPPLE_CYCLES'])
def test_the_status_says_how_far_and_how_much(stipple, camera, tmp_path, monkeypatch, engine):
    """Splats, memory and the stage of the work, while the picture is made."""
    mesh_between(stipple)
    prepare(engine)
    said = []
    found = stipple.engine.NativeWork
    say = found._say

    def note(self, fraction, stage):
        said.append((fraction, self._stats, stage))
        say(self, fraction, stage)

    monkeypatch.setattr(found, '_say', note)
    monkeypatch.setattr(stipple.engine, 'POLL_SECONDS', 0.0)
    bpy.context.scene.render.resolution_percentage = 800
    bpy.ops.render.render()
    assert said and all(0.0 <= fraction <= 1.0 for fraction, _, _ in said)
    stats, stage = said[-1][1:]
    # 480 x 480 pixels of colour and depth alone are 4.4 MiB.
    assert stage and stats.startswith('7,200 splats, at most ') and 4 < int(stats.split()[-2]) < 100, stats


@pytest.mark.parametrize('engine', ['STIPPLE', 'STIPPLE_CYCLES'])
def test_a_window_and_the_background_give_the_same_bits(stipple, tmp_path, engine):
    mesh_between(stipple)
    scenes.camera((0.4, 0.2, 6), width=60, height=60, lens=60.0)
    prepare(engine)
    expected = scenes.render_pixels(tmp_path, 'background')
    blend = tmp_path / 'scene.blend'
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    folder = tmp_path / 'window'
    folder.mkdir()
    screen.run_steps(HERE / 'render_steps.py', folder, bpy.app.binary_path, options=(str(blend),))
    np.testing.assert_array_equal(np.load(folder / 'picture.npy'), expected)


def test_cycles_itself_renders_on(stipple, camera, tmp_path):
    """Blender forgets a render engine that another is derived from."""
    emission(scenes.quad(size=1.0))
    prepare('CYCLES')
    np.testing.assert_allclose(scenes.render_pixels(tmp_path)[30, 30], (*MESH, 1.0), atol=1e-5)


def test_cycles_panels_are_there(stipple):
    panels = {panel.__name__: panel for panel in stipple.panels.render._panels()}
    for name in ('CYCLES_RENDER_PT_sampling', 'CYCLES_OBJECT_PT_visibility', 'CYCLES_WORLD_PT_settings',
                 'RENDER_PT_color_management', 'CYCLES_RENDER_PT_light_paths', 'CYCLES_LIGHT_PT_light'):
        assert 'STIPPLE_CYCLES' in panels[name].COMPAT_ENGINES, name
    assert 'STIPPLE' not in panels['CYCLES_RENDER_PT_sampling'].COMPAT_ENGINES
    missing = [name for name, panel in panels.items()
               if ('CYCLES' in panel.COMPAT_ENGINES) != ('STIPPLE_CYCLES' in panel.COMPAT_ENGINES)]
    assert missing == []


def edge_scene(stipple, with_backdrop):
    """A ball between a wall of splats and another, of half the size, before it; perhaps a mesh behind all."""
    splat_wall(stipple, 'behind', -1.0, side=3.4, count=40)
    front = splat_wall(stipple, 'front', 1.0, side=1.7, colour=(0.1, 0.1, 0.7), count=20)
    front.location.x = -0.85
    ball = scenes.sphere(segments=64, rings=32, radius=0.8)
    for polygon in ball.data.polygons:
        polygon.use_smooth = True
    emission(ball)
    if with_backdrop:
        backdrop = scenes.quad('backdrop', size=4.0, offset=(0, 0, -2))
        emission(backdrop, (0.9, 0.9, 0.9))


def errors_at_edges(tmp_path, engine, names):
    """Against pictures of 4 x 4 times the pixels: PSNR in dB, mean and largest error where those differ, how many."""
    scene = prepare(engine, samples=16)
    seen = scenes.render_pixels(tmp_path, names + 'seen')
    scene.render.resolution_percentage = 400
    fine = scenes.render_pixels(tmp_path, names + 'fine')
    height, width = seen.shape[:2]
    blocks = fine.reshape(height, 4, width, 4, 4)
    error = np.abs(seen - blocks.mean(axis=(1, 3))).max(axis=2)
    edges = np.ptp(blocks, axis=(1, 3)).max(axis=2) > 0.2
    scene.render.resolution_percentage = 100
    psnr = -10 * np.log10(np.mean((seen - blocks.mean(axis=(1, 3))) ** 2))
    return psnr, error[edges].mean(), error[edges].max(), edges.mean()


@pytest.mark.parametrize('engine, with_backdrop, floor_db, worst', [
    ('STIPPLE_CYCLES', False, 40.0, 0.2), ('STIPPLE_CYCLES', True, 25.0, 1.0), ('STIPPLE', False, 40.0, 0.2)])
def test_edges_are_as_smooth_as_one_depth_per_pixel_allows(stipple, camera, tmp_path, engine, with_backdrop, floor_db,
                                                           worst):
    """A mesh's edge before splats is as smooth as its alpha. Where splats are between two meshes, one depth stands for
    both, and the error is up to their difference."""
    edge_scene(stipple, with_backdrop)
    psnr, mean, largest, share = errors_at_edges(tmp_path, engine, '')
    print(f'{engine}, backdrop {with_backdrop}: {psnr:.1f} dB; at edges ({share:.1%} of all) {mean:.3f} in the mean, '
          f'{largest:.2f} at most')
    assert psnr > floor_db and largest < worst


# ---- meshes as mattes ---------------------------------------------------------------------------

def test_meshes_hide_the_splats_behind_them(stipple, camera, tmp_path, depths):
    mesh_between(stipple)
    prepare('STIPPLE')
    bpy.context.view_layer.use_pass_z = True
    picture = scenes.render_pixels(tmp_path)
    np.testing.assert_array_equal(picture[21:39, 33:39], 0.0)  # the quad, without splats before it
    assert picture[30, 25, 3] > 0.98 and picture[30, 45, 3] > 0.98
    assert depths[-1][30, 35] == EMPTY and abs(depths[-1][30, 25] - 5.0) < 0.05
    bpy.context.scene.stipple.meshes_as_mattes = False
    assert scenes.render_pixels(tmp_path, 'off')[30, 35, 3] > 0.98


def test_mattes_are_instances_curves_and_modified_meshes(stipple, camera, tmp_path):
    splat_wall(stipple, 'behind', -1.0, side=3.0)
    prepare('STIPPLE')
    quad = scenes.quad(size=0.25)
    array = quad.modifiers.new('array', 'ARRAY')
    array.use_relative_offset, array.use_constant_offset = False, True
    array.constant_offset_displace = (1.0, 0.0, 0.0)
    kept = bpy.data.collections.new('kept')
    bpy.context.scene.collection.objects.unlink(quad)
    kept.objects.link(quad)
    for y in (-0.5, 0.5):
        empty = scenes.link(bpy.data.objects.new('empty', None))
        empty.instance_type, empty.instance_collection, empty.location.y = 'COLLECTION', kept, y
    curve = bpy.data.curves.new('disc', 'CURVE')
    curve.dimensions, curve.fill_mode = '2D', 'BOTH'
    spline = curve.splines.new('POLY')
    spline.points.add(3)
    for point, (x, y) in zip(spline.points, ((-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1))):
        point.co = (x - 0.5, y, 0.0, 1.0)
    spline.use_cyclic_u = True
    scenes.link(bpy.data.objects.new('disc', curve))
    alpha = scenes.render_pixels(tmp_path)[..., 3]
    for x, y in ((30, 20), (50, 20), (30, 40), (50, 40), (20, 30)):
        assert alpha[y, x] == 0, (x, y)
    for x, y in ((40, 20), (30, 30), (20, 45)):
        assert alpha[y, x] > 0.98, (x, y)


@pytest.mark.parametrize('hide', ['hide_render', 'visible_camera', 'is_shadow_catcher', 'scale'])
def test_what_does_not_show_is_no_matte(stipple, camera, tmp_path, hide):
    quad = mesh_between(stipple)
    if hide == 'scale':
        quad.scale.x = 0.0
    else:
        setattr(quad, hide, hide != 'visible_camera')
    prepare('STIPPLE')
    assert scenes.render_pixels(tmp_path)[30, 35, 3] > 0.98


def combined_of(stipple, engine, layer_name):
    layer = next(layer for layer in engine.get_result().layers if layer.name == layer_name)
    return stipple.version.read_pass(next(p for p in layer.passes if p.name == 'Combined'), 60, 60)


def test_every_view_layer_of_stipple_has_its_own_picture(stipple, camera, tmp_path, monkeypatch):
    """One layer without the splats in front; each picture goes to its layer."""
    mesh_between(stipple)
    scene = prepare('STIPPLE')
    only = bpy.data.collections.new('only')
    scene.collection.children.link(only)
    front = bpy.data.objects['front']
    scene.collection.objects.unlink(front)
    only.objects.link(front)
    scene.view_layers.new('second').layer_collection.children['only'].exclude = True
    made, deliver = {}, stipple.engine.STIPPLE_RE_engine._deliver

    def note(self, task, picture, layer_name):
        deliver(self, task, picture, layer_name)
        made[layer_name] = combined_of(stipple, self, layer_name)

    monkeypatch.setattr(stipple.engine.STIPPLE_RE_engine, '_deliver', note)
    bpy.ops.render.render()
    assert made['ViewLayer'][30, 25, 3] > 0.98 and made['second'][30, 25, 3] == 0.0


def test_what_splats_were_made_from_does_not_hide_them(camera, tmp_path):
    quad = scenes.quad()
    scenes.material('red', (0.8, 0.1, 0.05), quad)
    scenes.make_splats(quad, anchors=20000, hide_source=False)
    prepare('STIPPLE')
    assert scenes.render_pixels(tmp_path)[30, 30, 3] > 0.98


def test_a_scene_without_meshes_draws_no_depth(stipple, camera, tmp_path, monkeypatch):
    splat_wall(stipple, 'wall', 0.0)
    prepare('STIPPLE')

    def refuse(*_):
        raise AssertionError('depth was drawn')

    monkeypatch.setattr(stipple.scene.view.mattes, 'surface', refuse)
    assert scenes.render_pixels(tmp_path)[30, 30, 3] > 0.98


def test_each_mesh_is_read_once(stipple, camera, tmp_path, monkeypatch):
    splat_wall(stipple, 'behind', -1.0)
    quad = scenes.quad(size=0.2)
    for i in range(20):
        copy = scenes.link(bpy.data.objects.new('copy', quad.data))
        copy.location.x = -1 + 0.1 * i
    read, reader = [], stipple.scene.view.mattes.read
    monkeypatch.setattr(stipple.scene.view.mattes, 'read', lambda obj: read.append(obj.name) or reader(obj))
    prepare('STIPPLE')
    scenes.render_pixels(tmp_path)
    assert len(read) == 1


def test_a_mesh_with_numbers_that_are_none_is_one_error(stipple, camera, tmp_path):
    quad = mesh_between(stipple)
    quad.data.vertices[0].co.x = float('nan')
    prepare('STIPPLE')
    scenes.refuses(lambda: scenes.render_pixels(tmp_path), f"Object '{quad.name}'")
