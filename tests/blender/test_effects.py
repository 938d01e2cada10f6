# SPDX-License-Identifier: GPL-3.0-or-later
"""Which effects a picture has, why, and what they cost."""

import importlib

import bpy
import numpy as np
import pytest

import scenes
from shots import camera, mesh_between, prepare  # noqa: F401


def module(stipple, name):
    return importlib.import_module(f'{stipple.__name__}.{name}')


def plan_of(stipple):
    """{name: row} of the open scene, as its panel shows it."""
    effects, context = module(stipple, 'scene.effects'), bpy.context
    rows = effects.plan(module(stipple, 'scene.sources').context().library, context.scene, context.view_layer,
                        context.evaluated_depsgraph_get(), effects.look_of(context.scene))
    return {row.effect.name: row for row in rows}


def active(stipple):
    return {name for name, row in plan_of(stipple).items() if row.is_on}


@pytest.fixture
def shot(stipple, camera):
    module(stipple, 'scene.effects').forget()
    mesh_between(stipple)
    scene = prepare('STIPPLE', transparent=False)
    scene.stipple.zoom_antialiasing = 'OFF'  # these splats are smaller than pixels
    return scene


def test_blenders_own_switches_are_followed(stipple, shot, camera):
    bpy.ops.stipple.effects_look()
    assert active(stipple) == {'MESH_OCCLUSION'}
    shot.render.film_transparent = True
    layer = bpy.context.view_layer
    layer.use_pass_z = layer.use_pass_normal = layer.use_pass_object_index = True
    camera.data.dof.use_dof = True
    shot.render.use_motion_blur = True
    assert active(stipple) == {'MESH_OCCLUSION', 'TRANSPARENT_FILM', 'DEPTH_PASS', 'NORMAL_PASS', 'OBJECT_INDEX_PASS',
                               'DEPTH_OF_FIELD'}
    assert 'nothing moves' in plan_of(stipple)['MOTION_BLUR'].reason
    shot.stipple.meshes_as_mattes = False
    bpy.ops.stipple.effects_look()
    assert 'MESH_OCCLUSION' not in active(stipple)


def test_motion_is_found_at_sub_frames(stipple, shot, camera):
    shot.render.use_motion_blur = True
    front = bpy.data.objects['front']
    for frame, x in ((1, 0.0), (5, 2.0)):
        front.location.x = x
        front.keyframe_insert('location', frame=frame)
    shot.frame_set(2)
    x = front.location.x
    bpy.ops.stipple.effects_look()
    rows = plan_of(stipple)
    assert rows['MOTION_BLUR'].is_on and rows['MOTION'].reason == '1 splat object moves while the shutter is open'
    assert shot.frame_current == 2 and front.location.x == x and shot.frame_subframe == 0.0
    front.cycles.use_motion_blur = False
    bpy.ops.stipple.effects_look()
    assert not plan_of(stipple)['MOTION'].is_on
    camera.location.x = 0.0
    camera.keyframe_insert('location', frame=1)
    camera.location.x = 1.0
    camera.keyframe_insert('location', frame=5)
    bpy.ops.stipple.effects_look()
    assert plan_of(stipple)['MOTION'].reason == 'The camera moves while the shutter is open'


@pytest.mark.parametrize('position, expected', [('START', [10, 10.25, 10.5]), ('CENTER', [9.75, 10, 10.25]),
                                                ('END', [9.5, 9.75, 10])])
def test_the_shutter_is_open_when_blender_says(stipple, shot, position, expected):
    motion = module(stipple, 'scene.motion')
    owner = shot.render if hasattr(shot.render, 'motion_blur_position') else shot.cycles
    owner.motion_blur_position, shot.render.motion_blur_shutter = position, 0.5
    shot.frame_set(10)
    assert motion.times(shot, 3) == expected


def test_lenses_are_blenders(stipple, shot, camera):
    lenses = module(stipple, 'scene.lenses')
    data = camera.data
    data.type, data.lens = 'PERSP', 50.0
    dof = data.dof
    dof.use_dof, dof.aperture_fstop, dof.focus_distance, dof.aperture_blades, dof.aperture_ratio = True, 2.5, 3.0, 5, 2.0
    lens = lenses.lens_of(camera, bpy.context.evaluated_depsgraph_get())
    assert (lens.aperture_radius, lens.focus_distance, lens.blades, lens.ratio) == (pytest.approx(0.01), 3.0, 5, 2.0)
    target = scenes.link(bpy.data.objects.new('target', None))
    target.location = (5.0, 1.0, 2.0)  # four metres before the camera, to its side
    dof.focus_object, dof.aperture_blades = target, 2
    bpy.context.view_layer.update()
    lens = lenses.lens_of(camera, bpy.context.evaluated_depsgraph_get())
    assert lens.focus_distance == pytest.approx(4.0) and lens.blades == 0
    dof.use_dof = False
    assert lenses.lens_of(camera, bpy.context.evaluated_depsgraph_get()) is None


def test_choices_change_the_picture(stipple, shot, camera, tmp_path):
    """Splats that are red from one side and blue from the other, smaller than pixels."""
    settings = shot.stipple
    front = bpy.data.objects['front']
    arrays = stipple.scene.splat_data.read(front.data)
    sh = np.zeros((arrays.count, 4, 3), np.float32)
    sh[:, 0], sh[:, 2, 0] = arrays.sh[:, 0], 0.8  # along z
    arrays.sh = sh
    stipple.scene.splat_data.write(front.data, arrays)
    auto = scenes.render_pixels(tmp_path, 'auto')
    assert 'carry 100.0 % of the change' in plan_of(stipple)['VIEW_COLOUR'].reason
    settings.view_color = 'OFF'
    assert np.abs(scenes.render_pixels(tmp_path, 'off') - auto).max() > 0.05
    settings.view_color = 'ON'
    np.testing.assert_array_equal(scenes.render_pixels(tmp_path, 'on'), auto)
    settings.zoom_antialiasing = 'OFF'
    plain = scenes.render_pixels(tmp_path, 'plain')
    settings.zoom_antialiasing = 'ON'
    assert np.abs(scenes.render_pixels(tmp_path, 'mip') - plain).max() > 1e-3
    settings.zoom_antialiasing, camera.data.type = 'OFF', 'PERSP'
    settings.exact_projection = 'OFF'
    affine = scenes.render_pixels(tmp_path, 'affine')
    settings.exact_projection = 'ON'
    assert 0 < np.abs(scenes.render_pixels(tmp_path, 'rays') - affine).mean() < 0.02


def test_costs_are_measured_for_active_effects_alone(stipple, shot):
    effects = module(stipple, 'scene.effects')
    bpy.context.view_layer.use_pass_z = True
    assert not any(row.is_measured for row in plan_of(stipple).values())
    assert bpy.ops.stipple.effects_measure() == {'FINISHED'}
    measured = {name for name, row in plan_of(stipple).items() if row.is_measured}
    assert measured == {'MESH_OCCLUSION', 'DEPTH_PASS'}
    assert abs(plan_of(stipple)['DEPTH_PASS'].seconds) < 10
    seen = effects.look_of(shot)
    assert effects.is_current(shot, seen)
    shot.stipple.quality_render.level = 'DRAFT'
    assert not effects.is_current(shot, seen)


def test_settings_can_be_shown(shot, camera):
    assert bpy.ops.stipple.show_setting(tab='DATA') == {'FINISHED'}
    assert bpy.context.view_layer.objects.active == camera
    shot.camera = None
    scenes.refuses(lambda: bpy.ops.stipple.show_setting(tab='DATA'), 'no camera')
