# SPDX-License-Identifier: GPL-3.0-or-later
"""What density control saw of splats: kept with them, and the colours that a 3D view gives them for it."""

import importlib
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

import scenes

Y00 = 0.28209479177387814


@pytest.fixture
def overlays(stipple):
    importlib.import_module(f'{stipple.__name__}.scene.view.viewed')._forget()
    return importlib.import_module(f'{stipple.__name__}.scene.overlays')


def splats(stipple, name='Splats', count=4, location=(0, 0, 0), seen=None):
    """Splats in a row along x: a needle along each axis in turn, the fourth one round."""
    sizes = np.full((count, 3), 0.1, np.float32)
    for i in range(count):
        if i % 4 < 3:
            sizes[i, i % 4] = 1e6  # clearness 1 - 1e-7: the colour of the axis to all its bits
    positions = np.zeros((count, 3), np.float32)
    positions[:, 0] = np.arange(count)
    arrays = stipple.binding.cloud.SplatArrays(
        positions, np.tile(np.float32([1, 0, 0, 0]), (count, 1)), sizes, np.full(count, 0.7, np.float32),
        np.zeros((count, 4, 3), np.float32), seen=seen or {})
    data = stipple.scene.source.splat_data.new_data(name)
    stipple.scene.source.splat_data.write(data, arrays)
    obj = scenes.link(bpy.data.objects.new(name, data))
    obj.location = location
    return obj


def shown(overlays, kind, **settings):
    """(overlay, viewed objects by name, depsgraph) under these settings."""
    chosen = overlays.settings_of(bpy.context.scene)
    chosen.kind = kind
    for name, value in settings.items():
        setattr(chosen, name, value)
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    entries = overlays.viewed.gather(depsgraph).splats
    overlay = overlays.Overlay()
    overlay.update(entries, depsgraph, bpy.context.scene)
    return overlay, {entry.obj.name: entry for entry in entries}, depsgraph


def kinds(stipple):
    return stipple.binding.structs.SplatQuantity


def test_the_map_of_colors_becomes_lighter_with_the_value(overlays):
    linear = overlays.map_colours(np.linspace(0, 1, 101)).astype(np.float64)
    linear = np.where(linear <= 0.04045, linear / 12.92, ((linear + 0.055) / 1.055) ** 2.4)
    luminance = linear @ (0.2126, 0.7152, 0.0722)
    lightness = 116 * np.cbrt(luminance) - 16  # CIE L*; above the toe everywhere
    steps = np.diff(lightness)
    assert (steps > 0).all()
    # Evenly: viridis rises by 0.75 a hundredth; ten anchors with three decimals are off by half of that at most.
    assert steps.min() > 0.35 and steps.max() < 1.2


def test_split_axes_have_the_colors_of_the_axes_and_round_splats_are_grey(overlays, stipple):
    splats(stipple)
    overlay, entries, _ = shown(overlays, 'SPLIT_AXIS')
    grey = overlays.UNKNOWN
    # 1e-6: single precision of axes and lengths.
    np.testing.assert_allclose(overlay.colours(entries['Splats']),
                               [(1, 0, 0), (0, 1, 0), (0, 0, 1), (grey,) * 3], atol=1e-6)
    half = overlays.axis_colours(np.array([[0, -0.5, 0]]))
    np.testing.assert_allclose(half, [(grey / 2, 0.5 + grey / 2, grey / 2)], atol=1e-6)  # whichever way it points


def test_the_drawn_cloud_has_the_colors_and_the_shapes(overlays, stipple):
    ages = np.float32([0, 10, 20, 40])
    obj = splats(stipple, seen={kinds(stipple).AGE: ages})
    overlay, entries, depsgraph = shown(overlays, 'AGE')
    assert overlay.scale == overlays.Scale('AGE', 0.0, 40.0)
    cloud, info = overlay.cloud_of(entries['Splats'], depsgraph)
    assert info.count == 4 and info.sh_degree == 0
    made, own = cloud.read(), stipple.scene.source.splat_data.read(obj.data)
    np.testing.assert_array_equal(made.scales, own.scales)
    np.testing.assert_array_equal(made.opacities, own.opacities)
    expected = overlays.map_colours(np.array([0, 0.25, 0.5, 1]))
    # Harmonics and back: a few roundings of single precision.
    np.testing.assert_allclose(made.sh[:, 0] * Y00 + 0.5, expected, atol=1e-6)
    # Asked again, it is the same one: nothing is drawn anew.
    overlay.update(entries.values(), depsgraph, bpy.context.scene)
    assert overlay.cloud_of(entries['Splats'], depsgraph)[0] is cloud


def test_scores_and_contributions_spread_over_powers_of_ten(overlays, stipple):
    splats(stipple, seen={kinds(stipple).SCORE: np.float32([0.0, 0.01, 0.1, 1.0])})
    overlay, entries, _ = shown(overlays, 'SCORE', auto_range=False, low=0.01, high=1.0)
    assert overlay.scale.is_logarithmic
    np.testing.assert_allclose(overlay.colours(entries['Splats']), overlays.map_colours(np.array([0, 0, 0.5, 1])),
                               atol=1e-6)
    # By itself the range has all that is above 0, but for a few extremes.
    automatic = shown(overlays, 'SCORE', auto_range=True)[0].scale
    assert 0.01 <= automatic.low < 0.02 and 0.9 < automatic.high <= 1.0
    # All alike: one color, and no division by nothing.
    splats(stipple, 'Splats2', seen={kinds(stipple).CONTRIBUTION: np.float32([0, 0, 0, 0])})
    overlay, entries, _ = shown(overlays, 'CONTRIBUTION')
    assert np.isfinite(overlay.colours(entries['Splats2'])).all()


def test_objects_share_one_scale_and_those_that_tell_nothing_are_grey(overlays, stipple):
    age = kinds(stipple).AGE
    splats(stipple, 'Young', seen={age: np.float32([0, 1, 2, 3])})
    splats(stipple, 'Old', location=(0, 5, 0), seen={age: np.float32([6, 6, 6, 6])})
    splats(stipple, 'Elsewhere', location=(0, 9, 0))
    overlay, entries, _ = shown(overlays, 'AGE')
    assert (overlay.scale.low, overlay.scale.high) == (0, 6)
    np.testing.assert_allclose(overlay.colours(entries['Young'])[3], overlays.map_colours(np.array([0.5]))[0],
                               atol=1e-6)
    assert (overlay.colours(entries['Elsewhere']) == np.float32(overlays.UNKNOWN)).all()
    assert shown(overlays, 'SCORE')[0].scale is None


def test_the_popover_has_it_and_overlays_hide_it(overlays, stipple):
    assert bpy.types.STIPPLE_PT_overlay.bl_parent_id == 'VIEW3D_PT_overlay'
    space = SimpleNamespace(overlay=SimpleNamespace(show_overlays=True))
    scene = bpy.context.scene
    assert not overlays.is_on(scene, space)  # as a scene begins
    scene.stipple.overlay.kind = 'AGE'
    assert overlays.is_on(scene, space)
    space.overlay.show_overlays = False
    assert not overlays.is_on(scene, space)


def test_values_follow_splats_through_a_fit_a_grade_and_density_control(overlays, stipple, tmp_path):
    ball = scenes.two_coloured_ball(tmp_path)
    chosen = bpy.context.scene.stipple.fit
    for name, value in {'view_count': 6, 'view_size': 48, 'engine': 'WORKBENCH', 'max_splats': 150,
                        'quality': 'FAST'}.items():
        setattr(chosen, name, value)
    assert bpy.ops.stipple.splats_fit() == {'FINISHED'}
    obj = next(o for o in bpy.data.objects if o.name.endswith(' Fit'))
    read_seen, quantity = stipple.scene.source.splat_data.read_seen, kinds(stipple)
    count = stipple.scene.source.splat_data.count(obj.data)
    for kind in (quantity.SCORE, quantity.AGE, quantity.CONTRIBUTION):
        values = read_seen(obj.data, kind)
        assert values.shape == (count,) and np.isfinite(values).all() and (values >= 0).all()
    pixels = read_seen(obj.data, quantity.CONTRIBUTION)
    # The ball fills a good part of a view of 48 x 48 pixels, and no more than all of it.
    assert 300 < pixels.sum() <= 48 * 48 * 1.0001
    obj.data.stipple.exposure = 1.0
    np.testing.assert_array_equal(read_seen(obj.data, quantity.CONTRIBUTION), pixels)
    obj.data.stipple.exposure = 0.0

    scenes.select(ball, obj)
    bpy.context.view_layer.objects.active = obj
    assert bpy.ops.stipple.splats_densify(strategy='adaptive(threshold=1e-7)', max_splats=count + 20) == {'FINISHED'}
    ages = read_seen(obj.data, quantity.AGE)
    assert (ages == 0).sum() >= 20 and set(np.unique(ages)) == {0.0, 1.0}
    # Another budget is of other splats; the whole one has those that are known.
    obj.data.stipple.ratio = 0.5
    assert read_seen(obj.data, quantity.AGE) is None
    obj.data.stipple.ratio = 1.0
    np.testing.assert_array_equal(read_seen(obj.data, quantity.AGE), ages)


def test_a_legend_says_what_the_colors_mean(stipple):
    legend = importlib.import_module(f'{stipple.__name__}.viewport.view_legend')
    assert [legend.number(v) for v in (0, 3000, 12345.6, 0.012345, 7.0)] == ['0', '3,000', '12,346', '0.0123', '7']
