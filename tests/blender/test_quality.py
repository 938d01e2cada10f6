# SPDX-License-Identifier: GPL-3.0-or-later
"""How exact images are: levels in both engines and the view, measuring, choosing, comparing."""

import importlib
import json

import bpy
import numpy as np
import pytest

import scenes
from shots import camera, prepare, splat_wall  # noqa: F401


@pytest.fixture
def walls(stipple, camera):
    """Splats in two planes, seen by a perspective camera."""
    splat_wall(stipple, 'behind', -1.0)
    splat_wall(stipple, 'front', 1.0, side=1.0, colour=(0.1, 0.1, 0.7)).rotation_euler.x = 0.6
    bpy.data.objects.remove(camera)
    scenes.camera((0.4, 0.2, 6), width=60, height=60, lens=60.0)
    return prepare('STIPPLE').stipple


def module(stipple, name):
    return importlib.import_module(f'{stipple.__name__}.{name}')


def test_the_settings_a_file_starts_with_are_those_of_final(stipple, walls):
    quality = module(stipple, 'scene.view.quality')
    library = module(stipple, 'scene.source.sources').context().library
    for settings in (walls.quality_render, walls.quality_viewport):
        assert settings.level == 'FINAL' and not quality.is_changed(library, settings)
    made = quality.accuracy_of(library, walls.quality_render)
    assert made.min_alpha == 1 / 255 and made.budget_share == 1.0 and made.sh_degree_limit == 4


def test_the_cut_off_is_kept_under_its_former_name(stipple, walls):
    quality = module(stipple, 'scene.view.quality')
    library = module(stipple, 'scene.source.sources').context().library
    walls.quality_render.least_alpha = 0.25
    assert quality.accuracy_of(library, walls.quality_render).min_alpha == 0.25
    assert quality.is_changed(library, walls.quality_render)
    assert all(hasattr(walls.quality_render, quality.property_of(name)) for name in quality.KNOBS)


def test_a_level_sets_every_setting(stipple, walls):
    quality = module(stipple, 'scene.view.quality')
    library = module(stipple, 'scene.source.sources').context().library
    walls.quality_render.level = 'DRAFT'
    assert walls.quality_render.budget_share < 1 and walls.quality_render.sh_degree_limit < 4
    walls.quality_render.order = 'PIXEL'
    assert quality.is_changed(library, walls.quality_render)
    walls.quality_render.level = 'REFERENCE'
    assert walls.quality_render.precision == 'DOUBLE' and walls.quality_render.projection == 'RAY'
    walls.quality_render.level = 'FINAL'
    assert walls.quality_render.precision == 'FLOAT' and walls.quality_render.order == 'CENTRE'
    assert walls.quality_viewport.level == 'FINAL'


@pytest.mark.parametrize('engine', ['STIPPLE', 'STIPPLE_CYCLES'])
def test_both_engines_obey_the_level_of_renders(walls, tmp_path, engine):
    bpy.context.scene.render.engine = engine
    final = scenes.render_pixels(tmp_path, 'final')
    walls.quality_viewport.level = 'DRAFT'
    np.testing.assert_array_equal(scenes.render_pixels(tmp_path, 'again'), final)
    walls.quality_render.level = 'DRAFT'
    draft = scenes.render_pixels(tmp_path, 'draft')
    walls.quality_render.level = 'REFERENCE'
    reference = scenes.render_pixels(tmp_path, 'reference')
    # The same picture at another exactness: a quarter of the splats is off by more than the usual limits are.
    assert 0 < np.abs(final - reference).mean() < np.abs(draft - reference).mean() < 0.05


def test_settings_that_do_not_go_together_are_one_error(walls, tmp_path):
    walls.quality_render.level = 'REFERENCE'
    walls.quality_render.order = 'CENTRE'
    scenes.refuses(lambda: scenes.render_pixels(tmp_path), 'order')
    walls.quality_render.level = 'FINAL'
    walls.quality_render.samples_per_side = 3
    scenes.refuses(lambda: scenes.render_pixels(tmp_path), 'samples_per_side')


def test_measuring_choosing_and_comparing(stipple, walls, tmp_path):
    scene, measured = bpy.context.scene, module(stipple, 'scene.view.measured_quality')
    assert not bpy.ops.stipple.accuracy_choose.poll()
    report = tmp_path / 'report.json'
    assert bpy.ops.stipple.accuracy_measure(repetitions=1, filepath=str(report)) == {'FINISHED'}
    found = measured.of(scene)
    assert measured.is_current(scene, found) and found.camera_name == scene.camera.name
    assert json.loads(report.read_text())
    rows = {row.name: row for row in found.report.rows}
    assert rows['final'].psnr > rows['draft'].psnr and any(row.is_on_front for row in found.report.rows)
    assert measured.row_of(scene, found, 'RENDER').name == 'final'
    image = measured.plot_of(scene)
    pixels = np.array(image.pixels[:]).reshape(image.size[1], image.size[0], 4)
    assert image.packed_file is not None and 0.02 < (pixels[..., :3].min(axis=2) < 0.5).mean() < 0.5  # ink on paper

    assert bpy.ops.stipple.accuracy_choose(column='VIEWPORT', by='QUALITY', decibels=1.0) == {'FINISHED'}
    chosen = measured.row_of(scene, found, 'VIEWPORT')
    assert chosen.seconds == min(row.seconds for row in found.report.rows if row.psnr >= 1.0)
    assert bpy.ops.stipple.accuracy_choose(column='RENDER', by='TIME', milliseconds=1e6) == {'FINISHED'}
    assert measured.row_of(scene, found, 'RENDER').psnr == max(row.psnr for row in found.report.rows)
    before = walls.quality_render.level
    scenes.refuses(lambda: bpy.ops.stipple.accuracy_choose(column='RENDER', by='TIME', milliseconds=1e-6), 'needs')
    assert walls.quality_render.level == before

    # Figures of another frame are of another view.
    scene.frame_set(scene.frame_current + 1)
    assert not measured.is_current(scene, found)


def test_a_comparison_is_a_wipe_or_the_error(walls):
    walls.quality_viewport.level = 'DRAFT'
    assert bpy.ops.stipple.accuracy_compare(first='VIEWPORT', second='RENDER', wipe=0.5) == {'FINISHED'}
    image = bpy.data.images['Quality Comparison']
    pixels = np.array(image.pixels[:]).reshape(60, 60, 4)
    assert (pixels[:, 29] == 1.0).all() and pixels[30, 10, 1] > 0.3 and pixels[30, 34, 1] > 0.3
    assert bpy.ops.stipple.accuracy_compare(first='RENDER', second='RENDER', show='ERROR') == {'FINISHED'}
    pixels = np.array(bpy.data.images['Quality Comparison'].pixels[:]).reshape(60, 60, 4)
    assert pixels[..., :3].max() == 0.0
    bpy.ops.stipple.accuracy_compare(first='VIEWPORT', second='RENDER', show='ERROR')
    assert np.array(bpy.data.images['Quality Comparison'].pixels[:]).reshape(60, 60, 4)[..., :3].max() > 0.05


def test_measuring_without_splats_is_one_error(stipple, camera):
    prepare('STIPPLE')
    for call in (bpy.ops.stipple.accuracy_measure, bpy.ops.stipple.accuracy_compare, bpy.ops.stipple.effects_look,
                 bpy.ops.stipple.effects_measure):
        scenes.refuses(call, 'shows no splats')
    assert not bpy.data.images


def test_the_view_obeys_its_own_level(stipple, walls):
    """A resting picture as the viewport's column has it; a turning one is never slow."""
    view_image = module(stipple, 'viewport.view_image')
    facts = module(stipple, 'scene.view.facts')
    from test_viewport import made_pictures
    whole = facts.Border(0, 0, 60, 60)
    final = made_pictures(view_image, None, whole)
    walls.quality_render.level = 'DRAFT'
    np.testing.assert_array_equal(made_pictures(view_image, None, whole)[1], final[1])
    walls.quality_viewport.level = 'DRAFT'
    draft = made_pictures(view_image, None, whole)
    assert np.abs(draft[1] - final[1]).max() > 0.01
    walls.quality_viewport.level = 'REFERENCE'
    coarse, fine = made_pictures(view_image, None, whole)
    np.testing.assert_array_equal(coarse, final[0])
    assert 0 < np.abs(fine - final[1]).mean() < np.abs(draft[1] - final[1]).mean()
