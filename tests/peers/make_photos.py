#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders a photo set with Cycles: a still life in a round room, pictures as nerfstudio has them.

    blender -b --factory-startup -P make_photos.py -- FOLDER [--views 57] [--width 464] [--height 256]

transforms.json, view_00.png..., and points.ply: places that rays through random pixels meet, a little off, in the
colours of those pixels, as a reconstruction from the photos would have them.
"""

import argparse
import json
import math
import random
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).resolve().parent))
from make_scene import write_points  # noqa: E402

POINTS = 14700
POINT_NOISE = 0.004  # metres
SAMPLES = 8  # edges alone need them
AMBIENT = 0.35


def material(name, kind, scale, dark, bright):
    """A Principled material with a noisy base colour between two colours."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    shader = next(node for node in nodes if node.type == 'BSDF_PRINCIPLED')
    shader.inputs['Roughness'].default_value = 0.6
    texture = nodes.new(kind)
    texture.inputs['Scale'].default_value = scale
    ramp = nodes.new('ShaderNodeValToRGB')
    ramp.color_ramp.elements[0].color = (*dark, 1)
    ramp.color_ramp.elements[1].color = (*bright, 1)
    place = nodes.new('ShaderNodeTexCoord')
    links.new(place.outputs['Object'], texture.inputs['Vector'])
    links.new(texture.outputs['Color'], ramp.inputs['Fac'])
    links.new(ramp.outputs['Color'], shader.inputs['Base Color'])
    # A little light of its own instead of a sky's: with a sun alone pictures have no noise.
    glow = nodes.new('ShaderNodeEmission')
    glow.inputs['Strength'].default_value = AMBIENT
    links.new(ramp.outputs['Color'], glow.inputs['Color'])
    both = nodes.new('ShaderNodeAddShader')
    links.new(shader.outputs[0], both.inputs[0])
    links.new(glow.outputs[0], both.inputs[1])
    links.new(both.outputs[0], next(node for node in nodes if node.type == 'OUTPUT_MATERIAL').inputs['Surface'])
    return made


def give(obj, *args):
    obj.data.materials.append(material(obj.name, *args))


def still_life():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    mesh = bpy.ops.mesh
    mesh.primitive_plane_add(size=12)
    give(bpy.context.object, 'ShaderNodeTexVoronoi', 2.5, (0.05, 0.08, 0.15), (0.6, 0.5, 0.35))
    mesh.primitive_cylinder_add(vertices=64, radius=1.6, depth=0.12, location=(0, 0, 0.6))
    give(bpy.context.object, 'ShaderNodeTexNoise', 6, (0.2, 0.08, 0.03), (0.7, 0.4, 0.2))
    mesh.primitive_monkey_add(size=0.8, location=(0, 0, 1.1), rotation=(-0.4, 0, 0.6))
    monkey = bpy.context.object
    monkey.modifiers.new('Smooth', 'SUBSURF').render_levels = 2
    give(monkey, 'ShaderNodeTexNoise', 4, (0.6, 0.1, 0.05), (0.9, 0.8, 0.2))
    mesh.primitive_torus_add(location=(0.9, 0.5, 0.76), major_radius=0.3, minor_radius=0.1)
    give(bpy.context.object, 'ShaderNodeTexVoronoi', 9, (0.02, 0.2, 0.3), (0.2, 0.8, 0.7))
    mesh.primitive_uv_sphere_add(location=(-0.8, 0.6, 0.95), radius=0.28, segments=48, ring_count=24)
    give(bpy.context.object, 'ShaderNodeTexNoise', 9, (0.1, 0.02, 0.3), (0.9, 0.5, 0.9))
    for i, (x, y, turn) in enumerate(((-0.7, -0.7, 0.3), (0.6, -0.9, 1.1), (1.1, -0.2, 0.7))):
        mesh.primitive_cube_add(size=0.3, location=(x, y, 0.81), rotation=(0, 0, turn))
        give(bpy.context.object, 'ShaderNodeTexVoronoi', 7, (0.1, 0.1 + 0.2 * i, 0.1), (0.9, 0.9, 0.4 * i))
    mesh.primitive_uv_sphere_add(radius=6, segments=64, ring_count=32)
    walls = bpy.context.object
    walls.visible_shadow = False  # the sun is outside
    give(walls, 'ShaderNodeTexNoise', 1.5, (0.3, 0.4, 0.6), (0.9, 0.9, 0.8))
    bpy.ops.object.light_add(type='SUN', rotation=(0.5, 0.4, 0))
    bpy.context.object.data.energy = 2.5
    bpy.context.object.data.angle = 0


def cameras(count):
    """Positions and targets as of somebody who walks around the table."""
    dice = random.Random(5)
    for view in range(count):
        turn = 2 * math.pi * 2.2 * view / count
        height = 1.7 + 0.8 * math.sin(5.3 * turn) + 0.15 * dice.uniform(-1, 1)
        distance = 3.3 + 0.4 * dice.uniform(-1, 1)
        yield (Vector((distance * math.cos(turn), distance * math.sin(turn), height)),
               Vector((0.15 * dice.uniform(-1, 1), 0.15 * dice.uniform(-1, 1), 0.8)))


def settings(given):
    scene = bpy.context.scene
    scene.render.engine = 'CYCLES'
    scene.cycles.device = 'CPU'
    scene.cycles.samples = SAMPLES
    scene.cycles.use_denoising = False  # not every build has a denoiser
    scene.cycles.max_bounces = 0
    scene.render.resolution_x, scene.render.resolution_y = given.width, given.height
    scene.render.use_persistent_data = True
    scene.view_settings.view_transform = 'Standard'
    scene.render.image_settings.file_format = 'PNG'
    scene.render.image_settings.color_mode = 'RGB'
    return scene


def sample_points(scene, frames, focal, folder, given):
    """([N,3] places, [N,3] display colours) of what random pixels see."""
    dice = np.random.default_rng(3)
    graph = bpy.context.evaluated_depsgraph_get()
    places, shown = [], []
    for view, (path, matrix) in enumerate(frames):
        picture = bpy.data.images.load(str(folder / path))
        pixels = np.empty(given.width * given.height * 4, np.float32)
        picture.pixels.foreach_get(pixels)
        pixels = pixels.reshape(given.height, given.width, 4)[::-1]
        wanted = (view + 1) * POINTS // len(frames) - view * POINTS // len(frames)
        while wanted > 0:
            x, y = dice.uniform(0, given.width), dice.uniform(0, given.height)
            ray = matrix.to_3x3() @ Vector(((x - given.width / 2) / focal, (given.height / 2 - y) / focal, -1))
            hit, place, *_ = scene.ray_cast(graph, matrix.translation, ray.normalized())
            if not hit:
                continue
            places.append(np.array(place) + dice.normal(0, POINT_NOISE, 3))
            shown.append(pixels[int(y), int(x), :3])
            wanted -= 1
        bpy.data.images.remove(picture)
    return np.array(places, np.float32), np.array(shown)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('folder', type=Path)
    parser.add_argument('--views', type=int, default=57)
    parser.add_argument('--width', type=int, default=464)
    parser.add_argument('--height', type=int, default=256)
    given = parser.parse_args(sys.argv[sys.argv.index('--') + 1:])
    given.folder.mkdir(parents=True, exist_ok=True)
    still_life()
    scene = settings(given)
    camera = bpy.data.objects.new('Camera', bpy.data.cameras.new('Camera'))
    scene.collection.objects.link(camera)
    scene.camera = camera
    camera.data.angle = math.radians(60)
    focal = given.width / 2 / math.tan(math.radians(30))
    frames = []
    for view, (position, target) in enumerate(cameras(given.views)):
        camera.location = position
        camera.rotation_euler = (target - position).to_track_quat('-Z', 'Y').to_euler()
        bpy.context.view_layer.update()
        path = f'view_{view:02}.png'
        scene.render.filepath = str(given.folder / path)
        bpy.ops.render.render(write_still=True)
        frames.append((path, camera.matrix_world.copy()))
    write_points(given.folder / 'points.ply', *sample_points(scene, frames, focal, given.folder, given))
    (given.folder / 'transforms.json').write_text(json.dumps(
        {'camera_model': 'OPENCV', 'w': given.width, 'h': given.height, 'fl_x': focal, 'fl_y': focal,
         'cx': given.width / 2, 'cy': given.height / 2, 'ply_file_path': 'points.ply',
         'frames': [{'file_path': path, 'transform_matrix': [list(row) for row in matrix]}
                    for path, matrix in frames]}, indent=1))
    print(f'{POINTS} points, {given.views} views of {given.width} x {given.height} in {given.folder}')


if __name__ == '__main__':
    main()
