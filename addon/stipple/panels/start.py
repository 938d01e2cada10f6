# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tab of the 3D view, first of all: where splats come from and what becomes of them."""

import bpy

from ..scene.source import splat_data


class STIPPLE_PT_start(bpy.types.Panel):
    bl_space_type = 'VIEW_3D'
    bl_region_type = 'UI'
    bl_category = "Stipple"
    bl_label = "Gaussian Splats"

    def draw(self, context):
        layout = self.layout
        layout.operator_context = 'INVOKE_DEFAULT'
        column = layout.column(align=True)
        column.operator('stipple.splats_import', text="Import", icon='IMPORT')
        column.operator('stipple.splats_from_mesh', text="From Selected Meshes", icon='MESH_DATA')
        if not splat_data.is_splat_object(context.object):
            return
        column = layout.column(align=True)
        column.operator('stipple.splats_export', text="Export", icon='EXPORT')
        column.operator('stipple.splats_to_volume', text="To Volume", icon='OUTLINER_DATA_VOLUME')
        column.operator('stipple.splats_to_mesh', text="To Mesh", icon='OUTLINER_OB_MESH')


classes = (STIPPLE_PT_start,)
