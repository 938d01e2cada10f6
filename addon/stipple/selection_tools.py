# SPDX-License-Identifier: GPL-3.0-or-later
"""Tools that select splats, in the toolbar of 3D views in Object Mode. Their keys are theirs while they are active."""

import bpy

from .scene import selection_settings

_GROW, _LESS = 1.1, 1 / 1.1
_RADIUS = 'scene.stipple.selection.radius'


def _keys_of(operator, *more):
    """The left button, with each of the keys that choose an operation."""
    modifiers = ({}, {'shift': True}, {'ctrl': True}, {'shift': True, 'ctrl': True})
    return (*((operator, {'type': 'LEFTMOUSE', 'value': 'PRESS', **held}, None) for held in modifiers), *more)


def _draw(context, layout, *names):
    """Settings in the header."""
    settings = selection_settings.of(context.scene)
    row = layout.row(align=True)
    for operation, icon in selection_settings.OPERATION_ICONS.items():
        row.prop_enum(settings, 'operation', operation, text="", icon=icon)
    for name in names:
        layout.prop(settings, name)


class _Tool(bpy.types.WorkSpaceTool):
    bl_space_type = 'VIEW_3D'
    bl_context_mode = 'OBJECT'


class BrushTool(_Tool):
    bl_idname = 'stipple.select_brush'
    bl_label = "Select Splats: Brush"
    bl_description = "Select the splats of the selected objects along a stroke"
    bl_icon = 'ops.generic.select_paint'
    bl_keymap = _keys_of(
        bl_idname, ('wm.radial_control', {'type': 'F', 'value': 'PRESS'},
                    {'properties': [('data_path_primary', _RADIUS)]}),
        *(('wm.context_scale_float', {'type': key, 'value': 'PRESS'},
           {'properties': [('data_path', _RADIUS), ('value', factor)]})
          for key, factor in (('LEFT_BRACKET', _LESS), ('RIGHT_BRACKET', _GROW))))

    @staticmethod
    def draw_settings(context, layout, _tool):
        _draw(context, layout, 'radius', 'front_only')

    @staticmethod
    def draw_cursor(context, _tool, xy):
        from .viewport import stroke_marks  # background Blender may have no graphics at all
        stroke_marks.draw_brush_circle(xy, selection_settings.of(context.scene).radius)


class LassoTool(_Tool):
    bl_idname = 'stipple.select_lasso'
    bl_label = "Select Splats: Lasso"
    bl_description = "Select the splats of the selected objects inside an outline"
    bl_icon = 'ops.generic.select_lasso'
    bl_keymap = _keys_of(bl_idname)

    @staticmethod
    def draw_settings(context, layout, _tool):
        _draw(context, layout, 'front_only')


class SphereTool(_Tool):
    bl_idname = 'stipple.select_sphere'
    bl_label = "Select Splats: Sphere"
    bl_description = "Select the splats of the selected objects inside a sphere: press on the splats, drag its radius"
    bl_icon = 'ops.generic.select_circle'
    bl_keymap = _keys_of(bl_idname)

    @staticmethod
    def draw_settings(context, layout, _tool):
        _draw(context, layout)


class ColorTool(_Tool):
    bl_idname = 'stipple.select_color'
    bl_label = "Select Splats: Color"
    bl_description = "Select the splats of the selected objects that have the color of a click"
    bl_icon = 'ops.paint.weight_sample'
    bl_keymap = _keys_of(bl_idname)

    @staticmethod
    def draw_settings(context, layout, _tool):
        _draw(context, layout, 'tolerance', 'within')


_TOOLS = (BrushTool, LassoTool, SphereTool, ColorTool)
# What buttons of panels call them.
NAMES = tuple((tool.bl_idname, tool.bl_label.partition(': ')[2]) for tool in _TOOLS)


def register():
    # Without a window there is no toolbar, and no keys.
    if not bpy.app.background:
        for i, tool in enumerate(_TOOLS):
            after = {_TOOLS[i - 1].bl_idname} if i else {'builtin.select_lasso'}
            bpy.utils.register_tool(tool, after=after, separator=i == 0, group=i == 0)


def unregister():
    if not bpy.app.background:
        for tool in reversed(_TOOLS):
            bpy.utils.unregister_tool(tool)
