#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders meshes' base colours with Cycles and writes their density models: what edges of splats are judged by.

    blender -b --factory-startup --addons stipple -P make_edges.py -- FOLDER [--helmet DamagedHelmet.glb]

FOLDER/suzanne, cube and, where its file is named, helmet: transforms.json with six views of 640 x 480, their images,
and model.stipple.safetensors as Splats from Mesh makes it. The helmet is that of KhronosGroup/glTF-Sample-Assets (CC
BY 4.0 and CC BY-NC 4.0), which is not kept here. Images that are there are kept.
"""

import argparse
import json
import math
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / 'blend-fixtures'))
import base_colours  # noqa: E402 (lies with the scenes)

VIEWS = 6
WIDTH, HEIGHT = 640, 480
ANGLE = math.radians(40)  # across the width
SQUARES = 8  # of a chequer, along a side of the cube


def clear():
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    bpy.ops.preferences.addon_enable(module='stipple')


def suzanne():
    """The quick start's."""
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / 'blend-fixtures' / 'suzanne.blend'))
    return [bpy.data.objects['Suzanne']]


def cube():
    clear()
    bpy.ops.mesh.primitive_cube_add(size=2)
    made = bpy.context.object
    for loop, place in zip(made.data.uv_layers[0].data, [(0, 0), (1, 0), (1, 1), (0, 1)] * 6):
        loop.uv = place
    side = 512
    image = bpy.data.images.new('Chequer', side, side)
    squares = np.indices((side, side)) * SQUARES // side
    dark = (squares.sum(0) % 2).astype(bool)
    pixels = np.ones((side, side, 4), np.float32)
    pixels[dark, :3] = (0.05, 0.15, 0.4)
    pixels[~dark, :3] = (0.9, 0.8, 0.6)
    image.pixels.foreach_set(pixels.ravel())
    material = bpy.data.materials.new('Chequer')
    base_colours.use_nodes(material)
    nodes = material.node_tree.nodes
    texture = nodes.new('ShaderNodeTexImage')
    texture.image = image
    shader = next(node for node in nodes if node.type == 'BSDF_PRINCIPLED')
    material.node_tree.links.new(texture.outputs['Color'], shader.inputs['Base Color'])
    made.data.materials.append(material)
    return [made]


def helmet(path):
    clear()
    if not hasattr(np, 'bool'):  # the importer of Debian's Blender is older than its NumPy
        np.bool = bool
    bpy.ops.import_scene.gltf(filepath=str(path))
    return [made for made in bpy.data.objects if made.type == 'MESH']


def bounds(objects):
    corners = np.array([made.matrix_world @ Vector(corner) for made in objects for corner in made.bound_box])
    return (corners.min(0) + corners.max(0)) / 2, float(np.linalg.norm(corners.max(0) - corners.min(0)) / 2)


def directions():
    for view in range(VIEWS):
        height = 1 - 2 * (view + 0.5) / VIEWS
        turn = 0.4 + view * math.pi * (3 - math.sqrt(5))
        across = math.sqrt(1 - height * height)
        yield Vector((across * math.cos(turn), across * math.sin(turn), height))


def write_model(objects, path):
    bpy.ops.object.select_all(action='DESELECT')
    for made in objects:
        made.select_set(True)
    bpy.context.view_layer.objects.active = objects[0]
    bpy.ops.stipple.splats_from_mesh(anchors=1000, source_path=str(path))
    splats = bpy.context.view_layer.objects.active
    splats.hide_render = True
    for made in objects:
        made.hide_set(False)
        made.hide_render = False


def write(folder, objects):
    folder.mkdir(parents=True, exist_ok=True)
    scene = bpy.context.scene
    for other in [made for made in scene.objects if made.type in {'CAMERA', 'LIGHT'}]:
        bpy.data.objects.remove(other)
    model = folder / 'model.stipple.safetensors'
    model.unlink(missing_ok=True)
    write_model(objects, model)
    middle, radius = bounds(objects)
    camera = bpy.data.objects.new('Camera', bpy.data.cameras.new('Camera'))
    scene.collection.objects.link(camera)
    scene.camera = camera
    camera.data.angle = ANGLE
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = WIDTH, HEIGHT, 100
    base_colours.emit_base_colours()
    base_colours.prepare_image(scene)
    base_colours.prepare_cycles(scene)
    scene.cycles.max_bounces = 0
    focal = WIDTH / 2 / math.tan(ANGLE / 2)
    distance = radius / math.sin(math.atan(HEIGHT / 2 / focal)) * 0.95
    camera.data.clip_start, camera.data.clip_end = distance / 100, distance * 10
    frames = []
    for view, direction in enumerate(directions()):
        camera.location = Vector(middle) + distance * direction
        camera.rotation_euler = direction.to_track_quat('Z', 'Y').to_euler()
        bpy.context.view_layer.update()
        name = f'view_{view}.png'
        if not (folder / name).exists():
            base_colours.render_image(scene, folder / name)
        frames.append({'file_path': name, 'transform_matrix': [list(row) for row in camera.matrix_world]})
    (folder / 'transforms.json').write_text(json.dumps(
        {'w': WIDTH, 'h': HEIGHT, 'fl_x': focal, 'fl_y': focal, 'cx': WIDTH / 2, 'cy': HEIGHT / 2,
         'frames': frames}, indent=1))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('folder', type=Path)
    parser.add_argument('--helmet', type=Path)
    given = parser.parse_args(sys.argv[sys.argv.index('--') + 1:])
    folder = given.folder.resolve()
    write(folder / 'suzanne', suzanne())
    write(folder / 'cube', cube())
    if given.helmet:
        write(folder / 'helmet', helmet(given.helmet.resolve()))


main()
