# SPDX-License-Identifier: GPL-3.0-or-later
"""Chooses a render engine that draws splats."""

import bpy
from bpy.props import EnumProperty

from ..scene.view import splat_engines


class STIPPLE_OT_use_engine(bpy.types.Operator):
    """Set the scene's render engine to one that draws Gaussian splats"""

    bl_idname = 'stipple.use_engine'
    bl_label = "Use Engine"
    bl_options = {'REGISTER', 'UNDO'}

    engine: EnumProperty(name="Engine", description="The render engine to use", items=splat_engines.ENGINES,
                         default=splat_engines.CYCLES)

    def execute(self, context):
        context.scene.render.engine = self.engine
        return {'FINISHED'}


classes = (STIPPLE_OT_use_engine,)
