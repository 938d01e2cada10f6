#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures what the background shell of a field brings: things before a sky, and a closed room.

    python3 tests/blender/run.py tests/blender/bench_shell.py -s

Not a test of the suite: its name keeps it out. Opaque views, held-out PSNR as the trainer measures it.
STIPPLE_FIT_PICTURES=folder keeps a view beside the fits of it.
"""

import importlib
import os
import time

import bpy
import numpy as np
import pytest

import scenes

VIEW_COUNT, VIEW_SIZE, SAMPLES, SPLATS = 30, 64, 8, 4000


def patterned(name, obj, scale):
    skin = scenes.material(name, (0.5, 0.5, 0.5), obj)
    tree = skin.node_tree
    cells = tree.nodes.new('ShaderNodeTexVoronoi')
    cells.inputs['Scale'].default_value = scale
    tree.links.new(cells.outputs['Color'], scenes.principled(skin).inputs['Base Color'])


def outdoors():
    """A ground of 8 m with things on it; around it a sky so smooth that views tell of what lies between them."""
    bpy.ops.mesh.primitive_grid_add(size=8, x_subdivisions=8, y_subdivisions=8)
    things = [bpy.context.object]
    for i in range(6):
        bpy.ops.mesh.primitive_uv_sphere_add(radius=0.4 + 0.1 * i, location=(2.4 * np.cos(i), 2.4 * np.sin(i), 0.6))
        things.append(bpy.context.object)
    for i, thing in enumerate(things):
        patterned(f'Paint {i}', thing, 6 if i else 2)
    world = bpy.context.scene.world = bpy.data.worlds.new('Sky')
    world.use_nodes = True
    tree = world.node_tree
    haze = tree.nodes.new('ShaderNodeTexNoise')
    haze.inputs['Scale'].default_value, haze.inputs['Detail'].default_value = 1.2, 0
    where = tree.nodes.new('ShaderNodeTexCoord')
    tree.links.new(where.outputs['Generated'], haze.inputs['Vector'])
    tree.links.new(haze.outputs['Color'], tree.nodes['Background'].inputs['Color'])
    scenes.select(*things)
    return 'AROUND'


def room():
    """Walls of 4 m all around, with things between them, and lamps."""
    bpy.ops.mesh.primitive_cube_add(size=4)
    things = [bpy.context.object]
    bpy.context.object.data.flip_normals()
    patterned('Walls', bpy.context.object, 4)
    for i in range(5):
        bpy.ops.mesh.primitive_cube_add(size=0.6, location=(1.4 * np.cos(1.3 * i), 1.4 * np.sin(1.3 * i), -1.6))
        patterned(f'Paint {i}', bpy.context.object, 5)
        things.append(bpy.context.object)
    bpy.ops.object.light_add(type='POINT', location=(0, 0, 1.2))
    bpy.context.object.data.energy = 200
    scenes.select(*things)
    return 'INSIDE'


@pytest.mark.parametrize('scene', (outdoors, room))
def test_shell(stipple, tmp_path, scene):
    fitting = importlib.import_module('.scene.fit.fitting', stipple.__name__)
    rig = scene()
    chosen = list(bpy.context.selected_objects)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    settings = bpy.context.scene.stipple.fit
    for name, value in {'model': 'FIELD', 'quality': 'FAST', 'rig': rig, 'view_count': VIEW_COUNT,
                        'view_size': VIEW_SIZE, 'samples': SAMPLES, 'max_splats': SPLATS, 'transparent': False}.items():
        setattr(settings, name, value)
    row = []
    for shell in ('AUTO', 'OFF'):
        settings.shell = shell
        scenes.select(*chosen)
        before = time.process_time()
        assert bpy.ops.stipple.splats_fit() == {'FINISHED'}
        busy = time.process_time() - before
        obj = next(o for o in bpy.data.objects if o.name.endswith(' Fit'))
        cloud = stipple.scene.source.decoded.decode_data(obj.data,
                                                         stipple.scene.source.sources.decode_settings(obj.data.stipple))
        row.append((shell, cloud))
        farthest = np.abs(cloud.read().positions).max()
        print(f'\n{scene.__name__}, shell {shell}: held out {fitting.state.figures.best_psnr:.2f} dB, splats as far as '
              f'{farthest:.1f} m, {busy:.0f} processor seconds, views included', flush=True)
        bpy.data.objects.remove(obj)
    if 'STIPPLE_FIT_PICTURES' in os.environ:
        save(stipple, scene.__name__, chosen, rig, row)


def save(stipple, name, objects, rig, fits):
    """A view, and the fits of it, side by side."""
    rigs, capturing = (importlib.import_module(m, stipple.__name__)
                       for m in ('.scene.fit.view_rigs', '.scene.fit.view_capture'))
    binding, structs = (importlib.import_module(f'.binding.{m}', stipple.__name__) for m in ('renderer', 'structs'))
    depsgraph = bpy.context.evaluated_depsgraph_get()
    place = rigs.around if rig == 'AROUND' else rigs.inside
    pose = place(bpy.context.scene, depsgraph, rigs.bounds_of(objects, depsgraph), 8, seed=5)[3]
    with capturing.Capture(bpy.context, objects, capturing.CaptureSettings('CYCLES', 256, 64, False)) as capture:
        seen = capture.pose('seen', pose)
    linear = np.clip(seen.linear[..., :3], 0, 1)
    pictures = [np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)]
    renderer = binding.Renderer(stipple.scene.source.sources.context())
    for _shell, cloud in fits:
        task = renderer.start([(cloud, np.eye(4))], seen.camera,
                              renderer.options(output_colour=structs.OutputColour.COMPOSITED), with_depth=False)
        task.job.wait()
        pictures.append(np.clip(task.colour[..., :3], 0, 1))
    picture = np.concatenate(pictures, axis=1)[::-1]
    image = bpy.data.images.new('compared', picture.shape[1], picture.shape[0])
    image.pixels.foreach_set(np.concatenate([picture, np.ones_like(picture[..., :1])],
                                            2).astype(np.float32).reshape(-1))
    image.filepath_raw, image.file_format = os.path.join(os.environ['STIPPLE_FIT_PICTURES'], f'{name}.png'), 'PNG'
    image.save()
