# SPDX-License-Identifier: GPL-3.0-or-later
"""Shows scene colours as they are, so that As Trained equals other viewers."""

import bpy


class STIPPLE_OT_use_standard_view(bpy.types.Operator):
    """Set the view transform to Standard without look, exposure, gamma or curves"""

    bl_idname = 'stipple.use_standard_view'
    bl_label = "Use Standard"
    bl_options = {'REGISTER', 'UNDO'}

    def execute(self, context):
        view = context.scene.view_settings
        view.view_transform = 'Standard'
        view.look = 'None'
        view.exposure = 0.0
        view.gamma = 1.0
        view.use_curve_mapping = False
        return {'FINISHED'}


classes = (STIPPLE_OT_use_standard_view,)
