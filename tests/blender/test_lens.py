# SPDX-License-Identifier: GPL-3.0-or-later
"""Lenses, shutters, panoramas and passes of splats, beside those of a mesh ball that Cycles draws."""

import bpy
import numpy as np
import pytest

import scenes
from shots import MESH, emission, mesh_between, prepare

RADIUS = 0.35


def splat_ball(stipple, radius=RADIUS, colour=MESH, count=6000):
    """An opaque ball: small splats, evenly over it, flat on it; their soft rims reach as far as the radius."""
    i = np.arange(count)
    z = 1 - (2 * i + 1) / count
    phi = i * 2.399963229728653
    across = np.sqrt(1 - z * z)
    normals = np.stack([across * np.cos(phi), across * np.sin(phi), z], axis=1)
    # The rotation from z to the normal: half way, as a quaternion.
    rotations = np.stack([1 + normals[:, 2], -normals[:, 1], normals[:, 0], np.zeros(count)], axis=1)
    rotations /= np.linalg.norm(rotations, axis=1)[:, None]
    size = 1.2 * radius * np.sqrt(4 * np.pi / count)
    display = 1.055 * np.array(colour) ** (1 / 2.4) - 0.055
    arrays = stipple.binding.cloud.SplatArrays(
        (0.95 * radius * normals).astype(np.float32), rotations.astype(np.float32),
        np.tile(np.float32([size, size, size / 20]), (count, 1)), np.full(count, 0.98, np.float32),
        np.tile(((display - 0.5) / 0.28209479177387814).astype(np.float32), (count, 1))[:, None, :])
    data = stipple.scene.source.splat_data.new_data('ball')
    stipple.scene.source.splat_data.write(data, arrays)
    return scenes.link(bpy.data.objects.new('ball', data))


def mesh_ball(radius=RADIUS):
    ball = scenes.sphere('mesh ball', segments=48, rings=24, radius=radius)
    emission(ball)
    return ball


def both(stipple, tmp_path, place, samples=128):
    """(Stipple's picture of the ball of splats, Cycles' of the mesh ball): each is `place`d alone."""
    found = []
    for engine, make in (('STIPPLE', splat_ball), ('CYCLES', lambda _: mesh_ball())):
        ball = make(stipple)
        place(ball)
        scene = prepare(engine, samples=samples)
        scene.stipple.splat_color = 'SCENE_LINEAR'
        scene.frame_set(scene.frame_current)
        found.append(scenes.render_pixels(tmp_path, engine))
        bpy.data.objects.remove(ball)
    return found


def spread(alpha):
    """(mean x, mean y, standard deviation along x and y) of what an alpha [H,W] shows."""
    y, x = np.mgrid[:alpha.shape[0], :alpha.shape[1]]
    total = alpha.sum()
    mx, my = (alpha * x).sum() / total, (alpha * y).sum() / total
    return np.array([mx, my, np.sqrt((alpha * (x - mx) ** 2).sum() / total),
                     np.sqrt((alpha * (y - my) ** 2).sum() / total)])


def is_alike(pictures, share=0.06, size=0.35):
    """Pictures of the two balls. What is left: splats' soft rims, and Cycles' noise, of which blocks of 4 x 4 pixels
    have a quarter."""
    ours, theirs = (picture[..., 3] for picture in pictures)
    np.testing.assert_allclose(spread(ours), spread(theirs), atol=size)
    height, width = ours.shape
    one, other = (a.reshape(height // 4, 4, width // 4, 4).mean(axis=(1, 3)) for a in (ours, theirs))
    differs = np.abs(one - other).sum() / other.sum()
    print(f'differs by {differs:.3f}; {spread(ours)} and {spread(theirs)}')
    assert differs < share


def test_a_sharp_ball_is_cycles_ball(stipple, tmp_path):
    """What the other comparisons start from."""
    scenes.camera((0, 0, 4), width=80, height=60, lens=50.0)
    is_alike(both(stipple, tmp_path, lambda ball: None))


@pytest.mark.parametrize('setting', [{}, {'aperture_blades': 3, 'aperture_rotation': 0.4}, {'aperture_ratio': 2.5}],
                         ids=['round', 'blades', 'ratio'])
def test_depth_of_field_is_cycles(stipple, tmp_path, setting):
    camera = scenes.camera((0, 0, 4), width=80, height=60, lens=50.0)
    dof = camera.data.dof
    dof.use_dof, dof.focus_distance, dof.aperture_fstop = True, 2.0, 0.06
    for name, value in setting.items():
        setattr(dof, name, value)
    pictures = both(stipple, tmp_path, lambda ball: None, samples=1024)
    is_alike(pictures)
    # The sharp ball's is 4.9.
    assert spread(pictures[0][..., 3])[3] > 6.0


def test_the_focus_follows_its_object(stipple, tmp_path):
    camera = scenes.camera((0, 0, 4), width=80, height=60, lens=50.0)
    ball = splat_ball(stipple)
    sharp = scenes.render_pixels(tmp_path, 'sharp') if prepare('STIPPLE') else None
    camera.data.dof.use_dof, camera.data.dof.aperture_fstop, camera.data.dof.focus_distance = True, 0.06, 1.0
    blurred = scenes.render_pixels(tmp_path, 'blurred')
    camera.data.dof.focus_object = ball
    focused = scenes.render_pixels(tmp_path, 'focused')
    far = np.abs(blurred - sharp).mean()
    assert far > 0.05 and np.abs(focused - sharp).mean() < far / 4


@pytest.mark.parametrize('position', ['START', 'CENTER', 'END'])
@pytest.mark.parametrize('mover', ['object', 'camera'])
def test_motion_blur_is_cycles(stipple, tmp_path, position, mover):
    camera = scenes.camera((0, 0, 4), width=80, height=60, lens=50.0)
    scene = bpy.context.scene
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
    owner = scene.render if hasattr(scene.render, 'motion_blur_position') else scene.cycles
    owner.motion_blur_position = position
    scene.frame_set(3)

    def place(ball):
        moved = ball if mover == 'object' else camera
        moved.animation_data_clear()
        for frame, x in ((2, -0.6), (4, 0.6)):
            moved.location.x = x
            moved.keyframe_insert('location', frame=frame)
        for curve in curves_of(moved):
            for point in curve.keyframe_points:
                point.interpolation = 'LINEAR'

    pictures = both(stipple, tmp_path, place)
    is_alike(pictures)
    # 0.6 metres in a shutter are 13 pixels, evenly: 13 / sqrt(12), beside the ball's own 3.9.
    assert spread(pictures[0][..., 3])[2] > 5.0


def curves_of(obj):
    action = obj.animation_data.action
    if hasattr(action, 'fcurves'):
        return list(action.fcurves)
    return [curve for layer in action.layers for strip in layer.strips for bag in strip.channelbags
            for curve in bag.fcurves]


@pytest.mark.parametrize('kind, settings', [
    ('EQUIRECTANGULAR', {}), ('EQUIRECTANGULAR', {'longitude_min': -1.0, 'longitude_max': 1.5, 'latitude_min': -0.8,
                                                   'latitude_max': 1.2}),
    ('FISHEYE_EQUIDISTANT', {'fisheye_fov': 3.5}), ('FISHEYE_EQUISOLID', {'fisheye_fov': 3.0, 'fisheye_lens': 12.0})])
def test_panoramas_are_cycles(stipple, tmp_path, kind, settings):
    """A ball to the upper right of the view, in a picture that is no square."""
    camera = scenes.camera((0, 0, 0), width=96, height=64, type='PANO')
    owner = stipple.version.panorama_settings(camera.data)
    owner.panorama_type = kind
    for name, value in settings.items():
        setattr(owner, name, value)
    def place(ball):
        ball.location, ball.scale = (0.7, 0.5, -1.2), (2.0, 2.0, 2.0)

    pictures = both(stipple, tmp_path, place, samples=32)
    if kind.startswith('FISHEYE'):
        # Beyond the circle Cycles' film is black, and not transparent.
        y, x = np.mgrid[:64, :96]
        if kind == 'FISHEYE_EQUIDISTANT':
            beyond = np.hypot((x + 0.5) / 48 - 1, (y + 0.5) / 32 - 1) > 0.98
        else:
            beyond = np.hypot(x + 0.5 - 48, y + 0.5 - 32) * 36 / 96 > 0.98 * 2 * 12 * np.sin(0.75)
        for picture in pictures:
            picture[beyond] = 0.0
    assert pictures[0][..., 3].sum() > 100
    is_alike(pictures, share=0.1)


def test_panoramas_without_a_model_are_one_error(stipple, tmp_path):
    camera = scenes.camera((0, 0, 0), width=32, height=32, type='PANO')
    splat_ball(stipple)
    owner = stipple.version.panorama_settings(camera.data)
    owner.panorama_type = 'MIRRORBALL'
    for engine in ('STIPPLE', 'STIPPLE_CYCLES'):
        prepare(engine)
        scenes.refuses(lambda: scenes.render_pixels(tmp_path), 'of type MIRRORBALL; allowed are EQUIRECTANGULAR')
    owner.panorama_type, owner.fisheye_fov = 'FISHEYE_EQUIDISTANT', np.radians(400)
    scenes.refuses(lambda: scenes.render_pixels(tmp_path), 'field of view of 400 degrees; at most 360')


@pytest.mark.parametrize('effect', ['lens', 'shutter', 'panorama'])
def test_both_engines_have_the_effects_alike(stipple, tmp_path, effect):
    camera = scenes.camera((0, 0, 4), width=60, height=60, lens=50.0)
    scene = bpy.context.scene
    ball = splat_ball(stipple)
    if effect == 'lens':
        camera.data.dof.use_dof, camera.data.dof.aperture_fstop, camera.data.dof.focus_distance = True, 0.1, 2.0
    elif effect == 'shutter':
        scene.render.use_motion_blur = True
        for frame, x in ((1, 0.0), (3, 1.0)):
            ball.location.x = x
            ball.keyframe_insert('location', frame=frame)
        scene.frame_set(2)
    else:
        camera.data.type = 'PANO'
        stipple.version.panorama_settings(camera.data).panorama_type = 'EQUIRECTANGULAR'
    found = []
    for engine in ('STIPPLE', 'STIPPLE_CYCLES'):
        prepare(engine)
        found.append(scenes.render_pixels(tmp_path, engine))
    assert found[0][..., 3].max() > 0.3
    np.testing.assert_allclose(found[1], found[0], atol=5e-6)


def noted_passes(stipple, monkeypatch):
    found, fill = {}, stipple.version.fill_pass

    def note(render_pass, array):
        found[render_pass.name] = np.array(array)
        fill(render_pass, array)

    monkeypatch.setattr(stipple.version, 'fill_pass', note)
    return found


@pytest.mark.parametrize('engine', ['STIPPLE', 'STIPPLE_CYCLES'])
def test_normals_and_indices_of_splats_and_meshes(stipple, tmp_path, monkeypatch, engine):
    """Splats with index 7 to the left before a quad with 3, over splats with 5."""
    scenes.camera((0, 0, 6), width=60, height=60, type='ORTHO', ortho_scale=3.0)
    quad = mesh_between(stipple)
    quad.pass_index = 3
    bpy.data.objects['front'].pass_index, bpy.data.objects['behind'].pass_index = 7, 5
    prepare(engine)
    layer = bpy.context.view_layer
    layer.use_pass_normal = layer.use_pass_object_index = layer.use_pass_z = True
    found = noted_passes(stipple, monkeypatch)
    bpy.ops.render.render()
    index, normal = found[stipple.version.OBJECT_INDEX_PASS].reshape(60, 60), found['Normal'].reshape(60, 60, 3)
    assert index[30, 25] == 7 and index[30, 45] == 5 and index[3, 3] == 0
    assert index[30, 35] == (3 if engine == 'STIPPLE_CYCLES' else 0)
    for x in (25, 45) + ((35,) if engine == 'STIPPLE_CYCLES' else ()):
        np.testing.assert_allclose(normal[30, x], (0, 0, 1), atol=1e-3)
    np.testing.assert_array_equal(normal[3, 3], 0.0)
