# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats to volume, and that Cycles shows their colours."""

import bpy
import numpy as np
import pytest

import scenes


def cycles_shows_volumes():
    """Debian's Blender 5.2 is built without what Cycles needs to read OpenVDB files; it renders them empty."""
    return bpy.app.version < (5, 0, 0)


def test_volume_has_density_and_color_and_cycles_shows_it(stipple, tmp_path):
    sphere = scenes.sphere()
    scenes.material('orange', (0.8, 0.3, 0.05), sphere)
    splats = scenes.make_splats(sphere, anchors=8000)
    path = tmp_path / 'sphere.vdb'
    assert bpy.ops.stipple.splats_to_volume(filepath=str(path), resolution=64) == {'FINISHED'}
    obj = bpy.data.objects['sphere']
    assert obj.type == 'VOLUME'
    assert sorted(g.name for g in obj.data.grids) == ['color', 'density']
    if not cycles_shows_volumes():
        pytest.skip('Cycles of this build does not read OpenVDB files')
    splats.hide_render = True
    scenes.camera((0, 0, 6), width=48, height=48, type='ORTHO', ortho_scale=3.0)
    scene = bpy.context.scene
    scene.render.engine = 'CYCLES'
    scene.cycles.samples, scene.cycles.use_denoising = 32, False
    scene.render.film_transparent = True
    picture = scenes.render_pixels(tmp_path)
    centre = picture[18:30, 18:30].mean(axis=(0, 1))
    assert centre[3] > 0.9
    # The mean of 144 pixels of 32 samples; colour is interpolated between voxels of one colour.
    np.testing.assert_allclose(centre[:3] / centre[3], (0.8, 0.3, 0.05), rtol=0.05)
    assert picture[:3, :3].max() == 0


def test_object_matrix_is_in_the_volume(stipple, tmp_path):
    splats = scenes.make_splats(scenes.quad(), anchors=500)
    splats.location = (10, 0, 0)
    bpy.context.view_layer.update()
    assert bpy.ops.stipple.splats_to_volume(filepath=str(tmp_path / 'a.vdb'), voxel_size=0.1) == {'FINISHED'}
    info = stipple.binding.volume.Volume.load(stipple.scene.source.sources.context(), str(tmp_path / 'a.vdb')).info()
    assert abs(info.voxel_size - 0.1) < 1e-6
    assert 7 < info.bounds_min[0] < 9.1 and 10.9 < info.bounds_max[0] < 13


def test_volume_is_drawn_where_the_splats_are(stipple, tmp_path):
    if not cycles_shows_volumes():
        pytest.skip('Cycles of this build does not read OpenVDB files')
    splats = scenes.make_splats(scenes.sphere(), anchors=2000)
    assert bpy.ops.stipple.splats_to_volume(filepath=str(tmp_path / 'ball.vdb'), voxel_size=0.2) == {'FINISHED'}
    splats.hide_render = True
    scenes.camera((0, 0, 6), width=60, height=60, type='ORTHO', ortho_scale=3.0)
    scene = bpy.context.scene
    scene.render.engine = 'CYCLES'
    scene.cycles.samples, scene.cycles.use_denoising = 32, False
    scene.render.film_transparent = True
    alpha = scenes.render_pixels(tmp_path)[..., 3]
    y, x = np.mgrid[:60, :60] + 0.5
    centroid = np.array([(alpha * x).sum(), (alpha * y).sum()]) / alpha.sum()
    # 20 pixels are a metre, so half a voxel is 2 pixels; the anchors' own centroid is good to a twentieth of that.
    np.testing.assert_allclose(centroid, (30.0, 30.0), atol=0.3)
