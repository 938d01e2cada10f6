# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects become images, cameras and coloured points for training: what is written, what is left out, and that nothing
else changes."""

import importlib
import json
import math
import os
import shutil
import subprocess
from pathlib import Path

import bpy
import numpy as np
import pytest

import scenes
from test_view_capture import settings_of

SCRIPT = Path(__file__).resolve().parents[2] / 'addon' / 'collect_for_training.py'
SMALL = {'view_count': 16, 'image_size': 48, 'samples': 2, 'points': 600}
RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
POINT = np.dtype([('place', '<f4', 3), ('normal', '<f4', 3), ('colour', 'u1', 3)])


def module(stipple, name):
    return importlib.import_module(f'.scene.training.{name}', stipple.__name__)


def glowing(name, colour, strength=1.0):
    made = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        made.use_nodes = True
    made.node_tree.nodes.clear()
    shader, output = (made.node_tree.nodes.new(kind) for kind in ('ShaderNodeEmission', 'ShaderNodeOutputMaterial'))
    shader.inputs['Color'].default_value, shader.inputs['Strength'].default_value = (*colour, 1.0), strength
    made.node_tree.links.new(shader.outputs[0], output.inputs['Surface'])
    return made


BOX = [(x, y, z) for x in (-1, 0, 1) for y in (-1, 1) for z in (-1, 1)]
BOX_FACES = [(0, 1, 3, 2), *[(a + i, b + i, d + i, c + i) for i in (0, 4) for a, b, c, d in
                             ((0, 4, 1, 5), (2, 3, 6, 7), (0, 2, 4, 6), (1, 5, 3, 7))], (8, 10, 11, 9)]


def box(name='Box'):
    """A cube, left half red, right half blue, somewhere in the scene and of some size."""
    obj = scenes.mesh_object(name, BOX, BOX_FACES)
    obj.data.materials.append(glowing('Left', RED))
    obj.data.materials.append(glowing('Right', BLUE))
    for polygon in obj.data.polygons:
        polygon.material_index = int(polygon.center.x > 0)
    obj.location, obj.scale = (3, -2, 5), (4, 4, 4)
    bpy.context.view_layer.update()
    return obj


def collection_of(*objects, name='Objects'):
    made = bpy.data.collections.new(name)
    bpy.context.scene.collection.children.link(made)
    for obj in objects:
        made.objects.link(obj)
    return made


def collect(out, *objects, **settings):
    made = collection_of(*objects)
    result = bpy.ops.stipple.collect_for_training(directory=str(out), source='COLLECTION', collection=made.name,
                                                  **{**SMALL, **settings})
    assert result == {'FINISHED'}


def collect_folder(assets, out, **settings):
    return bpy.ops.stipple.collect_for_training(directory=str(out), source='FOLDER', assets_folder=str(assets),
                                                **{**SMALL, **settings})


def points_of(folder):
    content = (folder / 'points.ply').read_bytes()
    header, _, rows = content.partition(b'end_header\n')
    names = [f'property float {name}' for name in ('x', 'y', 'z', 'nx', 'ny', 'nz')]
    names += [f'property uchar {name}' for name in ('red', 'green', 'blue')]
    count = len(rows) // POINT.itemsize
    assert header.decode().splitlines() == ['ply', 'format binary_little_endian 1.0', f'element vertex {count}', *names]
    return np.frombuffer(rows, POINT)


def near(colours, wanted):
    """Within the two digits that a pixel's filter takes from its neighbours; ten along edges."""
    off = np.abs(colours.astype(int) - wanted).max(1)
    return len(colours) > 20 and off.max() <= 10 and (off <= 2).mean() > 0.98


def transforms_of(folder):
    return json.loads((folder / 'transforms.json').read_text())


def files_of(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob('*') if path.is_file())


def write_box(folder, name='box', kind='obj', size=2.0):
    """A grey cube as text."""
    corners = '\n'.join(f'v {size * x} {size * y} {size * z}' for x in (0, 1) for y in (0, 1) for z in (0, 1))
    faces = '\n'.join('f ' + ' '.join(str(i + 1) for i in face) for face in
                      ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)))
    (folder / f'{name}.{kind}').write_text(f'{corners}\n{faces}\n')


def write_coloured_quad(folder):
    (folder / 'quad.ply').write_text('\n'.join([
        'ply', 'format ascii 1.0', 'element vertex 4', *(f'property float {axis}' for axis in 'xyz'),
        *(f'property uchar {colour}' for colour in ('red', 'green', 'blue')), 'element face 1',
        'property list uchar int vertex_indices', 'end_header', *(f'{x} {y} 0 0 128 0' for x, y in
                                                                  ((0, 0), (1, 0), (1, 1), (0, 1))), '4 0 1 2 3', '']))


def facts():
    """All of the open file that could change."""
    scene, layer = bpy.context.scene, bpy.context.view_layer
    owners = [scene, scene.render, scene.render.image_settings, scene.view_settings, scene.cycles, layer,
              *scene.objects]
    data = {prop.identifier: sorted((entry.name, entry.users) for entry in getattr(bpy.data, prop.identifier))
            for prop in bpy.data.bl_rna.properties if prop.type == 'COLLECTION'}
    return ([settings_of(owner) for owner in owners], data, scene.camera, layer.objects.active,
            [obj.name for obj in layer.objects.selected], bpy.context.window and bpy.context.window.scene)


# ---- what is written ----------------------------------------------------------------------------

def test_points_of_a_box_lie_on_it_in_its_colours(tmp_path):
    collect(tmp_path, box(), points=3000)
    points = points_of(tmp_path / 'Box')
    place = points['place']
    assert len(points) == 3000
    np.testing.assert_allclose(np.abs(place).max(1), 0.5, atol=1e-6)
    # As many on each side as on another, and in each quarter of one.
    axis = np.abs(place).argmax(1)
    sides = np.array([((axis == a) & (place[:, a] * s > 0)).sum() for a in range(3) for s in (-1, 1)])
    assert np.abs(sides - 500).max() <= 5
    top = place[(axis == 2) & (place[:, 2] > 0)]
    assert np.abs(np.histogram2d(top[:, 0], top[:, 1], 2)[0] - 125).max() <= 12
    np.testing.assert_allclose(points['normal'], np.where(np.arange(3) == axis[:, None], np.sign(place), 0), atol=1e-6)
    # Pixels across the middle are of both colours.
    left, right = place[:, 0] < -0.2, place[:, 0] > 0.2
    assert near(points['colour'][left], (255, 0, 0)) and near(points['colour'][right], (0, 0, 255))


def test_cameras_are_on_a_sphere_and_show_the_points(stipple, tmp_path):
    collect(tmp_path, box(), view_count=7, image_size=48)
    folder = tmp_path / 'Box'
    content = transforms_of(folder)
    assert content['w'] == content['h'] == 48
    assert content['fl_x'] == pytest.approx(24 / math.tan(math.radians(20)))
    np.testing.assert_allclose(content['normalised']['centre'], (3, -2, 5))
    assert content['normalised']['size'] == pytest.approx(8)
    points = points_of(folder)
    for frame in content['frames']:
        pose = np.array(frame['transform_matrix'])
        np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(pose[:3, 3], 2 * pose[:3, 2], atol=1e-12)
        image = scenes.picture_pixels(folder / frame['file_path'])
        assert image.shape == (48, 48, 4)
        local = (points['place'] - pose[:3, 3]) @ pose[:3, :3]
        pixels = np.floor(local[:, :2] / -local[:, 2:] * content['fl_x'] + 24).astype(int)  # row 0 = bottom, as y
        faces_it = (points['normal'] * (pose[:3, 3] - points['place'])).sum(1) > 0.3
        x, y = pixels[faces_it & ((pixels >= 1) & (pixels < 47)).all(1)].T
        colour = points['colour'][faces_it & ((pixels >= 1) & (pixels < 47)).all(1)] / 255
        assert len(x) > 50
        # A convex body shows what faces the camera, but for pixels of an edge or of two colours.
        same = np.abs(image[y, x, :3] - colour).max(1) < 0.02
        assert (image[y, x, 3] > 0.99).mean() > 0.95 and same.mean() > 0.85
    # The same by the library's own reader of such folders.
    views_module = importlib.import_module('.binding.views', stipple.__name__)
    views = views_module.Views.open(stipple.scene.source.sources.context(), folder)
    places, colours = views.points()
    assert len(views) == 7
    np.testing.assert_array_equal(places, points['place'])
    display = np.where(colours <= 0.0031308, 12.92 * colours, 1.055 * np.maximum(colours, 1e-9) ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(255 * display, points['colour'], atol=0.01)
    rgba = views.read(3)[0]
    assert rgba.shape == (48, 48, 4) and 0.2 < rgba[..., 3].mean() < 0.95


def test_cameras_see_from_everywhere(stipple):
    sphere = module(stipple, 'sphere')
    backs = sphere.poses(64, 5)[:, :3, 2]
    # 64 even caps of a sphere have a radius of 0.25; no gap is wider than twice that and a bit.
    probes = np.random.default_rng(3).normal(size=(500, 3))
    probes /= np.linalg.norm(probes, axis=1, keepdims=True)
    assert np.arccos(np.clip((probes @ backs.T).max(1), -1, 1)).max() < 0.55
    assert np.abs(backs.mean(0)).max() < 0.05
    assert not np.allclose(backs, sphere.poses(64, 6)[:, :3, 2])
    assert np.isfinite(sphere.poses(1, 0)).all()


def test_a_white_body_has_the_same_light_from_everywhere(tmp_path):
    ball = scenes.sphere()
    ball.data.polygons.foreach_set('use_smooth', [True] * len(ball.data.polygons))
    white = glowing('White', RED)
    tree = white.node_tree
    diffuse = tree.nodes.new('ShaderNodeBsdfDiffuse')
    diffuse.inputs['Color'].default_value = (0.5, 0.5, 0.5, 1)
    tree.links.new(diffuse.outputs[0], next(n for n in tree.nodes if n.type == 'OUTPUT_MATERIAL').inputs['Surface'])
    ball.data.materials.append(white)
    bpy.ops.object.light_add(type='SUN')
    sun = bpy.context.object
    sun.data.energy = 50
    collect(tmp_path, ball, sun)
    colours = points_of(tmp_path / 'Sphere')['colour']
    # 0.5 of a white world, as display sRGB; less where flat faces hide the world from smooth normals.
    assert (np.abs(colours.astype(int) - 188) <= 1).mean() > 0.9 and colours.max() <= 189
    # Normals are those of the smooth surface.
    points = points_of(tmp_path / 'Sphere')
    outwards = points['place'] / np.linalg.norm(points['place'], axis=1, keepdims=True)
    assert (points['normal'] * outwards).sum(1).min() > 0.99


def test_faces_that_are_turned_inwards_are_turned_back(tmp_path):
    obj = box()
    obj.data.flip_normals()
    collect(tmp_path, obj)
    points = points_of(tmp_path / 'Box')
    assert ((points['normal'] * points['place']).sum(1) > 0.49).all()
    assert near(points['colour'][points['place'][:, 0] < -0.2], (255, 0, 0))


def test_what_no_camera_sees_takes_the_nearest_colour(tmp_path):
    inner = scenes.mesh_object('Inner', BOX, BOX_FACES)
    inner.scale = (0.5, 0.5, 0.5)
    inner.data.materials.append(glowing('Green', (0, 1, 0)))
    outer = box()
    outer.location, outer.scale = (0, 0, 0), (1, 1, 1)
    inner.parent = outer
    collect(tmp_path, outer, inner)
    assert os.listdir(tmp_path) == ['Box']
    points = points_of(tmp_path / 'Box')
    hidden = np.abs(points['place']).max(1) < 0.3
    assert 100 < hidden.sum() < 200  # a fifth of the area
    left = hidden & (points['place'][:, 0] < -0.249)
    assert left.sum() > 10 and (points['colour'][left, 0] > 200).mean() > 0.9


def test_modifiers_are_as_in_renders(tmp_path):
    obj = box()
    modifier = obj.modifiers.new('Round', 'SUBSURF')
    modifier.levels, modifier.render_levels = 0, 3
    collect(tmp_path, obj)
    distances = np.linalg.norm(points_of(tmp_path / 'Box')['place'], axis=1)
    assert distances.max() < 0.7 * math.sqrt(3) * 0.5 + 0.2 and (distances < 0.6).all()


def test_each_object_of_a_collection_with_its_children_is_an_asset(tmp_path):
    first, second, child, hidden, third, fourth = (box(name) for name in ('First', 'Second', 'Child', 'Hidden', 'Third',
                                                                         'Fourth'))
    pair = scenes.link(bpy.data.objects.new('Pair', None))
    third.parent = fourth.parent = pair
    child.parent, child.location = second, (3, 0, 0)
    child.scale = (0.5, 0.5, 0.5)
    hidden.hide_render = True
    collect(tmp_path, first, second, child, hidden, third, fourth, pair)
    assert sorted(os.listdir(tmp_path)) == ['First', 'Pair', 'Second']
    width = np.ptp(points_of(tmp_path / 'Second')['place'], axis=0)
    np.testing.assert_allclose(width, (1, 2 / 4.5, 2 / 4.5), atol=0.01)


# ---- files --------------------------------------------------------------------------------------

@pytest.fixture
def assets(tmp_path):
    """A folder of a few good and bad files."""
    folder = tmp_path / 'assets'
    (folder / 'more').mkdir(parents=True)
    write_box(folder)
    write_coloured_quad(folder / 'more')
    (folder / 'empty.obj').write_text('v 0 0 0\nv 1 1 1\n')
    (folder / 'broken.glb').write_bytes(b'xx')
    (folder / 'dot.obj').write_text('v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n')
    (folder / 'notes.txt').write_text('no mesh')
    return folder


def run_script(*arguments):
    command = [bpy.app.binary_path, '-b', '--factory-startup', '-P', str(SCRIPT), '--', *map(str, arguments)]
    result = subprocess.run(command, capture_output=True, text=True)
    # Blender says its name before, and newer ones warnings.
    lines = [line for line in result.stdout.splitlines() if line and 'Blender' not in line and ' | ' not in line]
    return result.returncode, lines, result.stderr


def test_the_script_says_a_line_for_each_asset_and_goes_on_where_it_was(assets, tmp_path):
    out = tmp_path / 'out'
    quick = ('--views', 2, '--size', 16, '--samples', 1, '--points', 50)
    code, lines, errors = run_script(assets, out, *quick)
    assert code == 0, errors
    assert [line.partition(':')[0] for line in lines] == ['box', 'broken', 'dot', 'empty', 'more_quad',
                                                          '5 of 5 assets']
    assert lines[0].startswith('box: done, 2 views, ') and lines[0].endswith(' s')
    assert lines[1].startswith('broken: left out: it cannot be read: ')
    assert lines[2:4] == ['dot: left out: it has no extent', 'empty: left out: it has no faces']
    assert lines[5] == f'5 of 5 assets: 2 collected, 3 left out, in {out}'
    assert files_of(out) == [f'{name}/{file}' for name in ('box', 'more_quad') for file in
                             ('images/0000.png', 'images/0001.png', 'points.ply', 'transforms.json')]
    before = {path: path.stat().st_mtime_ns for path in out.rglob('*.*')}
    code, lines, _ = run_script(assets, out, *quick, '--index', 0, '--of', 2)
    assert code == 0 and lines == ['box: already there, 2 views', 'dot: left out: it has no extent',
                                   'more_quad: already there, 2 views',
                                   f'3 of 5 assets: 0 collected, 2 already there, 1 left out, in {out}']
    assert {path: path.stat().st_mtime_ns for path in out.rglob('*.*')} == before
    code, lines, _ = run_script(assets, out, '--index', 1, '--of', 2)
    assert code == 1 and [line.partition(':')[0] for line in lines] == ['broken', 'empty', '2 of 5 assets']


def test_the_script_refuses_what_it_does_not_understand(tmp_path):
    code, _, errors = run_script(tmp_path, tmp_path, '--index', 2, '--of', 2)
    assert code == 2 and '--index is 2; allowed is 0 to 1' in errors


def test_colours_of_vertices_are_shown(assets, tmp_path):
    collect_folder(assets, tmp_path / 'out', view_count=2, points=50)
    colours = points_of(tmp_path / 'out' / 'more_quad')['colour'].astype(int)
    # Vertices are green at 128 of 255 in display sRGB, which a white world lights as they are.
    assert np.abs(colours - (0, 128, 0)).max() <= 2


@pytest.mark.parametrize('kind', ['blend', 'glb', 'stl'])
def test_files_of_other_formats(tmp_path, kind):
    obj = box()
    (tmp_path / 'in').mkdir()
    path = str(tmp_path / 'in' / f'a.{kind}')
    if kind == 'blend':
        hidden = scenes.sphere(radius=30)
        hidden.hide_render = True
        bpy.ops.object.light_add(type='SUN')
        bpy.context.scene.frame_set(7)
        bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    elif kind == 'glb':
        scenes.select(obj)
        bpy.ops.export_scene.gltf(filepath=path, use_selection=True)
    else:
        scenes.select(obj)
        (bpy.ops.wm.stl_export if bpy.app.version >= (4, 1, 0) else bpy.ops.export_mesh.stl)(filepath=path)
    before = facts()
    assert collect_folder(tmp_path / 'in', tmp_path / 'out') == {'FINISHED'}
    assert facts() == before
    points = points_of(tmp_path / 'out' / 'a')
    np.testing.assert_allclose(np.abs(points['place']).max(1), 0.5, atol=1e-5)
    left = points['colour'][points['place'][:, 0] < -0.2].astype(int)
    if kind == 'glb':  # its materials shine
        assert (np.abs(left - (255, 0, 0)) < 40).mean() > 0.95
    elif kind == 'blend':
        assert near(left, (255, 0, 0))


def test_names_are_told_apart(stipple, tmp_path):
    (tmp_path / 'a').mkdir()
    (tmp_path / 'out').mkdir()
    for path in ('chair.obj', 'chair.glb', 'a/b.obj', 'a_b.obj', 'Chair.stl', '.hidden.obj', 'out/points.ply'):
        (tmp_path / path).write_text('')
    found = module(stipple, 'assets').of_folder(str(tmp_path), left_out=str(tmp_path / 'out'))
    assert [asset.name for asset in found] == ['Chair_stl', 'a_b_obj', 'a_b_obj_2', 'chair_glb', 'chair_obj']
    chosen = module(stipple, 'collecting').chosen
    assert sorted(a.name for i in range(3) for a in chosen(found, i, 3)) == sorted(a.name for a in found)


# ---- what stays ---------------------------------------------------------------------------------

def task_of(stipple, obj, out, **settings):
    assets, collecting = module(stipple, 'assets'), module(stipple, 'collecting')
    given = dict(view_count=4, size=16, samples=1, point_count=50)
    return collecting.CollectTask([assets.ObjectAsset('Box', (obj,))], str(out),
                                  collecting.CollectSettings(**{**given, **settings}))


def test_a_cancelled_task_leaves_the_file_as_it_was_and_goes_on_later(stipple, tmp_path):
    obj = box()
    task_of(stipple, obj, tmp_path / 'whole').wait()
    before = facts()
    task = task_of(stipple, obj, tmp_path / 'parts')
    for _ in range(4):
        task.poll()
    folder = tmp_path / 'parts' / 'Box'
    assert facts() != before
    task.cancel()
    with pytest.raises(stipple.binding.errors.CancelledError):
        task.wait()
    assert facts() == before
    assert files_of(folder) == ['images/0000.png', 'images/0001.png', 'unfinished.json']
    # One image is cut off meanwhile.
    first, second = folder / 'images' / '0000.png', folder / 'images' / '0001.png'
    second.write_bytes(second.read_bytes()[:-20])
    written = first.stat().st_mtime_ns
    task_of(stipple, obj, tmp_path / 'parts').wait()
    assert first.stat().st_mtime_ns == written and facts() == before
    assert files_of(folder) == files_of(tmp_path / 'whole' / 'Box') and 'unfinished.json' not in files_of(folder)
    for name in files_of(folder):
        assert (folder / name).read_bytes() == (tmp_path / 'whole' / 'Box' / name).read_bytes(), name


def test_images_of_other_settings_are_not_kept(stipple, tmp_path):
    obj = box()
    task = task_of(stipple, obj, tmp_path)
    for _ in range(4):
        task.poll()
    task.close()
    assert len(os.listdir(tmp_path / 'Box' / 'images')) == 2
    task_of(stipple, obj, tmp_path, view_count=2, size=24).wait()
    assert transforms_of(tmp_path / 'Box')['w'] == 24
    assert scenes.picture_pixels(tmp_path / 'Box' / 'images' / '0000.png').shape == (24, 24, 4)


def test_a_folder_of_somebody_else_stays(stipple, tmp_path):
    (tmp_path / 'Box' / 'images').mkdir(parents=True)
    (tmp_path / 'Box' / 'images' / '0000.png').write_text('a photograph')
    task = task_of(stipple, box(), tmp_path)
    task.wait()
    assert [name for name, _ in task.result.left_out] == ['Box'] and 'has other files' in task.result.left_out[0][1]
    assert files_of(tmp_path) == ['Box/images/0000.png']
    assert (tmp_path / 'Box' / 'images' / '0000.png').read_text() == 'a photograph'


def test_the_open_file_stays_as_it_is(tmp_path):
    obj, other = box(), scenes.sphere('Other')
    camera = scenes.camera()
    bpy.ops.object.light_add(type='SUN')
    scenes.select(other)
    bpy.context.scene.render.filepath = '/tmp/mine.png'
    made = collection_of(obj)
    before = facts()
    bpy.ops.stipple.collect_for_training(directory=str(tmp_path), source='COLLECTION', collection=made.name, **SMALL)
    assert facts() == before and bpy.context.scene.camera == camera
    # Other objects are not in the images: the ball would be around the box.
    other.location, other.scale = obj.location, (8, 8, 8)
    shutil.rmtree(tmp_path / 'Box')
    bpy.ops.stipple.collect_for_training(directory=str(tmp_path), source='COLLECTION', collection=made.name, **SMALL)
    assert (points_of(tmp_path / 'Box')['colour'][:, 1] == 0).all()


def test_black_and_empty_objects_are_left_out(stipple, tmp_path, capfd):
    black, clear, empty, fine = (box(name) for name in ('Black', 'Clear', 'Empty', 'Fine'))
    for obj, shade in ((black, glowing('Black', (0, 0, 0), 0.0)), (clear, glowing('Clear', RED))):
        obj.data.materials.clear()
        obj.data.materials.append(shade)
        obj.data.polygons.foreach_set('material_index', [0] * len(obj.data.polygons))
    tree = clear.active_material.node_tree
    glass = tree.nodes.new('ShaderNodeBsdfTransparent')
    tree.links.new(glass.outputs[0], next(n for n in tree.nodes if n.type == 'OUTPUT_MATERIAL').inputs['Surface'])
    empty.data.clear_geometry()
    collect(tmp_path, black, clear, empty, fine)
    said = capfd.readouterr().out
    for line in ('Black: left out: its images are black', 'Clear: left out: its images are empty',
                 'Empty: left out: it has no faces', "'Black' is left out: its images are black"):
        assert line in said
    assert os.listdir(tmp_path) == ['Fine']


def test_an_object_that_fails_oddly_does_not_end_the_others(stipple, tmp_path, monkeypatch, capfd, caplog):
    surface, first, second = module(stipple, 'surface'), box('First'), box('Second')
    read, calls = surface.read, []

    def fails_first(scene):
        calls.append(scene)
        return read(scene) if len(calls) > 1 else 1 // 0

    monkeypatch.setattr(surface, 'read', fails_first)
    before = len(bpy.data.scenes)
    collect(tmp_path, first, second)
    said = capfd.readouterr().out
    assert 'First: left out: ZeroDivisionError: ' in said and 'fails_first' in caplog.text
    assert os.listdir(tmp_path) == ['Second'] and len(bpy.data.scenes) == before


def test_messages(stipple, tmp_path):
    operator = bpy.ops.stipple.collect_for_training
    out = str(tmp_path / 'out')
    scenes.refuses(lambda: operator(directory=''), 'No output folder is chosen')
    scenes.refuses(lambda: operator(directory='//out'), 'is relative to this file, which is not saved yet')
    scenes.refuses(lambda: operator(directory=out), 'No collection is chosen')
    scenes.refuses(lambda: operator(directory=out, collection='Nothing'), "There is no collection 'Nothing'")
    scenes.refuses(lambda: operator(directory=out, source='FOLDER'), 'No folder of assets is chosen')
    scenes.refuses(lambda: operator(directory=out, source='FOLDER', assets_folder=str(tmp_path)), 'has no meshes')
    scenes.refuses(lambda: operator(directory=out, source='FOLDER', assets_folder=out), 'is no folder')
    made = collection_of()
    scenes.refuses(lambda: operator(directory=out, collection=made.name), 'has nothing that can be rendered')
    empty = box('Empty')
    empty.data.clear_geometry()
    made.objects.link(empty)
    scenes.refuses(lambda: operator(directory=out, collection=made.name, **SMALL), 'Nothing could be collected; 1 left')
    (tmp_path / 'file').write_text('')
    scenes.refuses(lambda: operator(directory=str(tmp_path / 'file'), collection=made.name), 'cannot be made')
    ball = scenes.sphere()
    scenes.select(ball)
    bpy.ops.object.mode_set(mode='EDIT')
    assert not operator.poll()
    bpy.ops.object.mode_set(mode='OBJECT')
    assert operator.poll()
