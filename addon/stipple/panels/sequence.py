# SPDX-License-Identifier: GPL-3.0-or-later
"""Object Data: timing of a series of splat files, and of splats that move."""

import os

import bpy

from ..binding.errors import StippleError
from ..scene.sequence import sequences
from ..scene.source import source_settings, sources, splat_data


class _TimingPanel:
    bl_space_type = 'PROPERTIES'
    bl_region_type = 'WINDOW'
    bl_context = 'data'


class STIPPLE_PT_sequence(_TimingPanel, bpy.types.Panel):
    bl_label = "Splat Sequence"

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


class STIPPLE_PT_motion(_TimingPanel, bpy.types.Panel):
    bl_label = "Splat Motion"

    @classmethod
    def poll(cls, context):
        obj = context.object
        return (splat_data.is_splat_object(obj) and not obj.data.stipple.is_sequence
                and source_settings.of(obj.data.stipple).has_time)

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        stipple, scene = context.object.data.stipple, context.scene
        known = source_settings.of(stipple)
        length = known.time_end - known.time_begin
        if length > 0:
            now = min(max(sources.seconds(stipple, scene), known.time_begin), known.time_end) - known.time_begin
            layout.label(text=f"{now:.2f} s of {length:.2f} s", icon='TIME')
        column = layout.column()
        column.enabled = not stipple.edited
        column.prop(stipple, 'frame_start')
        column.prop(stipple, 'frame_offset')
        column.prop(stipple, 'frame_speed')
        column.prop(stipple, 'time_mode')


def _shown(data, frame):
    """(text, icon) for the file of a frame."""
    try:
        path = sequences.path_at(data, data.stipple, frame)
    except StippleError:
        return "File is missing", 'ERROR'
    if not path:
        return "Nothing at this frame", 'INFO'
    return os.path.basename(path), 'FILE'


classes = (STIPPLE_PT_sequence, STIPPLE_PT_motion)
