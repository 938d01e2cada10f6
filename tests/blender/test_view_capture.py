# SPDX-License-Identifier: GPL-3.0-or-later
"""Views of the scene for fitting: where cameras stand, what the pictures hold, and that nothing of the scene
changes."""

import importlib
import math
import os
import tempfile

import bpy
import numpy as np
import pytest
from mathutils import Vector

import scenes

ENGINES = ['CYCLES', 'EEVEE', 'WORKBENCH']


@pytest.fixture
def rigs(stipple):
    return importlib.import_module('.scene.fit.view_rigs', stipple.__name__)


@pytest.fixture
def capture(stipple):
    return importlib.import_module('.scene.fit.view_capture', stipple.__name__)


def depsgraph():
    bpy.context.view_layer.update()
    return bpy.context.evaluated_depsgraph_get()


def settings_of(owner):
    return {p.identifier: repr(getattr(owner, p.identifier)) for p in owner.bl_rna.properties
            if p.type in {'BOOLEAN', 'INT', 'FLOAT', 'ENUM', 'STRING'} and not p.is_readonly}


def room(size=4.0):
    """Walls whose faces look outwards, as a cube's do, and a ball on the floor."""
    bpy.ops.mesh.primitive_cube_add(size=size)
    walls = bpy.context.object
    ball = scenes.sphere(radius=0.5)
    ball.location = (0.8, 0.5, -size / 2 + 0.5)
    return walls, ball


def test_poses_around_see_everything_and_are_spread(rigs):
    ball = scenes.sphere()
    bounds = rigs.bounds_of([ball], depsgraph())
    poses = rigs.poses('AROUND', bpy.context.scene, depsgraph(), bounds, 40)
    places = np.array([p.matrix.translation for p in poses])
    # The cone of the picture touches the sphere around the bounds, of radius sqrt(3), from outside.
    distances = np.linalg.norm(places, axis=1)
    assert np.allclose(distances, distances[0]) and distances[0] * math.sin(poses[0].angle / 2) > math.sqrt(3)
    for pose in poses:
        assert (pose.matrix.to_quaternion() @ Vector((0, 0, -1))).dot(-pose.matrix.translation.normalized()) > 0.999
    # 40 even caps of a sphere have a radius of 0.32; no gap is wider than twice that.
    probes = np.random.default_rng(3).normal(size=(500, 3))
    probes /= np.linalg.norm(probes, axis=1, keepdims=True)
    nearest = (probes @ (places / distances[:, None]).T).max(axis=1)
    assert np.arccos(np.clip(nearest, -1, 1)).max() < 0.64
    other = rigs.poses('AROUND', bpy.context.scene, depsgraph(), bounds, 40, seed=1)
    assert not np.allclose(places, [p.matrix.translation for p in other])


def test_no_camera_around_stands_inside_or_behind_a_mesh(rigs):
    ball = scenes.sphere(radius=0.5)
    wall = scenes.quad('Wall', size=40.0)
    wall.rotation_euler = (math.pi / 2, 0, 0)
    wall.location = (0, 1.5, 0)
    bpy.ops.mesh.primitive_cube_add(size=1.5, location=(3.2, 0, 0))
    graph = depsgraph()
    bounds = rigs.bounds_of([ball], graph)
    for pose in rigs.poses('AROUND', bpy.context.scene, graph, bounds, 30):
        place = pose.matrix.translation
        assert place.y < 1.5
        assert not (abs(place.x - 3.2) < 0.75 and abs(place.y) < 0.75 and abs(place.z) < 0.75)
        # Nothing between it and the ball.
        hit, location, *_ = bpy.context.scene.ray_cast(graph, place, -place.normalized())
        assert hit and (location.length - 0.5) < 0.01


def test_poses_in_a_room_are_free_and_look_everywhere(rigs):
    walls, ball = room()
    graph = depsgraph()
    bounds = rigs.bounds_of([walls, ball], graph)
    poses = rigs.poses('INSIDE', bpy.context.scene, graph, bounds, 30)
    for pose in poses:
        place = pose.matrix.translation
        assert max(abs(x) for x in place) < 2.0
        assert (place - ball.location).length > 0.5
    looks = np.array([pose.matrix.to_quaternion() @ Vector((0, 0, -1)) for pose in poses])
    assert np.linalg.norm(looks.mean(axis=0)) < 0.05


def test_a_room_is_told_by_the_camera_in_it(rigs):
    walls, ball = room()
    bounds = rigs.bounds_of([walls, ball], depsgraph())

    def chosen():
        """Rigs have angles of their own."""
        angle = rigs.poses('AUTO', bpy.context.scene, depsgraph(), bounds, 2)[0].angle
        return 'INSIDE' if math.degrees(angle) > 60 else 'AROUND'

    assert chosen() == 'AROUND'
    camera = scenes.camera(location=(0, -1, 0))
    bpy.context.scene.camera = camera
    assert chosen() == 'INSIDE'
    camera.location = (0, -9, 0)
    assert chosen() == 'AROUND'


def test_messages_where_no_camera_can_stand(rigs, stipple):
    error = stipple.binding.errors.StippleError
    with pytest.raises(error, match='nothing to look at'):
        rigs.bounds_of([], depsgraph())
    ball = scenes.sphere()
    bounds = rigs.bounds_of([ball], depsgraph())
    with pytest.raises(error, match='0 of 4 cameras find a free place'):
        rigs.poses('INSIDE', bpy.context.scene, depsgraph(), rigs.Bounds(bounds.lowest * 3, bounds.highest * 3), 4)
    # Walls as near as skin: no camera sees all of the ball.
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=1.75)
    with pytest.raises(error, match='0 of 2 cameras around'):
        rigs.poses('AROUND', bpy.context.scene, depsgraph(), bounds, 2)


@pytest.mark.parametrize('engine', ENGINES)
def test_picture_depth_and_normals_of_a_ball(rigs, capture, engine):
    ball = scenes.sphere(segments=64, rings=32)
    scenes.material('Red', (0.8, 0.1, 0.05), ball)
    ball.data.polygons.foreach_set('use_smooth', [True] * len(ball.data.polygons))
    bpy.ops.object.light_add(type='SUN')
    bounds = rigs.bounds_of([ball], depsgraph())
    pose = rigs.poses('AROUND', bpy.context.scene, depsgraph(), bounds, 3)[0]
    settings = capture.CaptureSettings(engine=engine, size=64, samples=4)
    with capture.Capture(bpy.context, [ball], settings) as views:
        view = views.pose('a', pose)
    assert view.linear.shape == (64, 64, 4) and view.camera.width == 64
    # A sphere of radius 1 at this distance: the share of the picture, within the staircase of its edge.
    distance = pose.matrix.translation.length
    radius = view.camera.fx * math.tan(math.asin(1 / distance))
    covered = float((view.linear[..., 3] > 0.5).sum())
    assert abs(covered - math.pi * radius ** 2) < 2 * math.pi * radius
    if engine == 'WORKBENCH':  # no light that turns with the camera
        shown = view.linear[view.linear[..., 3] > 0.99]
        assert np.ptp(shown, axis=0).max() < 0.02
    assert abs(view.depth[32, 32] - (distance - 1)) < 0.02
    assert view.depth[0, 0] == 0
    known = view.depth > 0
    # Planar z of the ball's points is that of the ball: unprojected, they lie on it.
    y, x = np.nonzero(known)
    camera = view.camera
    points = np.stack([(x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy, np.ones(len(x))], 1)
    points = points * view.depth[known][:, None]
    matrix = np.array(list(camera.world_to_camera)).reshape(4, 4)
    world = (points - matrix[:3, 3]) @ matrix[:3, :3]
    lengths = np.linalg.norm(world, axis=1)
    assert np.median(np.abs(lengths - 1)) < 0.02
    if engine == 'WORKBENCH':
        assert view.normals is None
    else:
        middle = known & (view.normals ** 2).sum(axis=2).astype(bool)
        rows = middle[known]
        agreement = (view.normals[known][rows] * world[rows] / lengths[rows, None]).sum(axis=1)
        assert np.median(agreement) > 0.99


def test_views_leave_the_scene_as_it_was(rigs, capture):
    walls, ball = room()
    camera = scenes.camera(location=(0, -9, 0))
    scene = bpy.context.scene
    scene.render.resolution_percentage, scene.render.use_border = 50, True
    scene.render.image_settings.file_format = 'JPEG'
    owners = [scene.render, scene.render.image_settings, scene.cycles, scene.eevee, scene.display.shading, scene,
              bpy.context.view_layer, walls, ball]
    bounds = rigs.bounds_of([ball], depsgraph())
    pose = rigs.poses('AROUND', scene, depsgraph(), bounds, 3, angle=math.radians(60))[0]
    for engine in ENGINES:
        before, objects = [settings_of(o) for o in owners], set(bpy.data.objects)
        with capture.Capture(bpy.context, [ball], capture.CaptureSettings(engine=engine, size=16, samples=1)) as views:
            assert walls.hide_render
            views.pose('a', pose)
        assert [settings_of(o) for o in owners] == before
        assert set(bpy.data.objects) == objects and scene.camera == camera
        with pytest.raises(RuntimeError):
            with capture.Capture(bpy.context, [ball], capture.CaptureSettings(engine=engine, size=16)):
                raise RuntimeError('something fails between two views')
        assert [settings_of(o) for o in owners] == before


@pytest.mark.parametrize('engine', ENGINES)
def test_an_opaque_film_covers_every_pixel(rigs, capture, engine):
    ball = scenes.sphere()
    pose = rigs.poses('AROUND', bpy.context.scene, depsgraph(), rigs.bounds_of([ball], depsgraph()), 1)[0]
    settings = capture.CaptureSettings(engine=engine, size=16, samples=1, transparent=False)
    with capture.Capture(bpy.context, [ball], settings) as views:
        view = views.pose('a', pose)
    assert (view.linear[..., 3] == 1).all() and view.depth[0, 0] == 0 < view.depth[8, 8]


@pytest.mark.parametrize('engine', ENGINES)
def test_pictures_are_not_written_to_files(rigs, capture, engine, tmp_path, monkeypatch):
    """Where the system has memory with a path."""
    if not hasattr(os, 'memfd_create'):
        pytest.skip('this system has no memfd_create')
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path))
    ball = scenes.sphere()
    bounds = rigs.bounds_of([ball], depsgraph())
    opened = len(os.listdir('/proc/self/fd'))
    with capture.Capture(bpy.context, [ball], capture.CaptureSettings(engine=engine, size=16, samples=1)) as views:
        for i, pose in enumerate(rigs.poses('AROUND', bpy.context.scene, depsgraph(), bounds, 2)):
            assert views.pose(str(i), pose).linear[8, 8, 3] > 0.9
            assert not list(tmp_path.rglob('*.exr')) and not list(tmp_path.glob('stipple*'))
    assert len(os.listdir('/proc/self/fd')) <= opened + 1  # Blender keeps one of its own after a first render


def test_a_system_without_such_memory_gets_a_folder_that_is_removed(rigs, capture, tmp_path, monkeypatch):
    monkeypatch.delattr(os, 'memfd_create', raising=False)
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path))
    ball = scenes.sphere()
    pose = rigs.poses('AROUND', bpy.context.scene, depsgraph(), rigs.bounds_of([ball], depsgraph()), 2)[0]
    with capture.Capture(bpy.context, [ball], capture.CaptureSettings(engine='WORKBENCH', size=16)) as views:
        assert views.pose('a', pose).linear[8, 8, 3] > 0.9
        assert list(tmp_path.glob('stipple*'))
    assert not list(tmp_path.glob('stipple*'))


def test_scene_cameras_keep_their_proportions(capture):
    ball = scenes.sphere()
    camera = scenes.camera(location=(0, 0, 6), width=200, height=100)
    assert capture.scene_cameras(bpy.context.scene) == [camera]
    with capture.Capture(bpy.context, [ball], capture.CaptureSettings(engine='WORKBENCH', size=60)) as views:
        view = views.camera(camera)
    assert view.linear.shape == (30, 60, 4) and view.name == camera.name
    assert (view.camera.width, view.camera.height) == (60, 30)


@pytest.mark.parametrize('engine', ENGINES)
def test_what_moves_is_told_apart_whatever_the_camera_does(rigs, capture, engine):
    """Where a ball is that passes a standing one, exactly."""
    still, passing = scenes.sphere('Still'), scenes.sphere('Passing')
    still.location.x, passing.location.x = -1.5, 1.5
    camera = scenes.camera(location=(0.0, 0.0, 9.0), width=48, height=48)
    camera.data.type = 'PERSP'
    for frame in (1, 21):
        for owner, step in ((passing, 0.5), (camera, 2.0)):
            owner.location.y = (frame - 11) * step / 10
            owner.keyframe_insert('location', frame=frame)
        camera.data.lens = 50 + frame
        camera.data.keyframe_insert('lens', frame=frame)
    bpy.context.scene.frame_set(11)
    lenses = set(bpy.data.cameras)
    settings = capture.CaptureSettings(engine=engine, size=48, samples=16)
    with capture.Capture(bpy.context, [still, passing], settings) as views:
        before = views.camera(camera)
        seen = views.camera(camera, with_moving=True)
        after = views.camera(camera)
        assert set(bpy.data.cameras) - lenses == {views._camera.data}
    assert before.moving is None and after.moving is None
    np.testing.assert_array_equal(list(seen.camera.world_to_camera), list(before.camera.world_to_camera))
    assert seen.camera.fx == before.camera.fx
    np.testing.assert_allclose(seen.linear, before.linear, atol=1e-6)
    with capture.Capture(bpy.context, [passing], settings) as views:
        alone = views.camera(camera).linear[..., 3]
    if engine == 'WORKBENCH' or engine == 'EEVEE' and bpy.app.version < (4, 2, 0):  # they have no such pass
        assert seen.moving is None
        return
    assert seen.moving[alone > 0.99].all() and alone[alone > 0.99].size > 50
    assert not seen.moving[alone == 0].any()


def test_messages(capture, stipple):
    error = stipple.binding.errors.StippleError
    with pytest.raises(error, match="Engine is 'LUX'; allowed are CYCLES, EEVEE, WORKBENCH"):
        capture.Capture(bpy.context, [], capture.CaptureSettings(engine='LUX'))
    camera = scenes.camera()
    camera.data.type = 'PANO'
    assert capture.scene_cameras(bpy.context.scene) == []
    with capture.Capture(bpy.context, [], capture.CaptureSettings(engine='WORKBENCH', size=16)) as views:
        with pytest.raises(error, match='PANO'):
            views.camera(camera)


def test_layers_of_a_broken_file(capture, stipple, tmp_path, monkeypatch):
    """What cannot be read is said, with the file's own reason."""
    path = tmp_path / 'a.exr'
    monkeypatch.setattr(capture, '_picture_path', lambda stack: str(path))
    with capture.Capture(bpy.context, [scenes.sphere()], capture.CaptureSettings(engine='WORKBENCH', size=16)) as views:
        path.write_bytes(b'12345678')
        with pytest.raises(stipple.binding.errors.StippleError, match='A rendered view cannot be read: .*a.exr'):
            views._read_file()
