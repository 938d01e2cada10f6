# SPDX-License-Identifier: GPL-3.0-or-later
"""Render: how exact images are, in the viewport and in renders, side by side."""

import bpy

from ..binding import accuracy as native
from ..binding.errors import StippleError
from ..scene.source import sources
from ..scene.view import measured_quality, quality
from .render import SplatRenderPanel
from .text import draw_text


class STIPPLE_PT_quality(SplatRenderPanel, bpy.types.Panel):
    bl_label = "Quality"
    bl_options = set()

    def draw(self, context):
        layout = self.layout
        problem = sources.library_problem()
        if problem:
            draw_text(layout, context, problem, 'ERROR')
            return
        measured = measured_quality.of(context.scene)
        split = layout.row()
        for name, label, _ in quality.COLUMNS:
            settings = quality.column(context.scene, name)
            column = split.column()
            column.label(text=label)
            column.prop(settings, 'level', text="")
            if _is_changed(settings):
                column.label(text="By Hand", icon='INFO')
            _draw_figures(column, context, name, measured)
        if measured is not None:
            line = layout.row()
            line.active = measured_quality.is_current(context.scene, measured)
            draw_text(line, context, f"Measured by {measured.camera_name} at frame {measured.frame}", 'INFO')
        layout.operator('stipple.accuracy_measure', icon='TIME')
        _draw_compare(layout.column(align=True), context.scene.stipple)


class STIPPLE_PT_quality_knobs(SplatRenderPanel, bpy.types.Panel):
    bl_label = "Single Settings"
    bl_parent_id = 'STIPPLE_PT_quality'

    def draw(self, context):
        if sources.library_problem():
            return
        for knob in quality.knobs(sources.context().library):
            if knob.name not in quality.KNOBS:
                continue
            box = self.layout.box().column(align=True)
            box.label(text=knob.label)
            row = box.row(align=True)
            for name, label, _ in quality.COLUMNS:
                row.prop(quality.column(context.scene, name), quality.property_of(knob.name), text="")
            draw_text(box, context, knob.bound, is_quiet=True)


class STIPPLE_PT_quality_table(SplatRenderPanel, bpy.types.Panel):
    bl_label = "Table"
    bl_parent_id = 'STIPPLE_PT_quality'

    def draw(self, context):
        layout = self.layout
        measured = measured_quality.of(context.scene)
        if measured is None:
            layout.label(text="Nothing has been measured yet", icon='INFO')
            return
        layout.active = measured_quality.is_current(context.scene, measured)
        column = layout.column(align=True)
        for row in measured.report.rows:
            column.label(text=_sentence(row.name), icon='KEYTYPE_KEYFRAME_VEC' if row.is_on_front else 'BLANK1')
            for text in (f"{_time(row)}, {row.psnr:.1f} dB, \N{LESS-THAN OR EQUAL TO} {row.error_99_9:.2g}",
                         _verdict(row)):
                _draw_quiet(column, text)
        draw_text(layout, context,
                  "Marked: no other setting is as fast and as good. Time, PSNR, and what 99.9 % of the "
                  "pixels are within", 'KEYTYPE_KEYFRAME_VEC')
        line = layout.row(align=True)
        for by, text in (('TIME', "Best Within..."), ('QUALITY', "Cheapest Above...")):
            line.operator('stipple.accuracy_choose', text=text).by = by


class STIPPLE_PT_quality_plot(SplatRenderPanel, bpy.types.Panel):
    bl_label = "Plot"
    bl_parent_id = 'STIPPLE_PT_quality'

    def draw(self, context):
        image = measured_quality.plot_of(context.scene)
        if image is None:
            self.layout.label(text="Nothing has been measured yet", icon='INFO')
            return
        self.layout.template_icon(icon_value=image.preview_ensure().icon_id, scale=10.0)
        self.layout.operator('stipple.accuracy_show', icon='IMAGE_DATA')


def _draw_compare(layout, settings):
    layout.label(text="Compare")
    line = layout.row(align=True)
    for side in ('compare_first', 'compare_second'):
        line.prop(settings, side, text="")
    line = layout.row(align=True)
    for show, text, icon in (('WIPE', "Wipe", 'IMAGE_ALPHA'), ('ERROR', "Error × 10", 'IMAGE_DATA')):
        choice = line.operator('stipple.accuracy_compare', text=text, icon=icon)
        choice.show, choice.first, choice.second = show, settings.compare_first, settings.compare_second


def _draw_figures(layout, context, name, measured):
    """Words before numbers, or a dash."""
    row = measured_quality.row_of(context.scene, measured, name) if measured is not None else None
    column = layout.column(align=True)
    if row is None:
        column.label(text="Time: \N{EN DASH}")
        return
    column.active = measured_quality.is_current(context.scene, measured)
    for text in (_sentence(_verdict(row)), f"{_time(row)}, {row.psnr:.1f} dB"):
        draw_text(column, context, text, columns=len(quality.COLUMNS))


def _draw_quiet(layout, text):
    line = layout.row()
    line.active, line.scale_y = False, 0.8
    line.label(text=text, icon='BLANK1')


def _sentence(text):
    return text[:1].upper() + text[1:]


def _verdict(row):
    return native.accuracy_verdict(sources.context().library, row.psnr)


def _time(row):
    seconds = row.seconds
    text = f"{1000 * seconds:.3g} ms" if seconds < 1 else f"{seconds:.3g} s"
    return f"about {text}" if row.is_estimated else text


def _is_changed(settings):
    try:
        return quality.is_changed(sources.context().library, settings)
    except StippleError:
        return True


classes = (STIPPLE_PT_quality, STIPPLE_PT_quality_table, STIPPLE_PT_quality_plot, STIPPLE_PT_quality_knobs)
