# SPDX-License-Identifier: GPL-3.0-or-later
"""Import and export: bits, transforms, formats."""

import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

import scenes
from test_splat_data import make_arrays

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import usd_schema  # noqa: E402


def write_ply(stipple, path, arrays):
    stipple.binding.cloud.Cloud.create(stipple.scene.source.sources.context(), arrays).save(str(path))


def assert_close(a, b):
    """PLY stores logarithms and logits of scale and opacity: single precision of those leaves 1e-5."""
    np.testing.assert_array_equal(a.positions, b.positions)
    np.testing.assert_array_equal(a.sh, b.sh)
    np.testing.assert_allclose(a.scales, b.scales, rtol=1e-5)
    np.testing.assert_allclose(a.opacities, b.opacities, atol=1e-5)
    np.testing.assert_allclose(a.rotations, b.rotations, atol=1e-6)


@pytest.mark.parametrize('degree', [0, 3])
@pytest.mark.parametrize('text', [False, True])
def test_round_trip(stipple, tmp_path, degree, text):
    arrays = make_arrays(stipple, degree=degree)
    write_ply(stipple, tmp_path / 'in.ply', arrays)
    assert bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'in.ply')) == {'FINISHED'}
    obj = bpy.context.object
    assert obj.name == 'in' and obj.data.stipple.source_kind == 'CLOUD'
    assert_close(stipple.scene.source.splat_data.read(obj.data), arrays)
    assert bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'out.ply'), ascii=text) == {'FINISHED'}
    assert bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'out.ply')) == {'FINISHED'}
    assert_close(stipple.scene.source.splat_data.read(bpy.context.object.data), arrays)


def test_transform_is_applied_on_request(stipple, tmp_path):
    arrays = make_arrays(stipple, degree=1)
    write_ply(stipple, tmp_path / 'in.ply', arrays)
    bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'in.ply'))
    obj = bpy.context.object
    matrix = Matrix.Translation((1, 2, 3)) @ Euler((0.3, 0.4, 0.5)).to_matrix().to_4x4() @ Matrix.Scale(2.0, 4)
    obj.matrix_world = matrix
    bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'own.ply'), apply_transform=False)
    bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'world.ply'), apply_transform=True, up_axis='Z')
    load = stipple.binding.cloud.Cloud.load
    native = stipple.scene.source.sources.context()
    assert_close(load(native, str(tmp_path / 'own.ply')).read(), arrays)
    world = load(native, str(tmp_path / 'world.ply')).read()
    m = np.array(matrix)
    # Single precision of positions within 20 m.
    np.testing.assert_allclose(world.positions, arrays.positions @ m[:3, :3].T + m[:3, 3], atol=1e-5)
    np.testing.assert_allclose(world.scales, 2 * arrays.scales, rtol=1e-4)
    # Turning harmonics keeps the constant part and the length of each band.
    np.testing.assert_allclose(world.sh[:, 0], arrays.sh[:, 0], atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(world.sh[:, 1:4], axis=1), np.linalg.norm(arrays.sh[:, 1:4], axis=1),
                               rtol=1e-4)


@pytest.mark.parametrize('scale', [(1, 2, 1), (-1, 1, 1), (-0.5, 2, 3)])
def test_uneven_and_mirrored_objects_are_applied(stipple, tmp_path, scale):
    arrays = make_arrays(stipple, degree=1)
    write_ply(stipple, tmp_path / 'in.ply', arrays)
    bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'in.ply'), up_axis='Z')
    bpy.context.object.scale = scale
    bpy.context.view_layer.update()
    assert bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'out.ply'), up_axis='Z') == {'FINISHED'}
    out = stipple.binding.cloud.Cloud.load(stipple.scene.source.sources.context(), str(tmp_path / 'out.ply')).read()
    m = np.diag(scale).astype(float)
    for i in range(len(arrays.positions)):
        expected = m @ covariance(arrays, i) @ m.T
        # PLY stores logarithms of scales in single precision.
        np.testing.assert_allclose(covariance(out, i), expected, atol=1e-5 * np.linalg.norm(expected))
    np.testing.assert_allclose(out.positions, arrays.positions * np.float32(scale), rtol=1e-6)


def covariance(arrays, i):
    w, x, y, z = (float(v) for v in arrays.rotations[i])
    turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])
    axes = turn * arrays.scales[i].astype(float)
    return axes @ axes.T


def test_a_flattened_object_cannot_be_applied(stipple, tmp_path):
    write_ply(stipple, tmp_path / 'in.ply', make_arrays(stipple, degree=0))
    bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'in.ply'))
    bpy.context.object.scale = (1, 0, 1)
    bpy.context.view_layer.update()
    scenes.refuses(lambda: bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'out.ply')), 'singular')
    assert not (tmp_path / 'out.ply').exists()


@pytest.mark.parametrize('axis,up', [('Z', (0, 0, 1)), ('Y', (0, 1, 0)), ('-Y', (0, -1, 0))])
def test_up_axis_turns_the_object_only(stipple, tmp_path, axis, up):
    arrays = make_arrays(stipple, degree=0)
    write_ply(stipple, tmp_path / 'in.ply', arrays)
    bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'in.ply'), up_axis=axis)
    obj = bpy.context.object
    np.testing.assert_allclose(np.array(obj.matrix_world)[:3, :3] @ up, (0, 0, 1), atol=1e-6)
    np.testing.assert_array_equal(stipple.scene.source.splat_data.read(obj.data).positions, arrays.positions)


def load(stipple, path):
    return stipple.binding.cloud.Cloud.load(stipple.scene.source.sources.context(), str(path)).read()


@pytest.mark.parametrize('frame, up', [('UNKNOWN', (0, -1, 0)), ('RDF', (0, -1, 0)), ('RUB', (0, 1, 0)),
                                       ('RFU', (0, 0, 1)), ('LUF', (0, 1, 0))])
def test_the_files_frame_decides_by_default(stipple, tmp_path, frame, up):
    arrays = make_arrays(stipple, degree=1)
    arrays.frame = stipple.binding.structs.Frame[frame]
    stipple.binding.cloud.Cloud.create(stipple.scene.source.sources.context(), arrays).save(str(tmp_path / 'in.ply'),
                                                                                    frame=arrays.frame)
    bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'in.ply'))
    obj = bpy.context.object
    np.testing.assert_allclose(np.array(obj.matrix_world)[:3, :3] @ up, (0, 0, 1), atol=1e-6)
    assert_close(stipple.scene.source.splat_data.read(obj.data), arrays)
    assert stipple.scene.source.splat_data.read(obj.data).frame == arrays.frame


def test_an_export_in_the_formats_frame_comes_back_to_its_place(stipple, tmp_path):
    write_ply(stipple, tmp_path / 'in.ply', make_arrays(stipple, degree=2))
    bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'in.ply'))
    obj = bpy.context.object
    obj.matrix_world = Matrix.Translation((1, 2, 3)) @ Euler((0.3, 0.4, 0.5)).to_matrix().to_4x4()
    for axis, up in (('AUTO', (0, -1, 0)), ('Y', (0, 1, 0)), ('Z', (0, 0, 1)), ('-Y', (0, -1, 0))):
        scenes.select(obj)
        bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'out.ply'), up_axis=axis)
        bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'out.ply'))
        back = bpy.context.object
        np.testing.assert_allclose(np.array(back.matrix_world)[:3, :3] @ up, (0, 0, 1), atol=1e-6)

        def world(o):
            m = np.array(o.matrix_world)
            return stipple.scene.source.splat_data.read(o.data).positions @ m[:3, :3].T + m[:3, 3]
        np.testing.assert_allclose(world(back), world(obj), atol=1e-5)


def test_several_files_at_once_and_a_broken_one_among_them(stipple, tmp_path):
    for i, name in enumerate(('a', 'b')):
        write_ply(stipple, tmp_path / f'{name}.ply', make_arrays(stipple, count=10 + i))
    (tmp_path / 'c.ply').write_bytes(b'ply\nnonsense')
    files = [{'name': f'{name}.ply'} for name in 'abc']
    assert bpy.ops.stipple.splats_import(directory=str(tmp_path), files=files) == {'FINISHED'}
    assert sorted(o.name for o in bpy.data.objects) == ['a', 'b']
    assert {o.name for o in bpy.context.view_layer.objects.selected} == {'a', 'b'}
    scenes.refuses(lambda: bpy.ops.stipple.splats_import(directory=str(tmp_path), files=files[2:]), 'c.ply')
    assert len(bpy.data.objects) == 2


def test_the_up_axis_of_a_format_is_remembered(stipple, tmp_path):
    preferences = stipple.preferences
    write_ply(stipple, tmp_path / 'in.ply', make_arrays(stipple, degree=0))
    preferences.remember_up_axis('ply', 'Y')
    try:
        bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'in.ply'))
        np.testing.assert_allclose(np.array(bpy.context.object.matrix_world)[:3, :3] @ (0, 1, 0), (0, 0, 1), atol=1e-6)
        bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'in.ply'), up_axis='Z')
        assert bpy.context.object.matrix_world == Matrix.Identity(4)
    finally:
        preferences.get().formats.clear()
    bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'in.ply'))
    np.testing.assert_allclose(np.array(bpy.context.object.matrix_world)[:3, :3] @ (0, -1, 0), (0, 0, 1), atol=1e-6)


def test_export_of_a_selection_a_collection_and_all_that_is_visible(stipple, tmp_path):
    objects = []
    for i, name in enumerate('abc'):
        write_ply(stipple, tmp_path / f'{name}.ply', make_arrays(stipple, count=10 * (i + 1), degree=i))
        bpy.ops.stipple.splats_import(filepath=str(tmp_path / f'{name}.ply'))
        objects.append(bpy.context.object)
    a, b, c = objects
    out = tmp_path / 'out.ply'

    def exported(**options):
        assert bpy.ops.stipple.splats_export(filepath=str(out), **options) == {'FINISHED'}
        return load(stipple, out)
    scenes.select(a, c)
    assert exported().positions.shape == (40, 3)
    assert exported().sh.shape == (40, 9, 3)
    assert exported(max_degree=1).sh.shape == (40, 4, 3)
    assert exported(use_selection=False).count == 60
    b.hide_set(True)
    assert exported(use_selection=False).count == 40
    collection = bpy.data.collections.new('only b')
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(b)
    assert exported(collection='only b').count == 20
    for obj in objects:
        obj.select_set(False)
    scenes.refuses(lambda: bpy.ops.stipple.splats_export(filepath=str(out)), 'no splats in the selection')
    # In the active object's own space, the others relative to it.
    c.matrix_world = Matrix.Translation((1, 0, 0)) @ c.matrix_world
    a.matrix_world = c.matrix_world @ Matrix.Translation((0, 0, 5))
    scenes.select(c, a)
    both = exported(apply_transform=False)
    np.testing.assert_array_equal(both.positions[:30], stipple.scene.source.splat_data.read(c.data).positions)
    np.testing.assert_allclose(both.positions[30:], stipple.scene.source.splat_data.read(a.data).positions + (0, 0, 5),
                               atol=1e-5)


def test_usd_keeps_objects_and_has_shared_splats_once(stipple, tmp_path):
    write_ply(stipple, tmp_path / 'tree.ply', make_arrays(stipple, count=3000, degree=1))
    bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'tree.ply'))
    tree = bpy.context.object
    twins = [tree]
    for i in range(3):
        twin = tree.copy()  # as Alt D: the splats are shared
        twin.matrix_world = Matrix.Translation((4 * i, 1, 0)) @ Euler((0.3, 0.2 * i, 1)).to_matrix().to_4x4()
        bpy.context.scene.collection.objects.link(twin)
        twins.append(twin)
    bpy.context.view_layer.update()
    scenes.select(*twins)
    kept, one, ply = (tmp_path / name for name in ('kept.usda', 'one.usda', 'all.ply'))
    for path, options in ((kept, {}), (one, {'keep_objects': False}), (ply, {})):
        assert bpy.ops.stipple.splats_export(filepath=str(path), up_axis='Z', **options) == {'FINISHED'}
    text = kept.read_text()
    assert text.count('point3f[] positions') == 1 and one.read_text().count('point3f[] positions') == 1
    assert text.count('instanceable = true') == 4 and 'def Xform "tree_001"' in text
    assert 3.5 * kept.stat().st_size < one.stat().st_size
    assert usd_schema.faults(kept) == usd_schema.faults(one) == []
    joined, apart = load(stipple, ply), load(stipple, kept)
    assert apart.count == joined.count == 12000
    np.testing.assert_allclose(apart.positions, joined.positions, atol=1e-5)
    np.testing.assert_allclose(apart.sh, joined.sh, atol=1e-5)
    np.testing.assert_allclose(apart.scales, joined.scales, rtol=1e-4)
    # It comes back to where it was.
    assert bpy.ops.stipple.splats_import(filepath=str(kept)) == {'FINISHED'}
    there = stipple.scene.source.splat_data.read(bpy.context.object.data)
    world = np.array(bpy.context.object.matrix_world)
    np.testing.assert_allclose(there.positions @ world[:3, :3].T + world[:3, 3], joined.positions, atol=1e-5)

    # An object without splats is left out.
    bare = scenes.link(bpy.data.objects.new('bare', stipple.scene.source.splat_data.new_data('bare')))
    empty = stipple.binding.cloud.SplatArrays(*(np.empty((0, width), np.float32) for width in (3, 4, 3)),
                                              np.empty(0, np.float32), np.empty((0, 1, 3), np.float32))
    stipple.scene.source.sync.write(bare.data, empty, '')
    scenes.select(*twins, bare)
    assert bpy.ops.stipple.splats_export(filepath=str(kept), up_axis='Z') == {'FINISHED'}
    assert 'bare' not in kept.read_text() and load(stipple, kept).count == 12000

    class Settings:
        collection, use_selection, budget, max_degree, filepath = '', True, 'VIEWPORT', 3, str(kept)
        ascii = half = False
        keep_objects = True
    scenes.select(*twins)
    shown = stipple.scene.source.exporting.size_label(bpy.context, Settings)
    megabytes = float(shown.split('about ')[1].split()[0])
    assert shown.startswith('12,000 splats') and abs(megabytes - kept.stat().st_size / 1e6) < 0.1 * megabytes
    Settings.keep_objects = False
    assert float(stipple.scene.source.exporting.size_label(bpy.context, Settings).split('about ')[1].split()[0]) > 3 * megabytes


def test_budgets_of_an_export(stipple, tmp_path):
    obj = scenes.make_splats(scenes.quad(), anchors=100, source_path=str(tmp_path / 'a.stipple.safetensors'))
    obj.data.stipple.anchors_render = 250
    for budget, count in (('VIEWPORT', 100), ('RENDER', 250), ('FULL', 250)):
        bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'out.ply'), budget=budget)
        assert load(stipple, tmp_path / 'out.ply').count == count


def test_the_size_is_estimated_well(stipple, tmp_path):
    write_ply(stipple, tmp_path / 'in.ply', make_arrays(stipple, count=20000, degree=3))
    bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'in.ply'))
    exporting, formats = stipple.scene.source.exporting, stipple.scene.source.formats
    # The estimate is the library's (tests/native/io); here it reaches the dialog, of the format that is written.
    for name, degree in (('out.ply', 3), ('out.ply', 1), ('out.compressed.ply', 3), ('out.splat', 3)):
        bpy.ops.stipple.splats_export(filepath=str(tmp_path / name), max_degree=degree)
        size = (tmp_path / name).stat().st_size
        assert abs(formats.estimated_bytes(formats.of_path(name), 20000, 3,
                                           sh_degree_limit=degree) - size) < 0.01 * size

    class Settings:
        collection, use_selection, budget, max_degree, filepath = '', True, 'VIEWPORT', 3, 'x.ply'
        ascii = half = keep_objects = False
    assert exporting.size_label(bpy.context, Settings) == '20,000 splats, about 5.0 MB'
    Settings.filepath = 'x.compressed.ply'
    assert exporting.size_label(bpy.context, Settings) == '20,000 splats, about 1.2 MB'


def test_dialogs_and_file_handlers_know_the_formats_of_the_library(stipple):
    formats = stipple.scene.source.formats
    known = formats.all_formats()
    assert {'.ply', '.ksplat', 'meta.json'} <= set(formats.read_extensions())
    assert set(formats.read_extensions()) - set(formats.write_extensions()) == {'.ksplat'}
    # What can be dropped is known before the library is.
    assert sorted(formats.DROPPED_EXTENSIONS) == sorted(e for e in formats.read_extensions() if e.startswith('.'))
    assert formats.of_path('/a/B.PLY').name == 'ply' and formats.of_path('a.txt') is None
    handler = getattr(bpy.types, 'STIPPLE_FH_splats', None)
    assert (handler is not None) == (bpy.app.version >= (4, 1, 0))
    if handler is not None:
        assert set(handler.bl_file_extensions.split(';')) == {'.safetensors', *formats.DROPPED_EXTENSIONS}
