# SPDX-License-Identifier: GPL-3.0-or-later
"""Show a tab of the properties editor, where the switch of an effect is."""

import bpy
from bpy.props import EnumProperty

TABS = (('RENDER', "Render", ""), ('VIEW_LAYER', "View Layer", ""),
        ('DATA', "Object Data", "The switch is in the camera's data"))


class STIPPLE_OT_show_setting(bpy.types.Operator):
    bl_idname = 'stipple.show_setting'
    bl_label = "Show Setting"
    bl_description = "Show the tab of the properties editor that has the switch of this effect"
    bl_options = {'INTERNAL'}

    tab: EnumProperty(items=TABS)

    def execute(self, context):
        space = context.space_data
        if space is None or space.type != 'PROPERTIES':
            space = next((area.spaces.active for area in (context.screen.areas if context.screen else ())
                          if area.type == 'PROPERTIES'), None)
        if self.tab == 'DATA':
            camera = context.scene.camera
            if camera is None:
                self.report({'ERROR'}, "The scene has no camera")
                return {'CANCELLED'}
            if camera.name in context.view_layer.objects:
                context.view_layer.objects.active = camera
        if space is not None:
            space.context = self.tab
        return {'FINISHED'}


classes = (STIPPLE_OT_show_setting,)
