# SPDX-License-Identifier: GPL-3.0-or-later
"""Look at the splats of the present view: what effects does an image of them need?"""

import bpy

from ..binding.errors import StippleError
from ..scene.source import sources
from ..scene.view import rendered_view


class STIPPLE_OT_effects_look(bpy.types.Operator):
    bl_idname = 'stipple.effects_look'
    bl_label = "Look at This View"
    bl_description = "Examine the splats that the camera sees now, and say which effects an image of them needs"
    bl_options = {'REGISTER'}

    @classmethod
    def poll(cls, context):
        problem = sources.library_problem()
        if problem:
            cls.poll_message_set(problem)
        return not problem

    def execute(self, context):
        try:
            view = rendered_view.gather(context)
        except StippleError as error:
            self.report({'ERROR'}, str(error))
            return {'CANCELLED'}
        self.report({'INFO'}, f'{sum(row.is_on for row in view.rows)} of {len(view.rows)} effects are needed')
        return {'FINISHED'}


classes = (STIPPLE_OT_effects_look,)
