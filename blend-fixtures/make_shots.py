"""Makes crossing.blend and crowd.blend: many splat objects. Blender 3.4 or newer with the add-on:

    blender -b --factory-startup --addons stipple --python-exit-code 1 --python blend-fixtures/make_shots.py

crossing: two rings of splats through each other, one of them half transparent. crowd: 200 instances of one tree of
splats, made by geometry nodes. Nothing in here is random.
"""
import math
import pathlib
import sys

import bpy
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import base_colours  # noqa: E402 (found beside this file)

WIDTH, HEIGHT = 320, 240
DC = 0.28209479177387814


def add_on():
    return sys.modules[next(name for name in sys.modules if name.rpartition('.')[2] == 'stipple')]


def disc_rotations(normals):
    """w,x,y,z that rotate z to each normal; normals of -z are never reached exactly."""
    w = 1.0 + normals[:, 2]
    quaternions = np.stack([w, -normals[:, 1], normals[:, 0], np.zeros_like(w)], axis=1)
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


def splats(positions, normals, colours, size, opacity):
    """Flat splats along surfaces; colours are display values."""
    count = len(positions)
    return add_on().binding.cloud.SplatArrays(
        positions.astype(np.float32), disc_rotations(normals).astype(np.float32),
        np.tile([size, size, size * 0.1], (count, 1)).astype(np.float32), np.full(count, opacity, np.float32),
        ((colours - 0.5) / DC).astype(np.float32)[:, None, :])


def evenly(count, ratio):
    """Angles that fill a circle evenly at any count."""
    return 2 * np.pi * np.mod((np.arange(count) + 0.5) * ratio, 1.0)


def ring(count, colour, opacity):
    """A torus in the xy plane, of radii 1 and 0.3, with stripes."""
    around, inside = evenly(count, 0.6180339887498949), evenly(count, 0.7548776662466927)
    normals = np.stack([np.cos(around) * np.cos(inside), np.sin(around) * np.cos(inside), np.sin(inside)], axis=1)
    positions = np.stack([np.cos(around), np.sin(around), np.zeros(count)], axis=1) + 0.3 * normals
    shade = np.where(np.floor(around / (np.pi / 8)) % 2 > 0, 1.0, 0.7)[:, None]
    return splats(positions, normals, np.array(colour) * shade, 0.05, opacity)


def tree(count):
    """A trunk and a crown, standing on the origin, 1 metre high."""
    trunk = count // 5
    around, up = evenly(trunk, 0.6180339887498949), (np.arange(trunk) + 0.5) / trunk
    bark = np.stack([np.cos(around), np.sin(around), np.zeros(trunk)], axis=1)
    rest = count - trunk
    z, angle = 1 - 2 * (np.arange(rest) + 0.5) / rest, evenly(rest, 0.6180339887498949)
    leaf = np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=1)
    positions = np.concatenate([0.06 * bark + up[:, None] * (0, 0, 0.5), 0.3 * leaf + (0, 0, 0.7)])
    colours = np.concatenate([np.tile((0.45, 0.3, 0.2), (trunk, 1)),
                              (0.25, 0.55, 0.2) + 0.2 * leaf[:, 2:] * (1.0, 1.0, 0.3)])
    return splats(positions, np.concatenate([bark, leaf]), colours, 0.035, 0.95)


def add_splats(name, arrays):
    data = add_on().scene.source.splat_data.new_data(name)
    add_on().scene.source.splat_data.write(data, arrays)
    obj = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def new_scene(location, target, lens=50.0):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=add_on().__name__)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = WIDTH, HEIGHT, 100
    base_colours.prepare_image(scene)
    scene.render.engine = 'STIPPLE'
    camera = bpy.data.objects.new('Camera', bpy.data.cameras.new('Camera'))
    camera.data.lens = lens
    camera.location = location
    direction = np.subtract(target, location)
    camera.rotation_euler = (math.acos(-direction[2] / np.linalg.norm(direction)), 0.0,
                             math.atan2(-direction[0], direction[1]))
    scene.collection.objects.link(camera)
    scene.camera = camera
    return scene


def make_crossing():
    new_scene((0.5, -5.6, 2.0), (0.35, 0.0, 0.0))
    first = add_splats('First', ring(3000, (0.85, 0.45, 0.2), 0.97))
    first.rotation_euler = (0.4, 0.2, 0.0)
    second = add_splats('Second', ring(3000, (0.25, 0.5, 0.9), 0.16))
    second.location.x, second.rotation_euler = 0.6, (1.45, 0.15, 0.3)


def scatter_nodes(points, instanced):
    """Geometry nodes that put an instance of an object at every vertex, its size by a named attribute."""
    group = bpy.data.node_groups.new('Scatter', 'GeometryNodeTree')
    if bpy.app.version < (4, 0, 0):
        group.inputs.new('NodeSocketGeometry', 'Geometry')
        group.outputs.new('NodeSocketGeometry', 'Geometry')
    else:
        for direction in ('INPUT', 'OUTPUT'):
            group.interface.new_socket('Geometry', in_out=direction, socket_type='NodeSocketGeometry')
    nodes, links = group.nodes, group.links
    begin, end = nodes.new('NodeGroupInput'), nodes.new('NodeGroupOutput')
    info, put = nodes.new('GeometryNodeObjectInfo'), nodes.new('GeometryNodeInstanceOnPoints')
    size = nodes.new('GeometryNodeInputNamedAttribute')
    size.data_type = 'FLOAT'
    size.inputs['Name'].default_value = 'size'
    info.inputs['Object'].default_value = instanced
    info.inputs['As Instance'].default_value = True
    links.new(begin.outputs[0], put.inputs['Points'])
    links.new(info.outputs['Geometry'], put.inputs['Instance'])
    links.new(next(s for s in size.outputs if s.enabled), put.inputs['Scale'])
    links.new(put.outputs[0], end.inputs[0])
    points.modifiers.new('Scatter', 'NODES').node_group = group


def make_crowd(columns=20, rows=10):
    new_scene((0.0, -9.0, 5.2), (0.0, -0.6, 0.2), lens=42.0)
    source = add_splats('Tree', tree(1500))
    source.hide_render = source.hide_viewport = True
    column, row = (axis.ravel() for axis in np.meshgrid(np.arange(columns), np.arange(rows)))
    index = np.arange(columns * rows)
    x = (column - (columns - 1) / 2) * 0.55 + 0.2 * np.sin(7.0 * index)
    y = (row - (rows - 1) / 2) * 0.8 + 0.2 * np.sin(11.0 * index)
    mesh = bpy.data.meshes.new('Ground')
    mesh.from_pydata(np.stack([x, y, 0 * x], axis=1).tolist(), [], [])
    mesh.attributes.new('size', 'FLOAT', 'POINT').data.foreach_set(
        'value', (0.9 + 0.35 * np.sin(3.0 * index)).astype(np.float32))
    points = bpy.data.objects.new('Ground', mesh)
    bpy.context.scene.collection.objects.link(points)
    scatter_nodes(points, source)


def main():
    for name, make in (('crossing', make_crossing), ('crowd', make_crowd)):
        make()
        bpy.context.preferences.filepaths.save_version = 0
        bpy.ops.wm.save_as_mainfile(filepath=str(HERE / f'{name}.blend'), compress=True)


if __name__ == '__main__':
    main()
