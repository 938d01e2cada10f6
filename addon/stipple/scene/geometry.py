# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats in geometry, whoever made it: by their attributes, in the object's data or out of its modifiers."""

import numpy as np

from .. import version
from ..binding import cloud_edit
from ..binding.errors import invalid
from .source import placement, source_settings, sources, splat_data

_NAMES = ('scale', 'rotation', 'radiance:base')


def carries_splats(data):
    """True for data with the attributes of splats, Stipple's or not."""
    attributes = getattr(data, 'attributes', None)
    return attributes is not None and all(attributes.get(name) is not None for name in _NAMES)


def is_plain(obj):
    """True where the object's own data are the splats that it shows."""
    return carries_splats(obj.data) and not any(modifier.show_viewport for modifier in obj.modifiers)


def may_carry_splats(obj):
    """Cheap enough for a menu: modifiers are not looked into."""
    if obj is None or obj.library is not None or obj.type not in {'MESH', 'POINTCLOUD', 'CURVES'}:
        return False
    if splat_data.is_splats(obj.data) and (obj.data.stipple.is_sequence
                                           or source_settings.of(obj.data.stipple).has_budget):
        return False
    return carries_splats(obj.data) or len(obj.modifiers) > 0


def splats_of(obj, depsgraph):
    """The cloud of what an object shows, in its own space. Errors: StippleError where that is no splats."""
    if is_plain(obj):
        data = obj.data
        if splat_data.is_splats(data) and source_settings.of(data.stipple).as_they_are and not data.stipple.edited:
            return sources.whole_cloud(data)
        return splat_data.ungraded_cloud(sources.context(), data)
    inverse, found = np.linalg.inv(placement.matrix_of(obj)), []
    # Points that modifiers make come as instances of the object.
    for entry in depsgraph.object_instances:
        owner = entry.parent.original if entry.is_instance else entry.object.original
        data = entry.object.data
        if owner != obj or not carries_splats(data) or splat_data.count(data) == 0:
            continue
        matrix = inverse @ version.copy_of_evaluated_matrix(entry.matrix_world)
        if np.abs(matrix - np.eye(4)).max() < 1e-6:
            matrix = np.eye(4)  # its bits stay
        found.append((splat_data.ungraded_cloud(sources.context(), data, obj.data), matrix))
    if not found:
        raise invalid(f"'{obj.name}' shows no splats; geometry with the attributes position, {', '.join(_NAMES)} is "
                      'needed.')
    return found[0][0] if len(found) == 1 and np.array_equal(found[0][1], np.eye(4)) else cloud_edit.merge(found)
