# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes of files that have colours of their vertices and no material: importers leave them grey."""

import bpy

from ... import version


def show_colours(objects):
    """Gives each of these a material that shows its colours."""
    for obj in objects:
        if obj.type != 'MESH' or any(slot.material for slot in obj.material_slots):
            continue
        attribute = obj.data.color_attributes.active_color
        if attribute is None and len(obj.data.color_attributes):
            attribute = obj.data.color_attributes[0]
        if attribute is not None:
            obj.data.materials.clear()
            obj.data.materials.append(_material(attribute.name))


def _material(name):
    material = bpy.data.materials.new('Colors')
    version.use_nodes(material)
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    colour, shader, output = (nodes.new(kind) for kind in ('ShaderNodeAttribute', 'ShaderNodeBsdfDiffuse',
                                                           'ShaderNodeOutputMaterial'))
    colour.attribute_name = name
    links.new(colour.outputs['Color'], shader.inputs['Color'])
    links.new(shader.outputs[0], output.inputs['Surface'])
    return material
