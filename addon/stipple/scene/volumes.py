# SPDX-License-Identifier: GPL-3.0-or-later
"""Volume files as Blender objects that emit and absorb what the splats did."""

from dataclasses import dataclass

import bpy

from .. import version
from ..binding.errors import StippleError
from ..binding.structs import Status
from .source import source_paths


@dataclass(frozen=True)
class Timing:
    """Of a volume sequence, as Blender's properties of these names."""

    frame_start: int
    frame_duration: int
    frame_offset: int
    sequence_mode: str


def new_object(name, path, collection, voxel_size, timing=None):
    """A Volume object that shows an OpenVDB file with the grids `density` and `color`; voxels in metres.

    timing: makes it a sequence, of which the path is the first file; None for a single file.
    """
    volume = bpy.data.volumes.new(name)
    volume.filepath = source_paths.stored(path)
    if not volume.grids.load():
        message = volume.grids.error_message or 'no grids'
        bpy.data.volumes.remove(volume)
        raise StippleError(f"Blender cannot read the volume '{path}': {message}.", Status.ERROR_FORMAT)
    if timing is not None:
        volume.is_sequence = True
        volume.frame_start, volume.frame_duration = timing.frame_start, timing.frame_duration
        volume.frame_offset = timing.frame_offset
        # Blender divides by zero where one file plays to and fro.
        single = timing.frame_duration == 1 and timing.sequence_mode == 'PING_PONG'
        volume.sequence_mode = 'EXTEND' if single else timing.sequence_mode
    volume.materials.append(emission_absorption(name))
    obj = bpy.data.objects.new(name, volume)
    obj.delta_location = (-version.VOXEL_SHIFT * voxel_size,) * 3
    collection.objects.link(obj)
    return obj


def emission_absorption(name):
    """A material whose volume emits `color` and absorbs as much: extinction without scattering.

    With absorption and emission strength both equal to the extinction, an opaque ray shows `color` itself.
    """
    material = bpy.data.materials.new(name)
    version.use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    output = _node(tree, 'ShaderNodeOutputMaterial', 400)
    added = _node(tree, 'ShaderNodeAddShader', 200)
    absorption = _node(tree, 'ShaderNodeVolumeAbsorption', 0, 100)
    emission = _node(tree, 'ShaderNodeEmission', 0, -100)
    density = _node(tree, 'ShaderNodeAttribute', -250, 100)
    density.attribute_name = 'density'
    color = _node(tree, 'ShaderNodeAttribute', -250, -150)
    color.attribute_name = 'color'
    # A black absorption colour absorbs all channels alike.
    absorption.inputs['Color'].default_value = (0.0, 0.0, 0.0, 1.0)
    link = tree.links.new
    link(density.outputs['Fac'], absorption.inputs['Density'])
    link(density.outputs['Fac'], emission.inputs['Strength'])
    link(color.outputs['Color'], emission.inputs['Color'])
    link(absorption.outputs[0], added.inputs[0])
    link(emission.outputs[0], added.inputs[1])
    link(added.outputs[0], output.inputs['Volume'])
    return material


def _node(tree, kind, x, y=0):
    node = tree.nodes.new(kind)
    node.location = (x, y)
    return node
