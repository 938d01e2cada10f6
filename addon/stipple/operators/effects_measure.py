# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure what each active effect takes in the present view."""

import bpy

from ..jobs import JobOperator
from ..scene.view import effect_costs, effects, rendered_view


class STIPPLE_OT_effects_measure(JobOperator, bpy.types.Operator):
    """Draw the present view with and without each active effect, and show how much time each takes"""

    bl_idname = 'stipple.effects_measure'
    bl_label = "Measure Costs"
    bl_options = {'REGISTER'}

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, context):
        self._scene = context.scene
        self._view = rendered_view.gather(context)
        return effect_costs.start(context.scene, self._view)

    def finish(self, context, job):
        seen = self._view.seen
        seen.seconds, seen.settings = job.result, effects.settings_of(self._scene)
        effects.remember(self._scene, seen)
        self.report({'INFO'}, f'{len(seen.seconds)} effects measured')
        for area in (context.screen.areas if context.screen else ()):
            area.tag_redraw()


classes = (STIPPLE_OT_effects_measure,)
