"""Splats' depth, normals and object indices, composited with a Cycles render of meshes by Blender's compositor.

    blender -b --factory-startup --addons stipple --python-exit-code 1 --python blend-fixtures/render_passes.py -- \
        OUT_FOLDER

The rings of crossing.blend under the engine Stipple, and in a scene of Cycles a bar through both of them. passes.png:
the nearer of both at each pixel by the depth passes; the ring of object index 2 is as bright as its normals are upright.
Images that must not pass: passes_over.png, the splats over the bar, and passes_plain.png, without normals and
indices. To renew the stored image after a change that is meant to change it, look at it and copy passes.png to
reference/.
"""
import pathlib
import sys

import bpy

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import base_colours  # noqa: E402 (found beside this file)

HAS_GROUPS = bpy.app.version >= (5, 0, 0)
INDEX_PASS = 'Object Index' if HAS_GROUPS else 'IndexOB'


def meshes_scene(splats):
    """A scene of Cycles with a bar that emits its colour, seen by the same camera."""
    scene = bpy.data.scenes.new('Meshes')
    scene.camera = splats.camera
    scene.collection.objects.link(splats.camera)
    scene.render.resolution_x, scene.render.resolution_y = splats.render.resolution_x, splats.render.resolution_y
    base_colours.prepare_image(scene)
    base_colours.prepare_cycles(scene, samples=16)
    mesh = bpy.data.meshes.new('Bar')
    x, y = 1.9, 0.12
    mesh.from_pydata([(sx * x, sy * y, sz * y) for sx in (-1, 1) for sy in (-1, 1) for sz in (-1, 1)], [],
                     [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
    bar = bpy.data.objects.new('Bar', mesh)
    bar.location, bar.rotation_euler = (0.3, 0.0, 0.0), (0.0, 0.0, 0.5)
    scene.collection.objects.link(bar)
    material = bpy.data.materials.new('Bar')
    base_colours.use_nodes(material)
    nodes = material.node_tree.nodes
    emission = nodes.new('ShaderNodeEmission')
    emission.inputs['Color'].default_value = (0.9, 0.8, 0.1, 1.0)
    material.node_tree.links.new(emission.outputs[0], material.node_tree.get_output_node('CYCLES').inputs['Surface'])
    mesh.materials.append(material)
    scene.view_layers[0].use_pass_z = True
    return scene


class Compositor:
    """Nodes by the names that this Blender has for them."""

    def __init__(self, scene):
        if HAS_GROUPS:
            self.tree = bpy.data.node_groups.new('Composite', 'CompositorNodeTree')
            scene.compositing_node_group = self.tree
            self.tree.interface.new_socket('Image', in_out='OUTPUT', socket_type='NodeSocketColor')
        else:
            scene.use_nodes = True
            self.tree = scene.node_tree
            self.tree.nodes.clear()
        scene.render.use_compositing = True

    def new(self, old_name, name=None):
        return self.tree.nodes.new(name if HAS_GROUPS and name else old_name)

    def layers(self, scene):
        node = self.new('CompositorNodeRLayers')
        node.scene = scene
        return node

    def math(self, operation, *inputs):
        node = self.new('CompositorNodeMath', 'ShaderNodeMath')
        node.operation = operation
        for socket, value in zip(node.inputs, inputs):
            self._give(socket, value)
        return node.outputs[0]

    def multiplied(self, image, factor):
        """An image times a value, its alpha as it is."""
        if HAS_GROUPS:
            node = self.tree.nodes.new('ShaderNodeMix')
            node.data_type, node.blend_type = 'RGBA', 'MULTIPLY'
            first, second = (socket for socket in node.inputs if socket.type == 'RGBA')
            node.inputs[0].default_value = 1.0
            output = next(socket for socket in node.outputs if socket.type == 'RGBA')
        else:
            node = self.tree.nodes.new('CompositorNodeMixRGB')
            node.blend_type = 'MULTIPLY'
            first, second, output = node.inputs[1], node.inputs[2], node.outputs[0]
        self._give(first, image)
        self._give(second, factor)
        # The product's alpha is not the splats'.
        keep = self.new('CompositorNodeSetAlpha')
        if hasattr(keep, 'mode'):
            keep.mode = 'REPLACE_ALPHA'
        else:
            keep.inputs['Type'].default_value = 'Replace Alpha'
        self._give(keep.inputs['Image'], output)
        return keep

    def nearer(self, image, depth, other, other_depth):
        node = self.new('CompositorNodeZcombine')
        if hasattr(node, 'use_alpha'):
            node.use_alpha, node.use_antialias_z = True, False
        else:
            for socket in node.inputs:
                if socket.name in {'Use Alpha', 'Anti-Alias'}:
                    socket.default_value = socket.name == 'Use Alpha'
        images = [socket for socket in node.inputs if socket.type == 'RGBA']
        depths = [socket for socket in node.inputs if socket.type == 'VALUE']
        for socket, value in zip((images[0], depths[0], images[1], depths[1]), (image, depth, other, other_depth)):
            self._give(socket, value)
        return node.outputs[0]

    def over(self, image, other):
        node = self.new('CompositorNodeAlphaOver')
        behind, before = [socket for socket in node.inputs if socket.type == 'RGBA'][:2]
        if behind.name == 'Foreground':
            behind, before = before, behind
        self._give(behind, other)
        self._give(before, image)
        return node.outputs[0]

    def show(self, image):
        if HAS_GROUPS:
            self._give(self.new('NodeGroupOutput').inputs[0], image)
        else:
            self._give(self.new('CompositorNodeComposite').inputs[0], image)

    def _give(self, socket, value):
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value


def lit(nodes, layer):
    """The splats, the ring of index 2 multiplied by how upright its normals are."""
    separate = nodes.new('CompositorNodeSeparateXYZ', 'ShaderNodeSeparateXYZ')
    nodes.tree.links.new(layer.outputs['Normal'], separate.inputs[0])
    is_second = nodes.math('MULTIPLY', nodes.math('GREATER_THAN', layer.outputs[INDEX_PASS], 1.5),
                           nodes.math('LESS_THAN', layer.outputs[INDEX_PASS], 2.5))
    dark = nodes.math('MULTIPLY', nodes.math('SUBTRACT', 1.0, separate.outputs['Z']), 0.5)
    factor = nodes.math('SUBTRACT', 1.0, nodes.math('MULTIPLY', is_second, dark))
    made = nodes.multiplied(layer.outputs['Image'], factor)
    nodes.tree.links.new(layer.outputs['Alpha'], made.inputs['Alpha'])
    return made.outputs['Image']


def main(out):
    bpy.ops.wm.open_mainfile(filepath=str(HERE / 'crossing.blend'))
    splats = bpy.context.scene
    base_colours.prepare_image(splats)
    splats.render.engine = 'STIPPLE'
    second = bpy.data.objects['Second']
    bpy.data.objects['First'].pass_index, second.pass_index = 1, 2
    layer = splats.view_layers[0]
    layer.use_pass_z = layer.use_pass_normal = layer.use_pass_object_index = True
    meshes = meshes_scene(splats)
    for name in ('passes', 'passes_over', 'passes_plain'):
        nodes = Compositor(splats)
        near, far = nodes.layers(splats), nodes.layers(meshes)
        image = near.outputs['Image'] if name == 'passes_plain' else lit(nodes, near)
        if name == 'passes_over':
            shown = nodes.over(image, far.outputs['Image'])
        else:
            shown = nodes.nearer(image, near.outputs['Depth'], far.outputs['Image'], far.outputs['Depth'])
        nodes.show(shown)
        base_colours.render_image(splats, out / f'{name}.png')


if __name__ == '__main__':
    main(pathlib.Path(sys.argv[sys.argv.index('--') + 1]))
