# SPDX-License-Identifier: GPL-3.0-or-later
"""Render: which effects the image has, why, and what they cost."""

import bpy

from ..binding.errors import StippleError
from ..scene.source import sources
from ..scene.view import effects
from .render import SplatRenderPanel
from .text import draw_text


def _rows(context):
    """([EffectRow], what was looked at or None, what is wrong). Reads settings only: nothing is drawn or measured."""
    seen = effects.look_of(context.scene)
    problem = sources.library_problem()
    if problem:
        return [], None, problem
    try:
        return effects.plan(sources.context().library, context.scene, context.view_layer,
                            context.view_layer.depsgraph, seen), seen, ''
    except StippleError as error:
        return [], seen, str(error)


class STIPPLE_PT_effects(SplatRenderPanel, bpy.types.Panel):
    bl_label = "Effects"
    bl_options = set()

    def draw(self, context):
        layout = self.layout
        rows, seen, problem = _rows(context)
        if problem:
            draw_text(layout, context, problem, 'ERROR')
            return
        for row in rows:
            if row.is_on:
                _draw_row(layout, context, row, seen)
        column = layout.column(align=True)
        column.operator('stipple.effects_look', icon='HIDE_OFF')
        column.operator('stipple.effects_measure', icon='TIME')
        if seen is not None:
            is_old = (seen.camera_name, seen.frame) != (_camera_name(context.scene), context.scene.frame_current)
            line = layout.row()
            line.active = not is_old
            draw_text(line, context, f"Seen by {seen.camera_name} at frame {seen.frame}", 'INFO')


class STIPPLE_PT_effects_inactive(SplatRenderPanel, bpy.types.Panel):
    bl_label = ""
    bl_parent_id = 'STIPPLE_PT_effects'

    def draw_header(self, context):
        count = sum(not row.is_on for row in _rows(context)[0])
        self.layout.label(text=f"Not Needed ({count})")

    def draw(self, context):
        rows, seen, _ = _rows(context)
        for row in rows:
            if not row.is_on:
                _draw_row(self.layout, context, row, seen)


class STIPPLE_PT_effects_settings(SplatRenderPanel, bpy.types.Panel):
    bl_label = "Settings"
    bl_parent_id = 'STIPPLE_PT_effects'

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(context.scene.stipple, 'blur_samples')


def _draw_row(layout, context, row, seen):
    box = layout.box().column(align=True)
    head = box.row(align=True)
    head.label(text=effects.NAMES[row.effect], icon='CHECKMARK' if row.is_on else 'REMOVE')
    cost = head.row()
    cost.alignment = 'RIGHT'
    cost.active = seen is not None and effects.is_current(context.scene, seen)
    cost.label(text=_cost(row))
    chosen_by = effects.CHOSEN_BY.get(row.effect)
    if chosen_by is not None:
        box.row(align=True).prop(context.scene.stipple, chosen_by, expand=True)
    elif row.effect in effects.TABS:
        jump = head.operator('stipple.show_setting', text="", icon='RIGHTARROW', emboss=False)
        jump.tab = effects.TABS[row.effect]
    draw_text(box, context, row.reason, is_quiet=True)


def _cost(row):
    if not row.is_measured:
        return "\N{EN DASH}"
    return f"+{row.seconds:.3g} s" if row.seconds > 0 else "about 0 s"


def _camera_name(scene):
    return scene.camera.name if scene.camera is not None else ''


classes = (STIPPLE_PT_effects, STIPPLE_PT_effects_inactive, STIPPLE_PT_effects_settings)
