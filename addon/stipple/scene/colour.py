# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a material's base colour comes from, as far as it can be read without rendering."""

from dataclasses import dataclass

import numpy as np

from .. import version
from ..binding.errors import StippleError
from ..binding.structs import Status

GREY = (0.8, 0.8, 0.8, 1.0)
# Byte images whose stored numbers are sRGB, and those whose numbers are linear as they are.
_SRGB = {'sRGB', 'sRGB OETF'}
_AS_IS = {'Non-Color', 'Raw', 'Linear', 'Linear Rec.709', 'Generic Data'}


@dataclass(frozen=True)
class BaseColour:
    """kind: CONSTANT (rgba), TEXTURE (image, uv_map), CORNER (attribute), BAKE_EMIT or BAKE_DIFFUSE."""

    kind: str
    rgba: tuple = GREY
    image: object = None
    uv_map: str = ''     # '' for the layer that renders use
    attribute: str = ''  # '' for the active colour attribute
    with_alpha: bool = False  # the image's alpha is the material's


def base_colour_of(material):
    """The base colour of a material, or None for an empty slot."""
    if material is None:
        return BaseColour('CONSTANT')
    if not version.has_nodes(material):
        return BaseColour('CONSTANT', rgba=tuple(material.diffuse_color))
    shader = surface_shader(material)
    if shader is None:
        return BaseColour('CONSTANT', rgba=(0.0, 0.0, 0.0, 1.0))
    socket = colour_socket(shader)
    if socket is None:
        return BaseColour('BAKE_DIFFUSE')
    if shader.type == 'EMISSION' and not _is_plain(shader.inputs['Strength'], 1.0):
        return BaseColour('BAKE_EMIT')
    if not socket.is_linked:
        return BaseColour('CONSTANT', rgba=tuple(socket.default_value[:3]) + (_constant_alpha(shader),))
    link = socket.links[0]
    node = link.from_node
    if node.type == 'RGB':
        return BaseColour('CONSTANT', rgba=tuple(link.from_socket.default_value[:3]) + (_constant_alpha(shader),))
    if node.type == 'TEX_IMAGE' and link.from_socket.name == 'Color' and node.image is not None:
        uv_map = _plain_uv_map(node)
        if uv_map is not None and _is_plain_image(node):
            return BaseColour('TEXTURE', image=node.image, uv_map=uv_map, with_alpha=_uses_alpha_of(shader, node))
    if node.type == 'VERTEX_COLOR' and link.from_socket.name == 'Color':
        return BaseColour('CORNER', attribute=node.layer_name)
    if node.type == 'ATTRIBUTE' and node.attribute_type == 'GEOMETRY' and link.from_socket.name == 'Color':
        return BaseColour('CORNER', attribute=node.attribute_name)
    return BaseColour('BAKE_EMIT')


def surface_shader(material):
    """The node at the Surface of the material's output, or None."""
    output = next((n for n in material.node_tree.nodes
                   if n.type == 'OUTPUT_MATERIAL' and n.is_active_output), None)
    if output is None or not output.inputs['Surface'].is_linked:
        return None
    return output.inputs['Surface'].links[0].from_node


def colour_socket(shader):
    """The input that holds a simple shader's colour, or None for shaders that mix several."""
    name = {'BSDF_PRINCIPLED': 'Base Color', 'BSDF_DIFFUSE': 'Color', 'EMISSION': 'Color'}.get(shader.type)
    return shader.inputs[name] if name else None


def nodes_of(material):
    """All nodes of a material, those of its groups too."""
    trees, seen = [material.node_tree] if material is not None and version.has_nodes(material) else [], set()
    while trees:
        tree = trees.pop()
        if tree is None or tree.name_full in seen:
            continue
        seen.add(tree.name_full)
        for node in tree.nodes:
            yield node
            if node.type == 'GROUP':
                trees.append(node.node_tree)


def may_emit(material):
    """Whether a material has a node that shines by itself."""
    for node in nodes_of(material):
        if node.type == 'EMISSION':
            return True
        if node.type != 'BSDF_PRINCIPLED':
            continue
        shown = node.inputs.get('Emission Color') or node.inputs.get('Emission')  # the latter before 4.0
        strength = node.inputs['Emission Strength']
        if (shown.is_linked or max(shown.default_value[:3]) > 0) and not _is_plain(strength, 0.0):
            return True
    return False


def image_pixels(image, material_name, with_alpha=False):
    """(pixels [height,width,3 or 4] with row 0 = top, straight alpha; whether they are sRGB).

    Errors: StippleError for a missing file.
    """
    width, height = image.size
    if width == 0 or height == 0 or len(image.pixels) == 0:
        raise StippleError(f"Image '{image.name}' of material '{material_name}' cannot be read from "
                           f"'{image.filepath_from_user()}'; put the file there or choose another image.",
                           Status.ERROR_IO)
    values = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(values)
    values = values.reshape(height, width, image.channels)[::-1]
    if image.channels < 3:
        values = np.repeat(values[..., :1], 3, axis=2)
    elif image.is_float and image.channels == 4 and image.alpha_mode != 'CHANNEL_PACKED':
        # Float images are associated: divide where there is alpha.
        alpha = values[..., 3:]
        straight = np.where(alpha > 0, values[..., :3] / np.where(alpha > 0, alpha, 1), values[..., :3])
        values = np.concatenate([straight, alpha], axis=2)
    channels = 4 if with_alpha and values.shape[2] == 4 else 3
    return np.ascontiguousarray(values[..., :channels]), not image.is_float and image.colorspace_settings.name in _SRGB


def _is_plain_image(node):
    image = node.image
    known = image.is_float or image.colorspace_settings.name in _SRGB | _AS_IS
    return known and node.projection == 'FLAT' and node.extension == 'REPEAT' and image.source in {'FILE', 'GENERATED'}


def _plain_uv_map(node):
    """The UV map that an image node uses, or None where its coordinates are computed."""
    vector = node.inputs['Vector']
    if not vector.is_linked:
        return ''
    source = vector.links[0]
    if source.from_node.type == 'UVMAP' and not source.from_node.from_instancer:
        return source.from_node.uv_map
    if source.from_node.type == 'TEX_COORD' and source.from_socket.name == 'UV' and not source.from_node.from_instancer:
        return ''
    return None


def _uses_alpha_of(shader, image_node):
    alpha = shader.inputs.get('Alpha')
    return (alpha is not None and alpha.is_linked and alpha.links[0].from_node == image_node
            and alpha.links[0].from_socket.name == 'Alpha')


def _constant_alpha(shader):
    alpha = shader.inputs.get('Alpha')
    return 1.0 if alpha is None or alpha.is_linked else alpha.default_value


def _is_plain(socket, value):
    return not socket.is_linked and socket.default_value == value
