"""Inside Blender: images of a scene's base colours, rendered by Cycles.

Splats of a mesh carry its base colours without any light, so this is the image that they are compared with: every
Principled material emits its base colour, and nothing else lights the scene.
"""
import bpy

SAMPLES = 64  # emission is free of noise: samples only smooth edges, to 1/64 of coverage


def emit_base_colours():
    """Turns every Principled material of the file into one that emits its base colour."""
    for material in bpy.data.materials:
        if not material.node_tree:
            continue
        nodes, links = material.node_tree.nodes, material.node_tree.links
        shader = next((node for node in nodes if node.type == 'BSDF_PRINCIPLED'), None)
        output = material.node_tree.get_output_node('CYCLES')
        if shader is None or output is None:
            continue
        emission = nodes.new('ShaderNodeEmission')
        colour = shader.inputs['Base Color']
        if colour.is_linked:
            links.new(colour.links[0].from_socket, emission.inputs['Color'])
        else:
            emission.inputs['Color'].default_value = colour.default_value
        links.new(emission.outputs['Emission'], output.inputs['Surface'])


def prepare_image(scene):
    """The settings that every compared image shares: colours as they are, transparent film, 8-bit PNG."""
    scene.view_settings.view_transform = 'Standard'
    scene.view_settings.look = 'None'
    scene.view_settings.exposure = 0.0
    scene.view_settings.gamma = 1.0
    scene.render.dither_intensity = 0.0
    scene.render.film_transparent = True
    scene.render.use_compositing = False
    scene.render.use_sequencer = False
    settings = scene.render.image_settings
    settings.file_format = 'PNG'
    settings.color_mode = 'RGBA'
    settings.color_depth = '8'


def prepare_cycles(scene, samples=SAMPLES):
    scene.render.engine = 'CYCLES'
    scene.cycles.device = 'CPU'
    scene.cycles.samples = samples
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False  # not in every build of Blender
    scene.cycles.seed = 0


def render_image(scene, path):
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True, scene=scene.name)


def render_base_colours(scene, path):
    """The scene's base colours by Cycles, as a PNG. The materials of the open file emit afterwards."""
    emit_base_colours()
    prepare_image(scene)
    prepare_cycles(scene)
    scene.cycles.max_bounces = 0
    render_image(scene, path)


def use_nodes(material):
    """Gives a new material its node tree; those of Blender 5 always have one."""
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
