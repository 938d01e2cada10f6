# SPDX-License-Identifier: GPL-3.0-or-later
"""Half or twice the budget."""

import bpy
from bpy.props import BoolProperty, FloatProperty

from ..scene.source import source_settings, sources, splat_data


class STIPPLE_OT_scale_budget(bpy.types.Operator):
    """Halve or double the number of splats"""

    bl_idname = 'stipple.scale_budget'
    bl_label = "Scale Budget"
    bl_options = {'REGISTER', 'UNDO'}

    factor: FloatProperty(name="Factor", description="What the number of splats is multiplied by", default=0.5, min=0.0)
    render: BoolProperty(name="Render", description="The budget of renders instead of the viewport's", default=False)

    @classmethod
    def poll(cls, context):
        if not splat_data.is_splat_object(context.object):
            return False
        stipple = context.object.data.stipple
        return stipple.is_sequence or source_settings.of(stipple).has_budget

    def execute(self, context):
        stipple = context.object.data.stipple
        mode = 'RENDER' if self.render else 'VIEWPORT'
        by_ratio = not source_settings.of(stipple).counts_anchors and stipple.budget_by == 'RATIO'
        name = 'ratio' if by_ratio else 'anchors'
        before = getattr(stipple, name + '_render') if self.render else getattr(stipple, name)
        if name == 'ratio':
            after = min(1.0, before * self.factor)
        elif stipple.is_sequence:
            after = max(1, round((before or stipple.anchors) * self.factor))
        else:
            shown = sources.decode_settings(stipple, mode).anchors
            after = max(1, round(shown * self.factor / 2.0 ** stipple.detail))
        setattr(stipple, name + '_render' if self.render else name, after)
        return {'FINISHED'}


classes = (STIPPLE_OT_scale_budget,)
