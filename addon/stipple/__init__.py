# SPDX-License-Identifier: GPL-3.0-or-later
"""Stipple: Gaussian splats with their density under control."""

bl_info = {
    "name": "Stipple",
    "description": "Gaussian splats with their density under control",
    "author": "The Stipple authors",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "Add > Gaussian Splats, Object Data, File > Import/Export, render engine Stipple",
    "category": "Object",
}

import bpy

from . import late

# Before the other imports: the rooms that they come to ask this one, too, for modules.
__getattr__ = late.room(__name__)

from . import cycles_engine, engine, operators, panels, preferences, properties, selection_tools
from .viewport import drawing, selected_points, stroke_preparation, view_world
from .scene.source import source_travel, sync
from .scene.view import splat_engines, steady_effects

_classes = (preferences.classes + properties.classes + operators.classes + panels.classes + engine.classes
            + cycles_engine.classes)


def register():
    for cls in _classes:
        bpy.utils.register_class(cls)
    properties.register()
    panels.register()
    source_travel.register()
    sync.register()
    steady_effects.register()
    splat_engines.register()
    drawing.register()
    view_world.register()
    selected_points.register()
    stroke_preparation.register()
    selection_tools.register()


def unregister():
    selection_tools.unregister()
    stroke_preparation.unregister()
    selected_points.unregister()
    view_world.unregister()
    drawing.unregister()
    splat_engines.unregister()
    steady_effects.unregister()
    sync.unregister()
    source_travel.unregister()
    panels.unregister()
    properties.unregister()
    for cls in reversed(_classes):
        bpy.utils.unregister_class(cls)
