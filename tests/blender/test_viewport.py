# SPDX-License-Identifier: GPL-3.0-or-later
"""What 3D views show: which objects and instances, as what, and which part of the picture."""

import importlib
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

import scenes


@pytest.fixture
def viewed(stipple):
    module = importlib.import_module(f'{stipple.__name__}.scene.viewed')
    module._forget()
    return module


@pytest.fixture
def viewport(stipple):
    return importlib.import_module(f'{stipple.__name__}.viewport')


@pytest.fixture
def square():
    quad = scenes.quad()
    made = scenes.make_splats(quad, anchors=500)
    bpy.data.objects.remove(quad)
    return made


def gathered(viewed):
    return viewed.gather(bpy.context.evaluated_depsgraph_get())


def test_objects_and_instances_are_found_with_their_owners(viewed, square):
    collection = bpy.data.collections.new('group')
    collection.objects.link(square)
    empty = scenes.link(bpy.data.objects.new('empty', None))
    empty.instance_type, empty.instance_collection = 'COLLECTION', collection
    empty.location.x = 3.0
    bpy.context.view_layer.update()
    scene = gathered(viewed)
    assert sorted(entry.owner.name for entry in scene.splats) == sorted([square.name, 'empty'])
    assert {entry.obj for entry in scene.splats} == {square}
    assert len({entry.key for entry in scene.splats}) == 2
    instance = next(entry for entry in scene.splats if entry.owner == empty)
    np.testing.assert_allclose(instance.matrix[:3, 3], (3, 0, 0), atol=1e-6)
    # Both are the same cloud, in the memory of one.
    depsgraph = bpy.context.evaluated_depsgraph_get()
    clouds = [viewed.cloud_of(entry, depsgraph)[0] for entry in scene.splats]
    assert clouds[0] is clouds[1]


def test_hidden_objects_and_excluded_collections_are_not_found(viewed, square):
    assert len(gathered(viewed).splats) == 1
    square.hide_set(True)
    assert gathered(viewed).splats == ()
    square.hide_set(False)
    collection = bpy.data.collections.new('excluded')
    bpy.context.scene.collection.children.link(collection)
    for holder in list(square.users_collection):
        holder.objects.unlink(square)
    collection.objects.link(square)
    assert len(gathered(viewed).splats) == 1
    bpy.context.view_layer.layer_collection.children['excluded'].exclude = True
    assert gathered(viewed).splats == ()


def test_other_objects_can_stand_before_splats(viewed, square):
    assert gathered(viewed).others == frozenset()
    cube = scenes.sphere()
    assert gathered(viewed).others == {cube}


def test_clouds_are_kept_until_their_splats_change(viewed, square):
    depsgraph = bpy.context.evaluated_depsgraph_get()
    first = viewed.cloud_of(gathered(viewed).splats[0], depsgraph)[0]
    square.location.x = 1.0
    bpy.context.view_layer.update()
    assert viewed.cloud_of(gathered(viewed).splats[0], depsgraph)[0] is first
    square.data.stipple.anchors = 300
    depsgraph = bpy.context.evaluated_depsgraph_get()
    cloud, info = viewed.cloud_of(gathered(viewed).splats[0], depsgraph)
    assert cloud is not first and info.count == 300
    # Changed by hand, past every setting.
    scales = square.data.attributes['scale']
    for entry in scales.data:
        entry.vector = (0.5, 0.5, 0.5)
    square.data.update_tag()
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    cloud = viewed.cloud_of(gathered(viewed).splats[0], depsgraph)[0]
    np.testing.assert_allclose(cloud.read().scales, 0.5)


def test_the_largest_objects_become_points_until_the_rest_is_few_enough(viewport):
    entries = [SimpleNamespace(key=name, count=count) for name, count in (('a', 100), ('b', 500), ('c', 300), ('d', 50))]

    def split(most):
        return tuple(''.join(entry.key for entry in part) for part in viewport.split(entries, most))

    assert split(950) == ('abcd', '')
    assert split(949) == ('acd', 'b')
    assert split(200) == ('ad', 'bc')
    assert split(0) == ('', 'abcd')


@pytest.mark.parametrize('kind', ({'type': 'PERSP', 'lens': 35.0, 'shift_x': 0.1}, {'type': 'ORTHO', 'ortho_scale': 3.0}),
                         ids=('perspective', 'orthographic'))
def test_a_border_is_a_part_of_the_whole_picture(stipple, square, kind):
    scenes.camera((0.3, 0.2, 6), width=120, height=80, **kind)
    cameras, facts, sources = stipple.scene.cameras, stipple.scene.facts, stipple.scene.sources
    scene = bpy.context.scene
    bpy.context.view_layer.update()
    camera = cameras.camera_of(scene.camera, scene.render)
    renderer = stipple.binding.renderer.Renderer(sources.context())

    def picture(of):
        task = renderer.start([(sources.cloud_from_object(square), np.eye(4))], of, renderer.options(), with_depth=False)
        task.job.wait()
        return task.colour

    whole, part = picture(camera), picture(cameras.part_of(camera, facts.Border(40, 10, 60, 50)))
    assert whole[..., 3].max() > 0.9
    # Rows count from the top, the border from the bottom. Single precision inside tiles that lie elsewhere.
    np.testing.assert_allclose(part, whole[20:70, 40:100], atol=2e-5)
    coarse = picture(cameras.part_of(camera, facts.Border(40, 10, 60, 50), 2))
    assert coarse.shape == (25, 30, 4)
    assert abs(coarse.mean() - part.mean()) < 0.02


def test_clipping_planes_leave_what_lies_below(stipple, square):
    cloud_edit = importlib.import_module(f'{stipple.__name__}.binding.cloud_edit')
    cloud = stipple.scene.sources.cloud_from_object(square)
    positions = cloud.positions()
    np.testing.assert_array_equal(positions, cloud.read().positions)
    kept = cloud_edit.clipped(cloud, [(1.0, 0.0, 0.0, -0.25), (0.0, 2.0, 0.0, 0.5)])
    expected = positions[(positions[:, 0] <= 0.25) & (positions[:, 1] <= -0.25)]
    assert 0 < len(expected) < len(positions)
    np.testing.assert_array_equal(kept.positions(), expected)
    assert cloud_edit.clipped(cloud, [(0.0, 0.0, 1.0, -5.0)]) is cloud
    assert cloud_edit.clipped(cloud, [(0.0, 0.0, 0.0, 1.0)]).info().count == 0
