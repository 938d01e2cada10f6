# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras of photo data sets become cameras of the scene."""

import importlib
import json

import bpy
import numpy as np
import pytest

from test_cameras import POINTS, TOLERANCE, project

WIDTH, HEIGHT = 64, 48
# Turned about each axis, and moved.
MATRIX = [[0.8, -0.36, 0.48, 3.0], [0.6, 0.48, -0.64, -2.0], [0.0, 0.8, 0.6, 1.0], [0, 0, 0, 1]]


def write_picture(stipple, path, value=0.25):
    path.parent.mkdir(exist_ok=True)
    image = importlib.import_module(f'{stipple.__name__}.binding.image').Image
    image.create(stipple.scene.source.sources.context(), np.full((HEIGHT, WIDTH, 3), value, np.float32),
                 stipple.binding.structs.Transfer.SRGB).save(str(path))


def write_transforms(stipple, folder, **keys):
    frames = []
    for name, shift in (('a', 0.0), ('b', 6.0)):
        write_picture(stipple, folder / 'images' / f'{name}.png')
        matrix = [list(row) for row in MATRIX]
        matrix[0][3] += shift
        frames.append({'file_path': f'images/{name}.png', 'transform_matrix': matrix})
    intrinsics = {'w': WIDTH, 'h': HEIGHT, 'fl_x': 70.0, 'fl_y': 70.0, 'cx': 30.0, 'cy': 26.0}
    (folder / 'transforms.json').write_text(json.dumps({**intrinsics, **keys, 'frames': frames}))


def write_colmap(folder, camera):
    sparse = folder / 'sparse' / '0'
    sparse.mkdir(parents=True)
    (sparse / 'cameras.txt').write_text(f'1 {camera}\n')
    # A quarter turn about x.
    (sparse / 'images.txt').write_text('1 1 1 0 0 0.5 1 2 1 a.png\n\n')


def test_cameras_see_what_the_data_set_says(stipple, tmp_path):
    write_transforms(stipple, tmp_path)
    assert bpy.ops.stipple.cameras_import(filepath=str(tmp_path / 'transforms.json')) == {'FINISHED'}
    collection = bpy.data.collections[f'{tmp_path.name} Cameras']
    assert [obj.name for obj in collection.objects] == ['a.png', 'b.png']
    scene = bpy.context.scene
    assert scene.camera == collection.objects[0]
    assert (scene.render.resolution_x, scene.render.resolution_y) == (WIDTH, HEIGHT)
    bpy.context.view_layer.update()
    views = stipple.binding.views.Views.load(stipple.scene.source.sources.context(), str(tmp_path))
    for i, obj in enumerate(collection.objects):
        ours = stipple.scene.view.cameras.camera_of(obj, scene.render)
        # Blender keeps lens and matrix in single floats.
        np.testing.assert_allclose(project(ours, POINTS), project(views.camera(i), POINTS), atol=TOLERANCE,
                                   rtol=TOLERANCE)
        [background] = obj.data.background_images
        assert obj.data.show_background_images
        assert bpy.path.abspath(background.image.filepath) == str(tmp_path / 'images' / obj.name)
        assert tuple(background.image.size) == (WIDTH, HEIGHT)


def test_colmap_stands_upright_and_can_come_without_backgrounds(stipple, tmp_path):
    write_colmap(tmp_path, f'PINHOLE {WIDTH} {HEIGHT} 50 50 32 24')
    write_picture(stipple, tmp_path / 'images' / 'a.png')
    assert bpy.ops.stipple.cameras_import(filepath=str(tmp_path), backgrounds=False) == {'FINISHED'}
    obj = bpy.data.objects['a.png']
    assert not obj.data.background_images
    # Centre -R^T t = (-0.5, -2, 1) of a world whose -y is up and z is forward.
    np.testing.assert_allclose(obj.matrix_world.translation, (-0.5, 1.0, 2.0), atol=1e-6)
    bpy.ops.stipple.cameras_import(filepath=str(tmp_path), up_axis='Z')
    np.testing.assert_allclose(bpy.data.objects['a.png.001'].matrix_world.translation, (-0.5, -2.0, 1.0), atol=1e-6)


def test_distorted_photos_are_told_of(stipple, tmp_path):
    write_colmap(tmp_path, f'SIMPLE_RADIAL {WIDTH} {HEIGHT} 50 32 24 -0.2')
    write_picture(stipple, tmp_path / 'images' / 'a.png')
    properties = bpy.ops.stipple.cameras_import.get_rna_type().properties
    assert 'distorts' in properties['backgrounds'].description
    assert bpy.ops.stipple.cameras_import(filepath=str(tmp_path)) == {'FINISHED'}
    data = bpy.data.objects['a.png'].data
    assert data.background_images
    # The camera is the pinhole without the distortion: it sees further than 64 pixels at a focal length of 50.
    assert data.lens / data.sensor_width < 50 / WIDTH


def test_cameras_come_without_photos_that_are_missing(stipple, tmp_path):
    write_transforms(stipple, tmp_path)
    (tmp_path / 'images' / 'b.png').unlink()
    assert bpy.ops.stipple.cameras_import(filepath=str(tmp_path)) == {'FINISHED'}
    assert not bpy.data.objects['a.png'].data.background_images
    assert len(bpy.data.cameras) == 2


def test_what_is_no_data_set_is_one_clear_error(stipple, tmp_path):
    with pytest.raises(RuntimeError, match='holds no cameras'):
        bpy.ops.stipple.cameras_import(filepath=str(tmp_path))
    (tmp_path / 'transforms.json').write_text('{"frames": 3}')
    with pytest.raises(RuntimeError, match="list 'frames'"):
        bpy.ops.stipple.cameras_import(filepath=str(tmp_path / 'transforms.json'))
    assert not bpy.data.cameras and not bpy.data.collections
