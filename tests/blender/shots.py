# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of splats among meshes whose pictures are known in numbers."""

import bpy
import numpy as np
import pytest

import scenes

DC = 0.28209479177387814
EMPTY = np.float32(1e10)
SPLAT = (0.1, 0.6, 0.2)  # scene linear
MESH = (0.8, 0.2, 0.05)


def splat_wall(stipple, name, z, side=2.0, colour=SPLAT, count=60, opacity=0.98):
    """A square of splats in a plane of constant z, opaque in its middle."""
    across = np.linspace(-side / 2, side / 2, count, dtype=np.float32)
    x, y = np.meshgrid(across, across)
    positions = np.stack([x.ravel(), y.ravel(), np.full(x.size, z)], axis=1).astype(np.float32)
    display = np.where(np.array(colour) <= 0.0031308, 12.92 * np.array(colour),
                       1.055 * np.array(colour) ** (1 / 2.4) - 0.055)
    n = len(positions)
    spacing = side / count
    arrays = stipple.binding.cloud.SplatArrays(
        positions, np.tile(np.float32([1, 0, 0, 0]), (n, 1)),
        np.tile(np.float32([spacing, spacing, 1e-3]), (n, 1)), np.full(n, opacity, np.float32),
        np.tile(((display - 0.5) / DC).astype(np.float32), (n, 1))[:, None, :])
    data = stipple.scene.source.splat_data.new_data(name)
    stipple.scene.source.splat_data.write(data, arrays)
    return scenes.link(bpy.data.objects.new(name, data))


def emission(obj, colour=MESH):
    """Light that is the same from everywhere: pictures without noise."""
    made = bpy.data.materials.new('emission')
    if bpy.app.version < (5, 0, 0):
        made.use_nodes = True
    tree = made.node_tree
    node = tree.nodes.new('ShaderNodeEmission')
    node.inputs['Color'].default_value = (*colour, 1.0)
    tree.links.new(node.outputs[0], tree.get_output_node('ALL').inputs['Surface'])
    obj.data.materials.append(made)


def set_world(colour=(0.2, 0.4, 0.8)):
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new('world')
    if bpy.app.version < (5, 0, 0):
        scene.world.use_nodes = True
    node = next(n for n in scene.world.node_tree.nodes if n.type == 'BACKGROUND')
    node.inputs['Color'].default_value = (*colour, 1.0)
    return node


def prepare(engine, transparent=True, samples=4):
    scene = bpy.context.scene
    scene.render.engine = engine
    scene.render.film_transparent = transparent
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = samples, False, False
    scene.cycles.seed = 0
    return scene


@pytest.fixture
def camera():
    """60 x 60 pixels over 3 x 3 metres of every plane of constant z, from z = 6."""
    return scenes.camera((0, 0, 6), width=60, height=60, type='ORTHO', ortho_scale=3.0)


def mesh_between(stipple, opacity=0.98):
    """Splats at z = 1 on the left, an emitting quad of 1 x 1 metre at 0, splats at z = -1 on the whole."""
    splat_wall(stipple, 'behind', -1.0, opacity=opacity)
    front = splat_wall(stipple, 'front', 1.0, side=1.0, colour=(0.1, 0.1, 0.7), opacity=opacity)
    front.location.x = -0.5
    quad = scenes.quad(size=1.0)
    emission(quad)
    return quad


def set_panorama(rotation=(0.3, 0.2, 0.7), strength=0.8, pixels=None):
    """A world of an environment texture that is rotated: a different colour in every direction, without edges."""
    node = set_world((1.0, 1.0, 1.0))
    node.inputs['Strength'].default_value = strength
    tree = node.id_data
    image = bpy.data.images.new('panorama', 256, 128, float_buffer=True)
    if pixels is None:
        v, u = np.meshgrid(np.linspace(0.0, np.pi, 128), np.linspace(0.0, 2 * np.pi, 256), indexing='ij')
        # Even at the poles, and the same on both sides of the seam.
        pixels = np.ones((128, 256, 4), np.float32)
        pixels[..., 0] = 0.5 + 0.4 * np.cos(v)
        pixels[..., 1] = 0.5 + 0.4 * np.sin(v) ** 2 * np.cos(3 * u)
        pixels[..., 2] = 0.5 + 0.4 * np.sin(v) * np.sin(u)
    image.pixels.foreach_set(pixels.reshape(-1))
    image.pack()
    texture, place = tree.nodes.new('ShaderNodeTexEnvironment'), tree.nodes.new('ShaderNodeMapping')
    texture.image = image
    place.inputs['Rotation'].default_value = rotation
    tree.links.new(tree.nodes.new('ShaderNodeTexCoord').outputs['Generated'], place.inputs['Vector'])
    tree.links.new(place.outputs[0], texture.inputs[0])
    tree.links.new(texture.outputs[0], node.inputs['Color'])
    return node
