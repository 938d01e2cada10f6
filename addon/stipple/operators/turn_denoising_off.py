# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders of a Cycles that was built without a denoiser fail while denoising is on."""

import bpy


class STIPPLE_OT_turn_denoising_off(bpy.types.Operator):
    """Turn Denoise off for renders of this scene, because this Blender was built without a denoiser"""

    bl_idname = 'stipple.turn_denoising_off'
    bl_label = "Turn Denoising Off"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context):
        return hasattr(context.scene, 'cycles')

    def execute(self, context):
        context.scene.cycles.use_denoising = False
        return {'FINISHED'}


classes = (STIPPLE_OT_turn_denoising_off,)
