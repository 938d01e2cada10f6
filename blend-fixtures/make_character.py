"""Makes character.blend: a character on a scan. Blender 3.4 or newer with the add-on:

    blender -b --factory-startup --addons stipple --python-exit-code 1 --python blend-fixtures/make_character.py

The scan is a floor and two columns of splats; the character, a mesh, stands between the columns, before the one and
behind the other; a shadow catcher lies where the floor is. Nothing in here is random.
"""
import pathlib
import sys

import bpy
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import base_colours  # noqa: E402 (found beside this file)
from make_shots import DC, add_on, disc_rotations  # noqa: E402

WIDTH, HEIGHT = 320, 240


def floor():
    """Tiles of two colours, 6 x 6 metres."""
    across = (np.arange(60) + 0.5) / 60 * 6 - 3
    x, y = (axis.ravel() for axis in np.meshgrid(across, across))
    positions = np.stack([x, y, np.zeros_like(x)], axis=1)
    tile = (np.floor(x / 0.75) + np.floor(y / 0.75)) % 2
    colours = np.where(tile[:, None] > 0, (0.78, 0.74, 0.66), (0.55, 0.58, 0.60))
    return positions, np.tile((0.0, 0.0, 1.0), (len(x), 1)), colours, 0.07


def column(at, colour, radius=0.32, height=2.4):
    """Upright, with rings of two shades."""
    around, up = np.meshgrid(np.arange(36) * 2 * np.pi / 36, (np.arange(44) + 0.5) / 44 * height)
    around, up = around.ravel(), up.ravel()
    normals = np.stack([np.cos(around), np.sin(around), np.zeros_like(around)], axis=1)
    positions = normals * radius + np.array(at) + np.stack([0 * up, 0 * up, up], axis=1)
    shade = np.where(np.floor(up / 0.3) % 2 > 0, 1.0, 0.8)[:, None]
    return positions, normals, np.array(colour) * shade, 0.045


def scan():
    """Splats as arrays: display colours, flat, nearly opaque."""
    stipple = add_on()
    parts = [floor(), column((-0.75, -1.1, 0.0), (0.75, 0.33, 0.22)), column((0.85, 1.2, 0.0), (0.25, 0.45, 0.68))]
    positions, normals, colours = (np.concatenate([part[i] for part in parts]) for i in range(3))
    size = np.concatenate([np.full(len(part[0]), part[3]) for part in parts])
    scales = np.stack([size, size, np.full_like(size, 0.004)], axis=1)
    return stipple.binding.cloud.SplatArrays(
        positions.astype(np.float32), disc_rotations(normals).astype(np.float32), scales.astype(np.float32),
        np.full(len(size), 0.97, np.float32), ((colours - 0.5) / DC).astype(np.float32)[:, None, :])


def make():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=add_on().__name__)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.render.resolution_percentage = 100
    base_colours.prepare_image(scene)
    base_colours.prepare_cycles(scene)
    scene.cycles.max_bounces = 2

    splat_data = add_on().scene.source.splat_data
    data = splat_data.new_data('Scan')
    splat_data.write(data, scan())
    scene.collection.objects.link(bpy.data.objects.new('Scan', data))

    bpy.ops.mesh.primitive_monkey_add(size=1.3, location=(0.1, 0.0, 0.56), rotation=(-0.55, 0.0, 0.25))
    character = bpy.context.object
    character.name = character.data.name = 'Character'
    for polygon in character.data.polygons:
        polygon.use_smooth = True
    material = bpy.data.materials.new('Skin')
    material.use_nodes = True
    shader = next(node for node in material.node_tree.nodes if node.type == 'BSDF_PRINCIPLED')
    shader.inputs['Base Color'].default_value = (0.75, 0.55, 0.12, 1.0)
    shader.inputs['Roughness'].default_value = 0.6
    character.data.materials.append(material)

    bpy.ops.mesh.primitive_plane_add(size=6.0)
    catcher = bpy.context.object
    catcher.name = catcher.data.name = 'Catcher'
    catcher.is_shadow_catcher = True

    sun = bpy.data.objects.new('Sun', bpy.data.lights.new('Sun', 'SUN'))
    sun.data.energy, sun.data.angle = 3.0, 0.05
    sun.rotation_euler = (0.5, -0.75, 0.0)
    scene.collection.objects.link(sun)
    scene.world = bpy.data.worlds.new('World')
    scene.world.use_nodes = True
    background = next(node for node in scene.world.node_tree.nodes if node.type == 'BACKGROUND')
    background.inputs['Color'].default_value = (0.35, 0.42, 0.55, 1.0)
    scene.render.film_transparent = False
    camera = bpy.data.objects.new('Camera', bpy.data.cameras.new('Camera'))
    camera.location, camera.rotation_euler = (0.3, -6.2, 2.6), (1.2, 0.0, 0.03)
    camera.data.lens = 42.0
    scene.collection.objects.link(camera)
    scene.camera = camera


make()
bpy.context.scene.render.engine = 'STIPPLE_CYCLES'
bpy.context.preferences.filepaths.save_version = 0
bpy.ops.wm.save_as_mainfile(filepath=str(HERE / 'character.blend'), compress=True)
