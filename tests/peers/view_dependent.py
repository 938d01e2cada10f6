# SPDX-License-Identifier: GPL-3.0-or-later
"""What baking from some directions brings to splats of shining meshes, beside Cycles' own images.

    python3 tests/blender/run.py tests/peers/view_dependent.py -s

Suzanne under a sky and two suns, in three materials: 50,000 splats with the light along the normal, with light that
changes with the view, and with the latter refined as well, seen from six sides that no bake looks from. PSNR of display
values over black. It prints a table and judges nothing; 15 minutes on two cores.
"""

import math
import time

import bpy
import numpy as np

import scenes

MATERIALS = {'glossy plastic': (0.15, 0.0), 'satin plastic': (0.35, 0.0), 'satin metal': (0.35, 1.0)}
HEIGHTS = (0.3, 1.6, -0.7, 0.8, 2.5, 0.0)
SIDE = 256


def lit_suzanne(roughness, metallic):
    bpy.ops.mesh.primitive_monkey_add()
    suzanne = bpy.context.object
    suzanne.modifiers.new('Subdivision', 'SUBSURF').levels = 2
    bpy.ops.object.shade_smooth()
    shader = scenes.principled(scenes.material('shining', (0.6, 0.2, 0.08), suzanne))
    shader.inputs['Roughness'].default_value = roughness
    shader.inputs['Metallic'].default_value = metallic
    world = bpy.data.worlds.new('sky')
    world.use_nodes = True
    background = world.node_tree.nodes['Background']
    background.inputs['Color'].default_value = (0.3, 0.4, 0.6, 1)
    background.inputs['Strength'].default_value = 0.5
    bpy.context.scene.world = world
    for rotation, strength in (((0.6, 0.2, 0.3), 3.0), ((1.2, -0.4, 2.5), 1.5)):
        sun = bpy.data.lights.new('sun', 'SUN')
        sun.energy, sun.angle = strength, 0.2
        scenes.link(bpy.data.objects.new('sun', sun)).rotation_euler = rotation
    return suzanne


def images(engine, tmp_path):
    scene = bpy.context.scene
    camera = scenes.link(bpy.data.objects.new('eye', bpy.data.cameras.new('eye')))
    scene.camera, scene.render.engine = camera, engine
    scene.render.resolution_x = scene.render.resolution_y = SIDE
    scene.render.film_transparent = True
    scene.cycles.samples, scene.cycles.use_denoising = 64, False
    seen = []
    for k, height in enumerate(HEIGHTS):
        angle = 0.4 + 1.05 * k
        camera.location = (4.2 * math.cos(angle), 4.2 * math.sin(angle), height)
        camera.rotation_euler = (-camera.location).to_track_quat('-Z', 'Y').to_euler()
        linear = np.clip(scenes.render_pixels(tmp_path)[..., :3], 0, 1)
        seen.append(np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055))
    bpy.data.objects.remove(camera)
    return np.array(seen)


def test_view_dependent_light(stipple, tmp_path):
    for name, (roughness, metallic) in MATERIALS.items():
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        suzanne = lit_suzanne(roughness, metallic)
        truth = images('CYCLES', tmp_path)
        for views, refine in ((False, False), (True, False), (False, True), (True, True)):
            suzanne.hide_set(False)
            suzanne.hide_render = False
            begin = time.time()
            result = scenes.make_splats(suzanne, anchors=50000, color_from='BAKED', bake_views=views, refine=refine)
            seconds = time.time() - begin
            errors = np.mean((images('STIPPLE', tmp_path) - truth) ** 2, axis=(1, 2, 3))
            psnr = -10 * np.log10(errors)
            print(f'{name}, view-dependent {views}, refined {refine}: {psnr.mean():.2f} dB, least {psnr.min():.1f}, '
                  f'{seconds:.0f} s', flush=True)
            bpy.data.objects.remove(result)
