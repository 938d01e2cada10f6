# SPDX-License-Identifier: GPL-3.0-or-later
"""Object Data: timing of a series of splat files."""

import os

import bpy

from ..binding.errors import StippleError
from ..scene.sequence import sequences
from ..scene.source import source_settings, splat_data


class STIPPLE_PT_sequence(bpy.types.Panel):
    bl_label = "Splat Sequence"
    bl_space_type = 'PROPERTIES'
    bl_region_type = 'WINDOW'
    bl_context = 'data'

    @classmethod
    def poll(cls, context):
        return splat_data.is_splat_object(context.object) and context.object.data.stipple.is_sequence

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        data = context.object.data
        stipple = data.stipple
        text, icon = _shown(data, context.scene.frame_current)
        layout.label(text=text, icon=icon)
        column = layout.column()
        column.enabled = not stipple.edited
        column.prop(stipple, 'frame_duration')
        column.prop(stipple, 'frame_start')
        column.prop(stipple, 'frame_offset')
        column.prop(stipple, 'frame_speed')
        column.prop(stipple, 'sequence_mode')
        column.prop(stipple, 'missing_frames')
        if source_settings.of(stipple).as_they_are:
            layout.operator('stipple.prepare_budgets', icon='MOD_DECIM')


def _shown(data, frame):
    """(text, icon) for the file of a frame."""
    try:
        path = sequences.path_at(data, data.stipple, frame)
    except StippleError:
        return "File is missing", 'ERROR'
    if not path:
        return "Nothing at this frame", 'INFO'
    return os.path.basename(path), 'FILE'


classes = (STIPPLE_PT_sequence,)
