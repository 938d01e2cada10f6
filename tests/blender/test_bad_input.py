# SPDX-License-Identifier: GPL-3.0-or-later
"""Bad input: one clear report, and a file in which nothing has changed."""

import os
import shutil

import bpy
import numpy as np
import pytest

import scenes

ALL = ('objects', 'meshes', 'pointclouds', 'materials', 'images', 'volumes')


@pytest.fixture
def unchanged():
    """Checks after the test that no datablock came, went or was hidden."""
    state = {}

    def note():
        state['now'] = snapshot()

    yield note
    assert snapshot() == state['now']


def snapshot():
    return ({name: sorted(d.name for d in getattr(bpy.data, name)) for name in ALL},
            {o.name: (o.hide_get(), o.hide_render, o.select_get()) for o in bpy.context.view_layer.objects})


def from_mesh(*objects, **settings):
    scenes.select(*objects)
    return lambda: bpy.ops.stipple.splats_from_mesh(**settings)


def test_nothing_selected(unchanged):
    unchanged()
    scenes.refuses(bpy.ops.stipple.splats_from_mesh, 'No mesh is selected')


def test_empty_mesh(unchanged):
    call = from_mesh(scenes.mesh_object('Empty', [], []))
    unchanged()
    scenes.refuses(call, "Object 'Empty' has no faces")


def test_object_without_faces(unchanged):
    call = from_mesh(scenes.mesh_object('Points', [(0, 0, 0), (1, 0, 0)], []))
    unchanged()
    scenes.refuses(call, "Object 'Points' has no faces")


def test_one_of_several_without_faces(unchanged):
    call = from_mesh(scenes.quad('Good'), scenes.mesh_object('Points', [(0, 0, 0), (1, 0, 0)], []))
    unchanged()
    scenes.refuses(call, "Object 'Points' has no faces")


def test_zero_area_faces_alone(unchanged):
    call = from_mesh(scenes.mesh_object('Flat', [(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)]))
    unchanged()
    scenes.refuses(call, 'area')


def test_zero_area_faces_among_others_are_harmless(stipple):
    obj = scenes.mesh_object('Mixed', [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0)], [(0, 1, 2), (0, 1, 3)])
    assert stipple.scene.source.splat_data.count(scenes.make_splats(obj, anchors=500).data) == 500


@pytest.mark.parametrize('value', [float('nan'), float('inf')])
def test_vertices_that_are_no_numbers(unchanged, value):
    quad = scenes.quad('Broken')
    positions = np.zeros(12, np.float32)
    quad.data.vertices.foreach_get('co', positions)
    positions[4] = value
    quad.data.vertices.foreach_set('co', positions)
    quad.data.update()
    call = from_mesh(quad)
    unchanged()
    message = scenes.refuses(call, "Object 'Broken'")
    assert 'finite' in message or 'nan' in message.lower() or 'inf' in message.lower()


def test_missing_texture_file(stipple, tmp_path):
    image = scenes.half_image()
    image.filepath_raw, image.file_format = str(tmp_path / 'gone.png'), 'PNG'
    image.save()
    image.source = 'FILE'
    os.remove(tmp_path / 'gone.png')
    image.reload()
    quad = scenes.quad()
    scenes.image_material('textured', image, quad)
    assert 'gone.png' in takes_viewport_colour(stipple, quad, "Image 'halves' of material 'textured' cannot be read")


def test_missing_uv_map(stipple):
    quad = scenes.quad('Bare', with_uv=False)
    scenes.image_material('textured', scenes.half_image(), quad)
    takes_viewport_colour(stipple, quad, "Object 'Bare' has no UV map, which image 'halves' needs")


def test_missing_attribute_of_a_material(stipple):
    quad = scenes.quad('Bare')
    material = scenes.material('painted', obj=quad)
    node = material.node_tree.nodes.new('ShaderNodeVertexColor')
    node.layer_name = 'Paint'
    material.node_tree.links.new(node.outputs['Color'], scenes.principled(material).inputs['Base Color'])
    takes_viewport_colour(stipple, quad, "Object 'Bare' has no color attribute 'Paint'")


def takes_viewport_colour(stipple, quad, problem):
    """Splats are made all the same, in the viewport colour of the material; returns the note that says so."""
    quad.data.materials[0].diffuse_color = (0.1, 0.7, 0.2, 1.0)
    other = scenes.quad('Other', offset=(0.0, 0.0, 3.0))
    scenes.material('plain', (0.1, 0.7, 0.2), other)
    notes = []
    scenes.select(quad, other)
    stipple.scene.meshes.native_mesh(stipple.scene.source.sources.context(), [quad, other],
                                     bpy.context.evaluated_depsgraph_get(), 'MATERIAL', notes)
    name = quad.data.materials[0].name
    assert len(notes) == 1 and notes[0].startswith(problem), notes
    assert notes[0].endswith(f"The viewport color of '{name}' takes its place.")
    assert bpy.ops.stipple.splats_from_mesh(anchors=400) == {'FINISHED'}
    splats = stipple.scene.source.splat_data.read(bpy.context.object.data)
    assert splats.count == 400
    # All are of one colour: that of the other material.
    colours = splats.sh.reshape(splats.count, -1)[:, :3]
    assert np.ptp(colours, axis=0).max() < 1e-5
    return notes[0]


def test_missing_colour_attribute(unchanged):
    call = from_mesh(scenes.quad('Bare'), color_from='ATTRIBUTE')
    unchanged()
    scenes.refuses(call, "Object 'Bare' has no color attribute")


@pytest.mark.parametrize('budget', [0, -5, 2 ** 28 + 1])
def test_budget_out_of_range(unchanged, budget):
    call = from_mesh(scenes.quad(), anchors=budget)
    unchanged()
    scenes.refuses(call, f'Anchor budget is {budget:,}; allowed are 1 to 268,435,456')


@pytest.mark.parametrize('count', [0, 33])
def test_gaussians_per_anchor_out_of_range(unchanged, count):
    call = from_mesh(scenes.quad(), gaussians_per_anchor=count)
    unchanged()
    scenes.refuses(call, f'Gaussians per anchor is {count}; allowed are 1 to 32')


def test_negative_seed_and_detail(unchanged):
    quad = scenes.quad()
    unchanged_after = from_mesh(quad, seed=-1)
    unchanged()
    scenes.refuses(unchanged_after, 'Seed is -1')
    scenes.refuses(from_mesh(quad, detail_weight=-1.0), '-1')
    scenes.select(quad)
    unchanged()


@pytest.mark.parametrize('budget', [0, -5, 2 ** 28 + 1])
def test_slider_out_of_range_keeps_the_splats_and_says_so(stipple, budget):
    obj = scenes.make_splats(scenes.quad(), anchors=500)
    before = stipple.scene.source.splat_data.read(obj.data)
    obj.data.stipple.anchors = budget
    assert stipple.scene.source.sync.problems[obj.data.name] == (
        f'Anchor budget is {budget:,}; allowed are 1 to 268,435,456.')
    np.testing.assert_array_equal(stipple.scene.source.splat_data.read(obj.data).positions, before.positions)
    obj.data.stipple.anchors = 600
    assert stipple.scene.source.splat_data.count(obj.data) == 600
    assert obj.data.name not in stipple.scene.source.sync.problems


def test_unwritable_source_path(unchanged, tmp_path):
    (tmp_path / 'file').write_text('a file where a folder is needed')
    call = from_mesh(scenes.quad(), source_path=str(tmp_path / 'file' / 'a.stipple.safetensors'))
    unchanged()
    scenes.refuses(call, str(tmp_path / 'file'))
    assert (tmp_path / 'file').read_text() == 'a file where a folder is needed'


def test_unwritable_export_and_volume_paths(stipple, unchanged, tmp_path):
    scenes.make_splats(scenes.quad(), anchors=500)
    unchanged()
    nowhere = tmp_path / 'nowhere'
    scenes.refuses(lambda: bpy.ops.stipple.splats_export(filepath=str(nowhere / 'a.ply')), 'nowhere')
    scenes.refuses(lambda: bpy.ops.stipple.splats_to_volume(filepath=str(nowhere / 'a.vdb'), resolution=8), 'nowhere')
    assert not nowhere.exists()


def test_wrong_extensions(unchanged, tmp_path):
    scenes.make_splats(scenes.quad(), anchors=500)
    unchanged()
    scenes.refuses(lambda: bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'a.txt')), 'a.txt')
    scenes.refuses(lambda: bpy.ops.stipple.splats_to_volume(filepath=str(tmp_path / 'a.txt')), 'a.txt')
    assert not list(tmp_path.glob('a.*'))


@pytest.mark.parametrize('settings,text', [({'resolution': 0}, 'Resolution is 0'),
                                           ({'voxel_size': -1.0}, 'Voxel size is -1')])
def test_volume_settings_out_of_range(unchanged, tmp_path, settings, text):
    scenes.make_splats(scenes.quad(), anchors=500)
    unchanged()
    scenes.refuses(lambda: bpy.ops.stipple.splats_to_volume(filepath=str(tmp_path / 'a.vdb'), **settings), text)


@pytest.mark.parametrize('content', [b'', b'no splats here', b'ply\nformat binary_little_endian 1.0\n'
                                     b'element vertex 1000000000000\nproperty float x\nproperty float y\n'
                                     b'property float z\nend_header\n'])
def test_files_that_are_no_splats(unchanged, tmp_path, content):
    (tmp_path / 'bad.ply').write_bytes(content)
    unchanged()
    scenes.refuses(lambda: bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'bad.ply')), 'bad.ply')


def test_import_of_a_missing_file(unchanged, tmp_path):
    unchanged()
    scenes.refuses(lambda: bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'gone.ply')), 'gone.ply')


def test_lost_source_keeps_the_stored_splats(stipple, tmp_path):
    path = tmp_path / 'a.stipple.safetensors'
    obj = scenes.make_splats(scenes.quad(), anchors=500, source_path=str(path))
    path.unlink()
    stipple.scene.source.decoded.forget()
    obj.data.stipple.anchors = 600
    assert 'a.stipple.safetensors' in stipple.scene.source.sync.problems[obj.data.name]
    assert stipple.scene.source.splat_data.count(obj.data) == 500


@pytest.mark.parametrize('case', ['missing', pytest.param('abi', marks=pytest.mark.skipif(
    shutil.which('gcc') is None, reason='a library of another version takes a compiler'))])
def test_library_missing_or_of_another_version(stipple, unchanged, tmp_path, case, monkeypatch):
    import subprocess
    path = tmp_path / 'libstipple.so'
    text = 'is missing'
    if case == 'abi':
        (tmp_path / 'a.c').write_text('unsigned stipple_abi_version(void) { return 77u; }\n')
        subprocess.run(['gcc', '-shared', '-fPIC', str(tmp_path / 'a.c'), '-o', str(path)], check=True)
        text = 'ABI version 77'
    monkeypatch.setenv('STIPPLE_LIBRARY', str(path))
    call = from_mesh(scenes.quad())
    unchanged()
    scenes.refuses(call, text)
