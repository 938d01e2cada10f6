# SPDX-License-Identifier: GPL-3.0-or-later
"""Many objects in one picture: sorted together, instances in the memory of one, linked and overridden data, frame
ranges."""

import os
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest

import scenes
from shots import DC, camera, prepare, splat_wall  # noqa: F401

sys.path.append(str(Path(__file__).resolve().parents[2] / 'blend-fixtures'))

ENGINES = ('STIPPLE', 'STIPPLE_CYCLES')
RED = (0.8, 0.1, 0.05)


def scatter(obj, places, as_instance=True):
    """Geometry nodes that put an instance of an object at each place, and hide the object itself."""
    import make_shots
    mesh = bpy.data.meshes.new('points')
    mesh.from_pydata(places, [], [])
    mesh.attributes.new('size', 'FLOAT', 'POINT').data.foreach_set('value', np.ones(len(places), np.float32))
    points = scenes.link(bpy.data.objects.new('points', mesh))
    make_shots.scatter_nodes(points, obj)
    node = next(n for n in points.modifiers[0].node_group.nodes if n.type == 'OBJECT_INFO')
    node.inputs['As Instance'].default_value = as_instance
    obj.hide_render = obj.hide_viewport = True
    return points


def resident():
    """Bytes of memory that this process has."""
    return int(Path('/proc/self/statm').read_text().split()[1]) * os.sysconf('SC_PAGE_SIZE')


def large_cloud(stipple, count=40000):
    """A splat object of degree 3: 59 floats a splat."""
    random = np.random.default_rng(3)
    arrays = stipple.binding.cloud.SplatArrays(
        random.uniform(-0.5, 0.5, (count, 3)).astype(np.float32), np.tile(np.float32([1, 0, 0, 0]), (count, 1)),
        np.full((count, 3), 0.01, np.float32), np.full(count, 0.5, np.float32),
        random.uniform(-0.2, 0.2, (count, 16, 3)).astype(np.float32))
    data = stipple.scene.source.splat_data.new_data('large')
    stipple.scene.source.splat_data.write(data, arrays)
    return scenes.link(bpy.data.objects.new('large', data)), count * 59 * 4


@pytest.mark.parametrize('engine', ENGINES)
def test_objects_are_sorted_together(stipple, camera, tmp_path, engine):
    """Two half-transparent objects whose splats alternate in depth are what one object of all of them is."""
    random = np.random.default_rng(5)
    count = 400
    both = stipple.binding.cloud.SplatArrays(
        random.uniform(-1, 1, (count, 3)).astype(np.float32), np.tile(np.float32([1, 0, 0, 0]), (count, 1)),
        np.full((count, 3), 0.15, np.float32), np.full(count, 0.5, np.float32),
        np.where((np.arange(count) % 2 == 0)[:, None, None], np.float32(0.5 / DC), np.float32(-0.5 / DC))
        * np.ones((1, 1, 3), np.float32))

    def add(name, chosen):
        arrays = stipple.binding.cloud.SplatArrays(both.positions[chosen], both.rotations[chosen], both.scales[chosen],
                                                   both.opacities[chosen], both.sh[chosen])
        data = stipple.scene.source.splat_data.new_data(name)
        stipple.scene.source.splat_data.write(data, arrays)
        return scenes.link(bpy.data.objects.new(name, data))

    prepare(engine)
    one = add('one', np.arange(count))
    expected = scenes.render_pixels(tmp_path, 'one')
    one.hide_render = True
    even, odd = add('even', np.arange(0, count, 2)), add('odd', np.arange(1, count, 2))
    np.testing.assert_allclose(scenes.render_pixels(tmp_path, 'two'), expected, atol=1e-6)
    # Laid over each other they would be something else.
    odd.hide_render = True
    front = scenes.render_pixels(tmp_path, 'even')
    odd.hide_render, even.hide_render = False, True
    back = scenes.render_pixels(tmp_path, 'odd')
    assert np.abs(front + (1 - front[..., 3:]) * back - expected).max() > 0.1


@pytest.mark.parametrize('as_instance', [True, False])
@pytest.mark.parametrize('engine', ENGINES)
def test_instances_of_geometry_nodes_render(stipple, camera, tmp_path, engine, as_instance):
    quad = scenes.quad()
    scenes.material('red', RED, quad)
    obj = scenes.make_splats(quad, anchors=400)
    obj.data.stipple.anchors_render = 4000
    obj.scale = (0.25, 0.25, 0.25)
    # As Instance keeps the object's own scale, plain geometry has none.
    points = scatter(obj, [(-1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], as_instance)
    if as_instance:
        info = next(n for n in points.modifiers[0].node_group.nodes if n.type == 'OBJECT_INFO')
        info.transform_space = 'RELATIVE'
    else:
        points.modifiers[0].node_group.nodes['Instance on Points'].inputs['Scale'].default_value = (0.25, 0.25, 0.25)
        links = points.modifiers[0].node_group.links
        links.remove(points.modifiers[0].node_group.nodes['Instance on Points'].inputs['Scale'].links[0])
    gathered = None
    prepare(engine)
    alpha = scenes.render_pixels(tmp_path)[..., 3]
    assert (alpha[30, [10, 30, 50]] > 0.9).all() and (alpha[30, [20, 40]] == 0).all()
    gathered = stipple.scene.instances.gather(bpy.context.evaluated_depsgraph_get(), 'RENDER')
    assert [placed[0].info().count for placed in gathered] == [4000] * 3
    viewed = stipple.scene.view.viewed.gather(bpy.context.evaluated_depsgraph_get())
    assert [(entry.owner, entry.obj) for entry in viewed.splats] == [(points, obj)] * 3


def test_geometry_that_nodes_have_changed_is_not_the_objects(stipple, camera, tmp_path):
    """What has no object's splats is left out, rather than drawn where it is not."""
    wall = splat_wall(stipple, 'wall', 0.0, side=0.5, count=20)
    points = scatter(wall, [(0.0, 0.0, 0.0)], as_instance=False)
    group = points.modifiers[0].node_group
    move = group.nodes.new('GeometryNodeSetPosition')
    move.inputs['Offset'].default_value = (0.5, 0.0, 0.0)
    info = next(n for n in group.nodes if n.type == 'OBJECT_INFO')
    put = group.nodes['Instance on Points']
    group.links.new(info.outputs['Geometry'], move.inputs['Geometry'])
    group.links.new(move.outputs['Geometry'], put.inputs['Instance'])
    prepare('STIPPLE')
    assert scenes.render_pixels(tmp_path)[..., 3].max() == 0.0


def test_200_instances_take_the_memory_of_one(stipple):
    """One native cloud, and no memory that grows with their number before a picture is made."""
    obj, size = large_cloud(stipple)
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    stipple.scene.instances.gather(depsgraph, 'RENDER')  # what the library itself needs is there
    before = resident()
    one = stipple.scene.instances.gather(depsgraph, 'RENDER')
    of_one = resident() - before
    scatter(obj, [(float(i % 20), float(i // 20), 0.0) for i in range(200)])
    depsgraph = bpy.context.evaluated_depsgraph_get()
    before = resident()
    many = stipple.scene.instances.gather(depsgraph, 'RENDER')
    of_many = resident() - before
    print(f'one: {of_one / 1e6:.1f} MB, 200 instances: {of_many / 1e6:.1f} MB, the splats {size / 1e6:.1f} MB')
    assert len(one) == 1 and len(many) == 200
    assert len({id(placed[0]) for placed in many}) == 1
    # The cloud, and what reading attributes takes on the way: 200 copies would be 1.9 GB.
    assert of_many < 4 * size


def test_a_picture_of_200_instances_holds_no_copies(stipple, camera):
    """What the renderer says that it needs at most: 112 bytes for each splat that is projected, far from 236 of a
    copy."""
    obj, size = large_cloud(stipple, 4000)
    scatter(obj, [(float(i % 20), float(i // 20), 0.0) for i in range(200)])
    bpy.context.scene.camera.location.z = 30
    depsgraph = bpy.context.evaluated_depsgraph_get()
    many = stipple.scene.instances.gather(depsgraph, 'RENDER')
    view = stipple.scene.view.cameras.camera_of(bpy.context.scene.camera, bpy.context.scene.render, None)
    renderer = stipple.binding.renderer.Renderer(stipple.scene.source.sources.context())
    bound = renderer.memory_bound(many, view)
    assert bound < 200 * 4000 * 112 + (64 << 20)


@pytest.mark.parametrize('engine', ENGINES)
def test_linked_and_overridden_data_render(stipple, camera, tmp_path, engine):
    """A linked object, and an override that stands elsewhere with a budget and a grade of its own."""
    quad = scenes.quad()
    scenes.material('red', RED, quad)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'library.blend'))
    source = scenes.make_splats(quad, anchors=3000)
    source.scale = (0.4, 0.4, 0.4)
    name, data_name = source.name, source.data.name
    kind = 'meshes' if isinstance(source.data, bpy.types.Mesh) else 'pointclouds'
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(tmp_path / 'library.blend'), link=True) as (_, here):
        here.objects = [name]
        setattr(here, kind, [data_name])
    linked = scenes.link(here.objects[0])
    own = linked.data.override_create()
    obj = scenes.link(linked.override_create())
    obj.data, obj.location.x = own, 1.0
    own.stipple.anchors_render = 4000
    own.stipple.exposure = -1.0
    scenes.camera((0.5, 0, 6), width=60, height=60, type='ORTHO', ortho_scale=3.0)
    scene = prepare(engine)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'shot.blend'))
    picture = scenes.render_pixels(tmp_path)
    left, right = picture[30, 20], picture[30, 40]
    assert left[3] > 0.98 and right[3] > 0.98
    np.testing.assert_allclose(left[:3] / left[3], RED, atol=0.01)
    np.testing.assert_allclose(right[:3] / right[3], np.array(RED) / 2, atol=0.01)
    counts = sorted(placed[0].info().count for placed in
                    stipple.scene.instances.gather(bpy.context.evaluated_depsgraph_get(), 'RENDER'))
    assert counts == [3000, 4000]
    assert scene.render.engine == engine


# Says at each frame what was decoded; runs in the second Blender, before -a.
SPY = '''
import bpy, sys
bpy.ops.preferences.addon_enable(module='stipple')
package = sys.modules['stipple']
decode = package.scene.instances.decoded.begin
def noted(data, settings, *more):
    print('DECODED', bpy.context.scene.frame_current, settings.anchors, flush=True)
    return decode(data, settings, *more)
package.scene.instances.decoded.begin = noted
'''


@pytest.mark.parametrize('engine', ENGINES)
def test_a_range_of_frames_renders_in_the_background(tmp_path, engine):
    """`-b -s 2 -e 6 -j 2 -a` renders frames 2, 4 and 6 of a budget that grows by 100 a frame, border and scale kept."""
    quad = scenes.quad()
    scenes.camera((0, 0, 6), width=64, height=48)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    settings = scenes.make_splats(quad, anchors=100).data.stipple
    for frame, budget in ((1, 100), (11, 1100)):
        settings.anchors = budget
        settings.keyframe_insert('anchors', frame=frame)
    scenes.make_linear(settings.id_data)
    scene = prepare(engine, samples=1)
    scene.frame_start, scene.frame_end = 1, 11
    scene.render.resolution_percentage = 50
    scene.render.use_border = scene.render.use_crop_to_border = True
    scene.render.border_min_x, scene.render.border_max_x = 0.0, 0.5
    scene.render.image_settings.file_format = 'PNG'
    scene.render.filepath = str(tmp_path / 'frame_')
    bpy.ops.wm.save_mainfile()
    (tmp_path / 'spy.py').write_text(SPY)
    result = subprocess.run(
        [bpy.app.binary_path, '--background', '--factory-startup', str(tmp_path / 'a.blend'), '--python',
         str(tmp_path / 'spy.py'), '--frame-start', '2', '--frame-end', '6', '--frame-jump', '2', '--render-anim'],
        env=os.environ, timeout=120, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    assert sorted(p.name for p in tmp_path.glob('frame_*.png')) == [f'frame_000{i}.png' for i in (2, 4, 6)]
    lines = [line.split() for line in result.stdout.splitlines()]
    assert {int(l[1]): int(l[2]) for l in lines if l[:1] == ['DECODED']} == {2: 200, 4: 400, 6: 600}
    assert tuple(bpy.data.images.load(str(tmp_path / 'frame_0002.png')).size) == (16, 24)
