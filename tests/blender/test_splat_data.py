# SPDX-License-Identifier: GPL-3.0-or-later
"""The attribute contract: names, types and bits of stored splats."""

import bpy
import numpy as np
import pytest


def make_arrays(stipple, count=50, degree=2):
    from_cloud = stipple.binding.cloud
    rng = np.random.default_rng(3)
    rotations = rng.normal(size=(count, 4)).astype(np.float32)
    rotations /= np.linalg.norm(rotations, axis=1, keepdims=True)
    return from_cloud.SplatArrays(rng.normal(size=(count, 3)).astype(np.float32), rotations,
                                  rng.uniform(0.01, 1, (count, 3)).astype(np.float32),
                                  rng.uniform(0, 1, count).astype(np.float32),
                                  rng.normal(size=(count, (degree + 1) ** 2, 3)).astype(np.float32))


def assert_equal(a, b):
    for name in ('positions', 'rotations', 'scales', 'opacities', 'sh'):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), name)
    assert (a.colour_space, a.antialias, a.frame) == (b.colour_space, b.antialias, b.frame)


@pytest.mark.parametrize('degree', [0, 1, 2, 3, 4])
def test_splats_come_back_bit_for_bit(stipple, degree):
    splat_data = stipple.scene.source.splat_data
    data = splat_data.new_data('splats')
    arrays = make_arrays(stipple, degree=degree)
    splat_data.write(data, arrays)
    assert_equal(splat_data.read(data), arrays)


@pytest.mark.parametrize('degree', [0, 3])
def test_native_clouds_are_those_of_the_arrays(stipple, degree):
    """Attributes go into a cloud and out of it without arrays between them, evaluated ones too."""
    splat_data, native = stipple.scene.source.splat_data, stipple.scene.source.sources.context()
    arrays = make_arrays(stipple, degree=degree)
    data = splat_data.new_data('splats')
    splat_data.write(data, arrays)
    obj = splat_data.new_object('splats', data)
    bpy.context.scene.collection.objects.link(obj)
    expected = arrays.to_cloud(native).read()
    assert_equal(splat_data.cloud(native, data).read(), expected)
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    cloud = splat_data.cloud(native, evaluated, data)
    assert_equal(cloud.read(), expected)
    again = splat_data.new_data('again')
    splat_data.write(again, cloud.columns())
    assert_equal(splat_data.read(again), expected)


@pytest.mark.parametrize('count', [0, 1, 7])
def test_attribute_values_are_blenders(stipple, count):
    data = stipple.scene.source.splat_data.new_data('splats')
    stipple.scene.source.splat_data.write(data, make_arrays(stipple, count=count, degree=0))
    for name, width in (('scale', 3), ('rotation', 4)):
        elements = data.attributes[name].data
        field = stipple.version.ATTRIBUTE_FIELDS[data.attributes[name].data_type]
        expected = np.empty(count * width, np.float32)
        elements.foreach_get(field, expected)
        np.testing.assert_array_equal(stipple.version.attribute_values(elements, field, count, width), expected)


def test_an_attribute_of_another_kind_is_refused(stipple):
    data = stipple.scene.source.splat_data.new_data('splats')
    stipple.scene.source.splat_data.write(data, make_arrays(stipple, degree=0))
    data.attributes.remove(data.attributes['scale'])
    data.attributes.new('scale', 'FLOAT', 'POINT')
    with pytest.raises((stipple.binding.errors.StippleError, RuntimeError, TypeError)):
        stipple.scene.source.splat_data.cloud(stipple.scene.source.sources.context(), data)


def test_attributes_have_the_names_and_types_of_the_contract(stipple):
    data = stipple.scene.source.splat_data.new_data('splats')
    stipple.scene.source.splat_data.write(data, make_arrays(stipple, degree=1))
    kinds = {a.name: a.data_type for a in data.attributes if a.domain == 'POINT'}
    new = bpy.app.version >= (5, 2, 0)
    four = 'FLOAT4' if new else 'FLOAT_COLOR'
    expected = {'scale': 'FLOAT_VECTOR', 'radiance:base': four, 'radiance:sh_0': 'FLOAT_VECTOR',
                'radiance:sh_1': 'FLOAT_VECTOR', 'radiance:sh_2': 'FLOAT_VECTOR',
                'rotation': 'QUATERNION' if bpy.app.version >= (4, 0, 0) else 'FLOAT_COLOR'}
    assert expected.items() <= kinds.items()
    assert 'radiance:sh_3' not in kinds
    assert type(data).__name__ == ('PointCloud' if new else 'Mesh')
    assert data['stipple_layout'] == 1


def test_base_holds_dc_and_opacity_in_this_order(stipple):
    data = stipple.scene.source.splat_data.new_data('splats')
    arrays = make_arrays(stipple, count=2, degree=0)
    stipple.scene.source.splat_data.write(data, arrays)
    values = np.empty(8, np.float32)
    field = 'vector' if bpy.app.version >= (5, 2, 0) else 'color'
    data.attributes['radiance:base'].data.foreach_get(field, values)
    np.testing.assert_array_equal(values.reshape(2, 4)[:, :3], arrays.sh[:, 0])
    np.testing.assert_array_equal(values.reshape(2, 4)[:, 3], arrays.opacities)


def test_fewer_splats_and_a_lower_degree_leave_nothing_behind(stipple):
    splat_data = stipple.scene.source.splat_data
    data = splat_data.new_data('splats')
    splat_data.write(data, make_arrays(stipple, count=50, degree=3))
    for count, degree in ((20, 1), (0, 0), (70, 2), (70, 1)):
        arrays = make_arrays(stipple, count=count, degree=degree)
        splat_data.write(data, arrays)
        assert splat_data.count(data) == count
        assert_equal(splat_data.read(data), arrays)


def test_zero_scales_are_stored_as_the_smallest_scale(stipple):
    splat_data = stipple.scene.source.splat_data
    data = splat_data.new_data('splats')
    arrays = make_arrays(stipple, count=3, degree=0)
    arrays.scales[1] = 0
    splat_data.write(data, arrays)
    np.testing.assert_array_equal(splat_data.read(data).scales[1], np.float32([splat_data.MIN_SCALE] * 3))


def test_fingerprint_changes_with_every_attribute(stipple):
    splat_data = stipple.scene.source.splat_data
    data = splat_data.new_data('splats')
    arrays = make_arrays(stipple, degree=1)
    seen = set()
    for name in ('positions', 'rotations', 'scales', 'opacities', 'sh'):
        getattr(arrays, name).reshape(-1)[-1] *= 0.5
        splat_data.write(data, arrays)
        seen.add(splat_data.fingerprint(data))
    assert len(seen) == 5


def test_save_and_reload_keep_the_splats(stipple, tmp_path):
    splat_data = stipple.scene.source.splat_data
    data = splat_data.new_data('splats')
    arrays = make_arrays(stipple)
    splat_data.write(data, arrays)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new('splats', data))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'a.blend'))
    assert_equal(splat_data.read(bpy.data.objects['splats'].data), arrays)


def test_edit_mode_is_one_clear_error(stipple):
    splat_data = stipple.scene.source.splat_data
    data = splat_data.new_data('splats')
    arrays = make_arrays(stipple, degree=0)
    splat_data.write(data, arrays)
    if not isinstance(data, bpy.types.Mesh):
        pytest.skip('point clouds are written in every mode')
    obj = bpy.data.objects.new('splats', data)
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode='EDIT')
    with pytest.raises(Exception, match='is in Edit Mode'):
        splat_data.write(data, arrays)
    bpy.ops.object.mode_set(mode='OBJECT')
    assert_equal(splat_data.read(data), arrays)


@pytest.mark.parametrize('count', [50, 80])
def test_linked_data_are_written_too(stipple, tmp_path, count):
    splat_data = stipple.scene.source.splat_data
    data = splat_data.new_data('splats')
    splat_data.write(data, make_arrays(stipple))
    data.use_fake_user = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'library.blend'))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    kind = 'pointclouds' if bpy.app.version >= (5, 2, 0) else 'meshes'
    with bpy.data.libraries.load(str(tmp_path / 'library.blend'), link=True) as (_, here):
        setattr(here, kind, ['splats'])
    linked = getattr(here, kind)[0]
    assert linked.library is not None
    arrays = make_arrays(stipple, count, degree=1)
    arrays.positions += np.float32(1)
    splat_data.write(linked, arrays)
    assert_equal(splat_data.read(linked), arrays)
    assert len(getattr(bpy.data, kind)) == 1
