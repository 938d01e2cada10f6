# SPDX-License-Identifier: GPL-3.0-or-later
"""Overlays: what splats are coloured by in the 3D view."""

import bpy

from .. import version
from ..scene import overlays


class STIPPLE_PT_overlay(bpy.types.Panel):
    bl_label = "Gaussian Splats"
    bl_space_type = 'VIEW_3D'
    bl_region_type = 'HEADER'
    bl_parent_id = 'VIEW3D_PT_overlay'

    def draw(self, context):
        layout = self.layout
        layout.active = context.space_data.overlay.show_overlays
        settings = overlays.settings_of(context.scene)
        if version.HAS_NATIVE_SPLATS:
            layout.label(text="Blender draws these splats by itself", icon='INFO')
            return
        layout.prop(settings, 'kind')
        if settings.kind in overlays.UNITS:
            layout.prop(settings, 'auto_range')
            if not settings.auto_range:
                row = layout.row(align=True)
                row.prop(settings, 'low')
                row.prop(settings, 'high')
        if context.space_data.shading.type == 'RENDERED' and context.engine == 'STIPPLE':
            layout.label(text="Not in Rendered shading by Stipple", icon='INFO')


classes = (STIPPLE_PT_overlay,)
