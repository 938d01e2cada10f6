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
    module = importlib.import_module(f'{stipple.__name__}.scene.view.viewed')
    module._forget()
    return module


@pytest.fixture
def viewport(stipple):
    return importlib.import_module(f'{stipple.__name__}.viewport.drawing')


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
    entries = [SimpleNamespace(key=name, count=count) for name,
               count in (('a', 100), ('b', 500), ('c', 300), ('d', 50))]

    def split(most):
        return tuple(''.join(entry.key for entry in part) for part in viewport.split(entries, most))

    assert split(950) == ('abcd', '')
    assert split(949) == ('acd', 'b')
    assert split(200) == ('ad', 'bc')
    assert split(0) == ('', 'abcd')


@pytest.mark.parametrize('kind', ({'type': 'PERSP', 'lens': 35.0, 'shift_x': 0.1},
                                  {'type': 'ORTHO', 'ortho_scale': 3.0}),
                         ids=('perspective', 'orthographic'))
def test_a_border_is_a_part_of_the_whole_picture(stipple, square, kind):
    scenes.camera((0.3, 0.2, 6), width=120, height=80, **kind)
    cameras, facts, sources = stipple.scene.view.cameras, stipple.scene.view.facts, stipple.scene.source.sources
    scene = bpy.context.scene
    bpy.context.view_layer.update()
    camera = cameras.camera_of(scene.camera, scene.render)
    renderer = stipple.binding.renderer.Renderer(sources.context())

    def picture(of):
        task = renderer.start([(sources.cloud_from_object(square), np.eye(4))], of, renderer.options(),
                              with_depth=False)
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
    cloud = stipple.scene.source.sources.cloud_from_object(square)
    positions = cloud.positions()
    np.testing.assert_array_equal(positions, cloud.read().positions)
    kept = cloud_edit.clipped(cloud, [(1.0, 0.0, 0.0, -0.25), (0.0, 2.0, 0.0, 0.5)])
    expected = positions[(positions[:, 0] <= 0.25) & (positions[:, 1] <= -0.25)]
    assert 0 < len(expected) < len(positions)
    np.testing.assert_array_equal(kept.positions(), expected)
    assert cloud_edit.clipped(cloud, [(0.0, 0.0, 1.0, -5.0)]) is cloud
    assert cloud_edit.clipped(cloud, [(0.0, 0.0, 0.0, 1.0)]).info().count == 0


def made_pictures(view_image, viewed, borders):
    """What a rendered view's jobs make of the scene, coarse and fine, without a window: [H,W,4], top row first."""
    picture = view_image.ViewImage()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    picture.update(depsgraph, print)
    camera = importlib.import_module(view_image.__name__.replace('viewport.view_image',
                                                                 'scene.view.cameras')).camera_of(
        bpy.context.scene.camera, bpy.context.scene.render, None)
    found = []
    for coarse in (2, 1):
        picture._key = coarse
        picture._start(bpy.context.scene, depsgraph, view_image.ViewCamera(camera, borders), picture._instances,
                       picture._mattes.placed, np.zeros((0, 4)), coarse)
        while picture._task.is_running():
            pass
        picture._task.wait()
        found.append(picture._task.colour)
    return found


def test_meshes_and_holdouts_hide_splats_in_rendered_views(stipple, viewed, square):
    """A quad before the left half of splats; then holdouts alone; then nothing."""
    view_image = importlib.import_module(f'{stipple.__name__}.viewport.view_image')
    facts = importlib.import_module(f'{stipple.__name__}.scene.view.facts')
    scene = bpy.context.scene
    scenes.camera((0, 0, 6), width=60, height=60, type='ORTHO', ortho_scale=3.0)
    quad = scenes.quad('before', offset=(-1.0, 0.0, 1.0))
    scene.render.film_transparent = True
    whole = facts.Border(0, 0, 60, 60)

    def alphas():
        bpy.context.view_layer.update()
        coarse, fine = made_pictures(view_image, viewed, whole)
        assert coarse.shape == (30, 30, 4) and fine.shape == (60, 60, 4)
        np.testing.assert_allclose(coarse[15, [10, 20], 3], fine[30, [20, 40], 3], atol=0.05)
        return fine[30, 20, 3], fine[30, 40, 3]

    hidden, seen = alphas()
    assert hidden == 0.0 and seen > 0.9
    scene.stipple.meshes_as_mattes = False
    assert min(alphas()) > 0.9
    quad.is_holdout = True
    hidden, seen = alphas()
    assert hidden == 0.0 and seen > 0.9
    square.is_holdout = True
    assert max(alphas()) == 0.0


def test_averages_of_rendered_views_are_those_of_renders(stipple, viewed, square, tmp_path, monkeypatch):
    """Out of focus behind the edge of a mesh, which is drawn once for all averages."""
    view_image = importlib.import_module(f'{stipple.__name__}.viewport.view_image')
    facts = importlib.import_module(f'{stipple.__name__}.scene.view.facts')
    monkeypatch.setattr(view_image, '_texture', lambda pixels: pixels)
    scene = bpy.context.scene
    camera = scenes.camera((0, 0, 6), width=60, height=60, lens=50.0)
    scenes.quad('before', offset=(-1.0, 0.0, 1.0))
    dof = camera.data.dof
    dof.use_dof, dof.aperture_fstop, dof.focus_distance = True, 0.05, 3.0
    scene.render.engine, scene.render.film_transparent = 'STIPPLE', True
    scene.stipple.exact_projection = scene.stipple.zoom_antialiasing = 'OFF'
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    seen = view_image.ViewCamera(stipple.scene.view.cameras.camera_of(camera, scene.render, None),
                                   facts.Border(0, 0, 60, 60),
                                 stipple.scene.view.apertures.aperture_of(camera, depsgraph))
    picture = view_image.ViewImage()
    picture.update(depsgraph, print)
    picture._key = 'still'
    meshes = []
    monkeypatch.setattr(stipple.scene.view.mattes, 'start_samples', lambda *given,
                        start=stipple.scene.view.mattes.start_samples:
                        meshes.append(given) or start(*given))
    drawn = {}
    while picture._shown is None or not picture._is_done(seen):
        samples = 4 * picture._shown.samples if picture._shown is not None else 1
        picture._start(scene, depsgraph, seen, picture._instances, picture._mattes.placed, np.zeros((0, 4)), 1, samples)
        while picture._task is not None:
            picture._take(1.0)
        drawn[picture._shown.samples] = picture._shown.texture
    assert list(drawn)[:3] == [1, 4, 16] and list(drawn)[-1] == picture._sample_count
    assert len(meshes) == 1
    for samples in (4, 16):
        scene.stipple.blur_samples = samples
        rendered = scenes.render_pixels(tmp_path, str(samples))[::-1]
        # Renders have more samples of the mesh's edge.
        assert np.abs(drawn[samples] - rendered).mean() < 0.003
        assert np.abs(drawn[1] - rendered).mean() > 0.02


def test_rendered_views_read_a_mesh_again_only_when_it_changes(stipple, viewed, square, monkeypatch):
    quad = scenes.quad('before')
    read, reader = [], stipple.scene.view.mattes.read
    monkeypatch.setattr(stipple.scene.view.mattes, 'read', lambda obj: read.append(obj.name) or reader(obj))
    kept = importlib.import_module(f'{stipple.__name__}.scene.view.view_mattes').ViewMattes()

    def update():
        bpy.context.view_layer.update()
        kept.update(bpy.context.evaluated_depsgraph_get(), 'ALL')
        return len(read)

    assert update() == 1 and update() == 1
    quad.location.x = 1.0
    assert update() == 1
    np.testing.assert_allclose(kept.placed[0][2][1][:3, 3], (1, 0, 0), atol=1e-6)
    quad.data.vertices[0].co.x = -3.0
    quad.data.update()
    assert update() == 2
    quad.modifiers.new('array', 'ARRAY')
    assert update() == 3
    quad.hide_set(True)
    assert update() == 3 and kept.placed == []
    quad.hide_set(False)
    assert update() == 4
