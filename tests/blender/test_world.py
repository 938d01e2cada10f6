# SPDX-License-Identifier: GPL-3.0-or-later
"""The world behind splats under the engine Stipple, against images of it by Cycles with the same camera."""

import bpy
import numpy as np
import pytest

import scenes
from shots import prepare, set_panorama, set_world, splat_wall

SAMPLES = 8  # cycles_world.SAMPLES: with as many, Cycles itself has the same random numbers
# Bits of one sum, times colours of 1.
ROUNDING = 2e-6

CAMERAS = {
    'perspective': dict(lens=24),
    'orthographic': dict(type='ORTHO', ortho_scale=3.0),
    'equirectangular': dict(type='PANO', panorama_type='EQUIRECTANGULAR'),
    'equidistant': dict(type='PANO', panorama_type='FISHEYE_EQUIDISTANT', fisheye_fov=3.0),
    'equisolid': dict(type='PANO', panorama_type='FISHEYE_EQUISOLID', fisheye_lens=8.0, fisheye_fov=3.0),
    'shifted': dict(lens=35, shift_x=0.2, shift_y=-0.1, sensor_fit='VERTICAL'),
}


def look(stipple, name='perspective', width=96, height=64):
    settings = dict(CAMERAS[name])
    panorama = {key: settings.pop(key) for key in list(settings) if key.startswith(('panorama', 'fisheye'))}
    camera = scenes.camera((1.0, -2.0, 0.5), (1.2, 0.1, 0.4), width=width, height=height, **settings)
    for key, value in panorama.items():
        setattr(stipple.version.panorama_settings(camera.data), key, value)
    return camera


def both(tmp_path, samples=SAMPLES):
    """(by Cycles, by Stipple)"""
    scene = prepare('CYCLES', False, samples)
    expected = scenes.render_pixels(tmp_path, 'cycles')
    scene.render.engine = 'STIPPLE'
    return expected, scenes.render_pixels(tmp_path, 'stipple')


def psnr(a, b):
    return -10 * np.log10(((a - b)[..., :3] ** 2).mean())


def gradient():
    """Nodes without an image, and a strength that they set."""
    node = set_world((1.0, 1.0, 1.0))
    tree = node.id_data
    texture, ramp = tree.nodes.new('ShaderNodeTexGradient'), tree.nodes.new('ShaderNodeValToRGB')
    ramp.color_ramp.elements[0].color, ramp.color_ramp.elements[1].color = (0.9, 0.3, 0.1, 1.0), (0.1, 0.2, 0.9, 1.0)
    tree.links.new(tree.nodes.new('ShaderNodeTexCoord').outputs['Generated'], texture.inputs[0])
    tree.links.new(texture.outputs['Fac'], ramp.inputs['Fac'])
    tree.links.new(ramp.outputs['Color'], node.inputs['Color'])
    tree.links.new(texture.outputs['Fac'], node.inputs['Strength'])


def mixed():
    """Another colour for the camera than for everything else, by a node group."""
    node = set_world((1.0, 0.0, 0.0))
    tree = node.id_data
    mix, seen = tree.nodes.new('ShaderNodeMixShader'), tree.nodes.new('ShaderNodeBackground')
    seen.inputs['Color'].default_value = (0.1, 0.5, 0.25, 1.0)
    tree.links.new(tree.nodes.new('ShaderNodeLightPath').outputs['Is Camera Ray'], mix.inputs[0])
    tree.links.new(node.outputs[0], mix.inputs[1])
    tree.links.new(seen.outputs[0], mix.inputs[2])
    output = next(n for n in tree.nodes if n.type == 'OUTPUT_WORLD')
    tree.links.new(mix.outputs[0], output.inputs['Surface'])


@pytest.mark.parametrize('name', CAMERAS)
def test_an_environment_is_that_of_cycles_by_every_lens(stipple, tmp_path, name):
    look(stipple, name)
    set_panorama()
    expected, seen = both(tmp_path)
    if name != 'orthographic':  # which sees one direction
        assert np.ptp(expected[..., 0]) > 0.2 and np.ptp(expected[..., 2]) > 0.2
    inside = expected[..., 3] > 0  # a fisheye's circle
    assert inside.mean() > 0.5
    np.testing.assert_allclose(seen[inside], expected[inside], atol=ROUNDING)
    np.testing.assert_allclose(seen[~inside][..., :3], 0.0, atol=ROUNDING)


@pytest.mark.parametrize('make', [gradient, mixed])
def test_every_node_tree_is_evaluated(stipple, tmp_path, make):
    look(stipple)
    make()
    expected, seen = both(tmp_path)
    assert np.ptp(expected[..., :3]) > 0.1 or expected[0, 0, 1] > 0.4
    np.testing.assert_allclose(seen, expected, atol=ROUNDING)


def test_few_samples_are_enough(stipple, tmp_path):
    """Against 512 samples, of a chequerboard: a pixel of an edge is off by 1/2 / sqrt(8) at most, and two of ten pixels
    are at an edge, which is 22 dB."""
    look(stipple)
    pixels = np.ones((128, 256, 4), np.float32)
    pixels[..., :3] = ((np.arange(256)[None, :, None] // 16 + np.arange(128)[:, None, None] // 16) % 2)
    set_panorama(pixels=pixels)
    expected, seen = both(tmp_path, 512)
    assert 0.5 < expected[..., 0].max() and psnr(seen, expected) > 22 + 20 * np.log10(1 / 0.8)
    assert np.abs(seen - expected).mean() < 0.03


def test_splats_are_before_it_and_the_film_can_be_transparent(stipple, tmp_path):
    camera = scenes.camera((0, 0, 6), width=60, height=60)
    camera.data.lens = 60
    splat_wall(stipple, 'half', 0.0, opacity=0.2, count=20)
    set_panorama()
    expected, over = both(tmp_path)
    scene = bpy.context.scene
    scene.stipple.splat_color = 'SCENE_LINEAR'
    over = scenes.render_pixels(tmp_path, 'over')
    scene.render.film_transparent = True
    alone = scenes.render_pixels(tmp_path, 'alone')
    assert alone[2, 2, 3] == 0 and 0.3 < alone[30, 30, 3] < 0.98 and (over[..., 3] == 1).all()
    scene.render.engine, bpy.data.objects['half'].hide_render, scene.render.film_transparent = 'CYCLES', True, False
    world = scenes.render_pixels(tmp_path, 'world')
    np.testing.assert_allclose(over[..., :3], alone[..., :3] + (1 - alone[..., 3:]) * world[..., :3], atol=1e-5)


def test_one_colour_is_the_same_by_nodes_and_without(stipple, tmp_path):
    """As trained too, where splats are composited over it in display space; and plain colours need no Cycles."""
    scenes.camera((0, 0, 6), width=60, height=60, type='ORTHO', ortho_scale=3.0)
    splat_wall(stipple, 'half', 0.0, opacity=0.2, count=20)
    node = set_world((0.2, 0.4, 0.8))
    prepare('STIPPLE', False)
    expected = scenes.render_pixels(tmp_path, 'plain')
    colour = node.id_data.nodes.new('ShaderNodeRGB')
    colour.outputs[0].default_value = (0.2, 0.4, 0.8, 1.0)
    node.id_data.links.new(colour.outputs[0], node.inputs['Color'])
    np.testing.assert_allclose(scenes.render_pixels(tmp_path, 'nodes'), expected, atol=1e-5)


def test_meshes_as_mattes_leave_holes_in_it(stipple, tmp_path):
    look(stipple)
    set_panorama()
    ball = scenes.sphere(radius=0.5)
    expected, _ = both(tmp_path)
    scene = bpy.context.scene
    seen = scenes.render_pixels(tmp_path, 'matte')
    hole = seen[..., 3] == 0
    assert hole.any() and not seen[hole].any()
    # Nothing of the ball itself, nor of its light or shadow.
    scene.stipple.meshes_as_mattes = False
    whole = scenes.render_pixels(tmp_path, 'whole')
    ball.hide_render, scene.render.engine = True, 'CYCLES'
    np.testing.assert_allclose(whole, scenes.render_pixels(tmp_path, 'bare'), atol=ROUNDING)
    assert ball.visible_camera and ball.visible_shadow


def test_plain_worlds_and_transparent_films_need_no_cycles(stipple, tmp_path, monkeypatch):
    look(stipple)
    made = []
    monkeypatch.setattr(stipple.cycles_world, 'image', lambda *_: made.append(True))
    set_world((0.2, 0.4, 0.8))
    prepare('STIPPLE', False)
    np.testing.assert_allclose(scenes.render_pixels(tmp_path, 'plain')[5, 5], (0.2, 0.4, 0.8, 1.0), atol=1e-6)
    set_panorama()
    bpy.context.scene.render.film_transparent = True
    assert not scenes.render_pixels(tmp_path, 'film').any()
    assert not made
    bpy.context.scene.render.film_transparent = False
    bpy.ops.render.render()
    assert made


def test_border_layers_and_passes(stipple, tmp_path):
    """The world's image is of the border alone, and leaves the depth to the splats."""
    look(stipple)
    set_panorama()
    scene = prepare('STIPPLE', False)
    bpy.context.view_layer.use_pass_z = True
    scene.view_layers.new('second').samples = 3
    whole = scenes.render_pixels(tmp_path, 'whole')
    render = scene.render
    render.use_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.75, 0.25, 0.5
    part = scenes.render_pixels(tmp_path, 'part')
    # Other places in the pixels, as Cycles itself has them in a border.
    np.testing.assert_allclose(part[16:32, 24:72], whole[16:32, 24:72], atol=0.02)
    assert not part[:16].any() and not part[:, :24].any()


def test_a_lens_blurs_it(stipple, tmp_path):
    """A world is at infinity: out of focus, by the camera's aperture, with more samples than when all is sharp."""
    camera = look(stipple)
    set_panorama()
    camera.data.dof.use_dof, camera.data.dof.focus_distance, camera.data.dof.aperture_fstop = True, 0.2, 0.1
    expected, seen = both(tmp_path, 32)
    np.testing.assert_allclose(seen, expected, atol=ROUNDING)
    camera.data.dof.use_dof = False
    assert np.abs(scenes.render_pixels(tmp_path, 'sharp') - seen).max() > 0.02


def test_an_animation_turns_it(stipple, tmp_path):
    look(stipple)
    node = set_panorama(rotation=(0.0, 0.0, 0.0))
    place = next(n for n in node.id_data.nodes if n.type == 'MAPPING')
    for frame, angle in ((1, 0.0), (2, 1.5)):
        place.inputs['Rotation'].default_value[2] = angle
        place.inputs['Rotation'].keyframe_insert('default_value', index=2, frame=frame)
    scene = prepare('STIPPLE', False)
    scene.frame_start, scene.frame_end = 1, 2
    expected = []
    for frame in (1, 2):
        scene.frame_set(frame)
        expected.append(scenes.render_pixels(tmp_path, f'one{frame}'))
    assert np.abs(expected[0] - expected[1]).max() > 0.1
    scene.render.filepath = str(tmp_path / 'frame_')
    bpy.ops.render.render(animation=True)
    for frame in (1, 2):
        np.testing.assert_array_equal(scenes.picture_pixels(tmp_path / f'frame_{frame:04d}.exr'), expected[frame - 1])
