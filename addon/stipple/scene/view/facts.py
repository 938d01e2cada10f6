# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scene asks of an image: size, border, background, passes, colour."""

from dataclasses import dataclass

import numpy as np

from ... import version
from ...binding.errors import StippleError
from ...binding.structs import BlendSpace, Status


@dataclass(frozen=True)
class Border:
    """A rectangle of pixels, from the bottom left corner of the whole image."""

    x: int
    y: int
    width: int
    height: int


@dataclass(frozen=True)
class PictureFacts:
    width: int
    height: int
    border: Border
    background: tuple  # scene linear, or None for a transparent film
    blend_space: int
    with_depth: bool


def picture_size(render):
    """Pixels (width, height) at the scene's resolution percentage; Blender truncates."""
    share = render.resolution_percentage
    return max(render.resolution_x * share // 100, 1), max(render.resolution_y * share // 100, 1)


def picture_facts(scene, view_layer):
    width, height = picture_size(scene.render)
    render = scene.render
    border = Border(0, 0, width, height)
    if render.use_border:
        x0, x1 = version.pixel_border(render.border_min_x, render.border_max_x, width)
        y0, y1 = version.pixel_border(render.border_min_y, render.border_max_y, height)
        border = Border(x0, y0, x1 - x0, y1 - y0)
    background = None if render.film_transparent else world_colour(scene.world)
    return PictureFacts(width, height, border, background, blend_space(scene), view_layer.use_pass_z)


def refuse_stereo(render):
    """Errors: StippleError where an image of several views is wanted."""
    if render.use_multiview:
        count = sum(view.use for view in render.views)
        raise StippleError(f'Stereoscopy is on with {count} views; splats are rendered in images of one view, with '
                           'Output Properties > Stereoscopy off.', Status.ERROR_UNSUPPORTED)


def blend_space(scene):
    linear = scene.stipple.splat_color == 'SCENE_LINEAR'
    return BlendSpace.SCENE_LINEAR if linear else BlendSpace.AS_TRAINED


def world_colour(world):
    """Scene linear colour of a plain world: its Background node, else its viewport colour."""
    if world is None:
        return (0.0, 0.0, 0.0)
    tree = world.node_tree if version.VERSION >= (5, 0, 0) or world.use_nodes else None
    if tree is not None:
        output = next((n for n in tree.nodes if n.type == 'OUTPUT_WORLD' and n.is_active_output), None)
        if output is None or not output.inputs['Surface'].is_linked:
            return (0.0, 0.0, 0.0)
        node = output.inputs['Surface'].links[0].from_node
        if node.type == 'BACKGROUND':
            strength = node.inputs['Strength'].default_value
            return tuple(strength * c for c in node.inputs['Color'].default_value[:3])
    return tuple(world.color)


def plain_world_colour(world):
    """Scene linear colour of a world that is the same everywhere, or None."""
    if world is None or not version.has_nodes(world):
        return world_colour(world)
    output = next((n for n in world.node_tree.nodes if n.type == 'OUTPUT_WORLD' and n.is_active_output), None)
    if output is not None and output.inputs['Volume'].is_linked:
        return None
    if output is None or not output.inputs['Surface'].is_linked:
        return world_colour(world)
    node = output.inputs['Surface'].links[0].from_node
    plain = node.type == 'BACKGROUND' and not any(node.inputs[name].is_linked for name in ('Color', 'Strength'))
    return world_colour(world) if plain else None


def uses_standard_view(scene):
    """True where the view shows scene colours as they are, which As Trained counts on."""
    view = scene.view_settings
    return (view.view_transform == 'Standard' and view.look in {'None', ''} and view.exposure == 0.0
            and view.gamma == 1.0 and not view.use_curve_mapping)


def display_colours(dc):
    """Display values 0..1 of constant harmonics [N,3] (band 0 of the real harmonics: 1 / (2 sqrt pi))."""
    return np.clip(0.5 + 0.28209479177387814 * dc, 0.0, 1.0)
