# SPDX-License-Identifier: GPL-3.0-or-later
"""Colour grades: what attributes, pictures and files show, and that the splats themselves stay."""

import os
import subprocess

import bpy
import numpy as np
import pytest

import scenes

C0 = 0.28209479177387814


@pytest.fixture
def splats(tmp_path):
    """A red quad of 400 splats under a camera, with its source beside the saved file."""
    quad = scenes.quad()
    scenes.material('red', (0.5, 0.2, 0.1), quad)
    scenes.camera((0, 0, 6), width=32, height=32)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    obj = scenes.make_splats(quad, anchors=400)
    quad.hide_render = quad.hide_viewport = True
    bpy.context.scene.render.engine = 'STIPPLE'
    bpy.context.scene.render.film_transparent = True
    return obj


def colours(stipple, obj):
    """(display colours [N,3], opacities [N]) as the attributes show them."""
    arrays = stipple.scene.source.splat_data.read(obj.data)
    return arrays.sh[:, 0] * C0 + 0.5, arrays.opacities


def brighter(display, stops):
    light = ((display + 0.055) / 1.055) ** 2.4
    return 1.055 * (light * 2.0 ** stops) ** (1 / 2.4) - 0.055


def test_attributes_carry_the_grade_and_lose_it_again(splats, stipple):
    before, opacity = colours(stipple, splats)
    settings = splats.data.stipple
    settings.exposure = 1.0
    seen, _ = colours(stipple, splats)
    # float32 harmonics, of about 1, in and out.
    np.testing.assert_allclose(seen, brighter(before, 1.0), atol=1e-6)
    settings.exposure = 0.0
    settings.saturation = 0.0
    grey, _ = colours(stipple, splats)
    luma = before @ (0.2126, 0.7152, 0.0722)
    np.testing.assert_allclose(grey, np.repeat(luma[:, None], 3, 1), atol=1e-6)
    settings.saturation = 1.0
    settings.grade_opacity = 0.25
    np.testing.assert_allclose(colours(stipple, splats)[1], opacity * 0.25, rtol=1e-6)
    settings.grade_opacity = 1.0
    after, opacity_after = colours(stipple, splats)
    np.testing.assert_array_equal(after, before)
    np.testing.assert_array_equal(opacity_after, opacity)
    assert not settings.edited and not stipple.scene.source.sync.is_edited(splats.data)
    assert [a.name for a in splats.data.attributes if a.name.startswith('ungraded')] == []


def test_tint_is_a_factor_of_light(splats, stipple):
    before, _ = colours(stipple, splats)
    splats.data.stipple.tint = (1.0, 0.5, 0.25)
    seen, _ = colours(stipple, splats)
    expected = np.stack([brighter(before[:, i], stops) for i, stops in enumerate((0.0, -1.0, -2.0))], 1)
    np.testing.assert_allclose(seen, expected, atol=1e-6)


def test_budget_and_grade_change_together(splats, stipple):
    settings = splats.data.stipple
    settings.exposure = 0.5
    settings.anchors = 250
    graded, _ = colours(stipple, splats)
    assert len(graded) == 250
    settings.exposure = 0.0
    np.testing.assert_allclose(graded, brighter(colours(stipple, splats)[0], 0.5), atol=1e-6)


def test_engine_shows_the_grade_that_cycles_finds(splats, stipple, tmp_path):
    plain = scenes.render_pixels(tmp_path, 'plain')[16, 16]
    splats.data.stipple.exposure = 1.0
    graded = scenes.render_pixels(tmp_path, 'graded')[16, 16]
    # Opaque splats of one colour: light doubles, up to the few splats behind the first.
    np.testing.assert_allclose(graded[:3], 2 * plain[:3], rtol=0.02)
    # A CLOUD source is drawn from attributes: as decoded splats.
    bpy.ops.stipple.use_as_new_source()
    assert splats.data.stipple.exposure == 1.0
    np.testing.assert_allclose(scenes.render_pixels(tmp_path, 'cloud')[16, 16], graded, atol=1e-5)


def test_edited_splats_take_a_grade_and_stay_edited(splats, stipple):
    before, _ = colours(stipple, splats)
    if isinstance(splats.data, bpy.types.Mesh):
        splats.data.vertices[0].co.x += 0.5
    else:
        splats.data.attributes['position'].data[0].vector[0] += 0.5
    assert stipple.scene.source.sync.is_edited(splats.data)
    splats.data.stipple.exposure = 1.0
    np.testing.assert_allclose(colours(stipple, splats)[0], brighter(before, 1.0), atol=1e-6)
    assert stipple.scene.source.sync.is_edited(splats.data)
    splats.data.stipple.anchors = 300  # refused: it would drop the edit
    assert splats.data.stipple.edited
    splats.data.stipple.exposure = 0.0
    np.testing.assert_array_equal(colours(stipple, splats)[0], before)


def test_colours_painted_over_a_grade_are_not_lost(splats, stipple):
    splats.data.stipple.exposure = 1.0
    base = splats.data.attributes['radiance:base'].data
    field = stipple.version.ATTRIBUTE_FIELDS[splats.data.attributes['radiance:base'].data_type]
    setattr(base[0], field, (0.3, 0.2, 0.1, 0.5))
    splats.data.stipple.exposure = 2.0
    assert 'edited by hand under a grade' in stipple.scene.source.sync.problems[splats.data.name]
    painted, _ = colours(stipple, splats)
    np.testing.assert_allclose(painted[0], np.array((0.3, 0.2, 0.1)) * C0 + 0.5, atol=1e-6)
    scenes.select(splats)
    bpy.ops.stipple.use_as_new_source()
    assert splats.data.stipple.exposure == 0.0
    np.testing.assert_array_equal(colours(stipple, splats)[0], painted)


def test_export_bakes_the_grade_by_choice(splats, stipple, tmp_path):
    before, opacity = colours(stipple, splats)
    splats.data.stipple.exposure = 1.0
    splats.data.stipple.grade_opacity = 0.5
    from stipple.binding.cloud import Cloud
    for budget in ('VIEWPORT', 'RENDER', 'FULL'):
        for apply_grade in (True, False):
            path = str(tmp_path / f'{budget}{apply_grade}.ply')
            scenes.select(splats)
            bpy.ops.stipple.splats_export(filepath=path, budget=budget, apply_grade=apply_grade)
            written = Cloud.load(stipple.scene.source.sources.context(), path).read()
            expected = brighter(before, 1.0) if apply_grade else before
            np.testing.assert_allclose(written.sh[:, 0] * C0 + 0.5, expected, atol=2e-6)
            # PLY stores logits.
            np.testing.assert_allclose(written.opacities, opacity * (0.5 if apply_grade else 1), atol=1e-5)


def test_splats_without_a_source_are_graded_and_merged(splats, stipple, tmp_path):
    path = str(tmp_path / 'one.ply')
    scenes.select(splats)
    bpy.ops.stipple.splats_export(filepath=path)
    bpy.ops.stipple.splats_import(filepath=path)
    other = bpy.context.object
    other.data.stipple.source_kind = 'NONE'
    other.data.stipple.source = ''
    before, _ = colours(stipple, other)
    other.data.stipple.exposure = 1.0
    np.testing.assert_allclose(colours(stipple, other)[0], brighter(before, 1.0), atol=1e-6)
    scenes.select(splats, other)
    bpy.ops.stipple.merge_splats()
    joined = bpy.context.object
    assert joined.data.stipple.exposure == 0.0
    seen = np.sort(colours(stipple, joined)[0][:, 0])
    expected = np.sort(np.concatenate([before[:, 0], brighter(before, 1.0)[:, 0]]))
    np.testing.assert_allclose(seen, expected, atol=2e-6)


def test_undo_takes_the_grade_back(splats, stipple):
    before, _ = colours(stipple, splats)
    bpy.ops.ed.undo_push(message='before')
    splats.data.stipple.exposure = 1.0
    bpy.ops.ed.undo_push(message='grade')
    bpy.ops.ed.undo()
    obj = next(o for o in bpy.data.objects if stipple.scene.source.splat_data.is_splat_object(o))
    assert obj.data.stipple.exposure == 0.0
    np.testing.assert_array_equal(colours(stipple, obj)[0], before)


def test_values_outside_their_range_are_held_by_the_sliders(splats):
    settings = splats.data.stipple
    settings.exposure, settings.saturation, settings.grade_opacity = 100.0, -1.0, 3.0
    assert (settings.exposure, settings.saturation, settings.grade_opacity) == (16.0, 0.0, 1.0)
    limits = {name: (settings.bl_rna.properties[name].hard_min, settings.bl_rna.properties[name].hard_max)
              for name in ('exposure', 'tint', 'saturation', 'grade_opacity')}
    assert limits == {'exposure': (-16, 16), 'tint': (0, 16), 'saturation': (0, 16), 'grade_opacity': (0, 1)}


@pytest.mark.parametrize('engine', ['STIPPLE', 'CYCLES'])
def test_keyframes_reach_every_frame(splats, stipple, tmp_path, engine):
    settings = splats.data.stipple
    for frame, stops in ((1, 0.0), (3, 2.0)):
        settings.exposure = stops
        settings.keyframe_insert('exposure', frame=frame)
    for curve in _curves(splats.data):
        for key in curve.keyframe_points:
            key.interpolation = 'LINEAR'
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 3
    scene.frame_set(1)
    scene.render.engine = engine
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    image = scene.render.image_settings
    if bpy.app.version >= (5, 0, 0):
        image.media_type = 'IMAGE'
    image.file_format, image.color_depth, image.color_mode = 'OPEN_EXR', '32', 'RGBA'
    scene.render.filepath = str(tmp_path / 'frame_')
    bpy.ops.wm.save_mainfile()
    spy = tmp_path / 'spy.py'
    spy.write_text(SPY)
    result = subprocess.run([bpy.app.binary_path, '--background', '--factory-startup', str(tmp_path / 'a.blend'),
                             '--python', str(spy), '--render-anim'], env=os.environ, timeout=180, capture_output=True,
                            text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    if engine == 'CYCLES':
        seen = [float(line.split()[1]) for line in result.stdout.splitlines() if line.startswith('RED ')]
        red = ((seen[0] + 0.055) / 1.055) ** 2.4
        expected = [1.055 * (red * 2.0 ** stops) ** (1 / 2.4) - 0.055 for stops in (0, 1, 2)]
        np.testing.assert_allclose(seen, expected, atol=1e-5)
        return
    reds = []
    for frame in (1, 2, 3):
        picture = bpy.data.images.load(str(tmp_path / f'frame_000{frame}.exr'))
        pixels = np.array(picture.pixels[:]).reshape(32, 32, 4)
        reds.append(pixels[16, 16, 0])
    np.testing.assert_allclose(reds, [reds[0], 2 * reds[0], 4 * reds[0]], rtol=0.02)


SPY = '''
import bpy, sys
bpy.ops.preferences.addon_enable(module='stipple')
package = sys.modules['stipple']
def stored(scene, *_):
    obj = next(o for o in bpy.data.objects if package.scene.source.splat_data.is_splat_object(o))
    red = package.scene.source.splat_data.read(obj.data).sh[0, 0, 0] * 0.28209479177387814 + 0.5
    print('RED', float(red), flush=True)
bpy.app.handlers.render_post.append(stored)
'''


def _curves(data):
    action = data.animation_data.action
    if hasattr(action, 'fcurves'):
        return action.fcurves
    return [curve for layer in action.layers for strip in layer.strips for bag in strip.channelbags
            for curve in bag.fcurves]
