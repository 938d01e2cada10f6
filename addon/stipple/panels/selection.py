# SPDX-License-Identifier: GPL-3.0-or-later
"""Selecting splats and what is done with them, under Clean Up."""

import bpy

from .. import selection_tools
from ..scene import selection_settings
from ..scene.source import selecting, splat_data
from .text import draw_text


class STIPPLE_PT_select(bpy.types.Panel):
    bl_label = "Select"
    bl_space_type = 'PROPERTIES'
    bl_region_type = 'WINDOW'
    bl_context = 'data'
    bl_parent_id = 'STIPPLE_PT_clean_up'
    bl_options = {'DEFAULT_CLOSED'}

    @classmethod
    def poll(cls, context):
        return splat_data.is_splat_object(context.object)

    def draw(self, context):
        layout = self.layout
        data = context.object.data
        counts = selecting.counts(data)
        total, selected = counts or (selecting.selectable_count(data), 0)
        draw_text(layout, context, f"{selected:,} of {total:,} splats selected")
        _draw_tools(layout)
        draw_settings(layout, context)
        row = layout.row(align=True)
        for action, text in (('SELECT', "All"), ('DESELECT', "None"), ('INVERT', "Invert")):
            row.operator('stipple.select_all', text=text).action = action
        row = layout.row(align=True)
        row.operator('stipple.select_grow', text="Grow")
        row.operator('stipple.select_shrink', text="Shrink")
        column = layout.column(align=True)
        column.operator_context = 'INVOKE_DEFAULT'
        column.operator('stipple.erase_selected', text="Erase", icon='HIDE_ON')
        column.operator('stipple.keep_selected', text="Keep Only")
        column.operator('stipple.separate_selected', text="Separate")
        column.operator('stipple.fill_erased', text="Fill")


def _draw_tools(layout):
    """Buttons that choose a tool of the toolbar of 3D views."""
    grid = layout.grid_flow(row_major=True, columns=2, even_columns=True, align=True)
    for name, text in selection_tools.NAMES:
        tool = grid.operator('wm.tool_set_by_id', text=text)
        tool.name, tool.space_type = name, 'VIEW_3D'


def draw_settings(layout, context):
    settings = selection_settings.of(context.scene)
    column = layout.column()
    column.use_property_split = True
    column.use_property_decorate = False
    for name in ('radius', 'front_only'):
        column.prop(settings, name)
    row = column.row()
    row.enabled = settings.front_only
    row.prop(settings, 'through_meshes')
    for name in ('tolerance', 'within'):
        column.prop(settings, name)


classes = (STIPPLE_PT_select,)
