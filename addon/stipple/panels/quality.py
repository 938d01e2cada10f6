# SPDX-License-Identifier: GPL-3.0-or-later
"""Render: how exact pictures are, in the viewport and in renders, side by side."""

import bpy

from ..binding import accuracy as native
from ..binding.errors import StippleError
from ..scene import measured_quality, quality, sources
from .effects import draw_text
from .render import SplatRenderPanel


class STIPPLE_PT_quality(SplatRenderPanel, bpy.types.Panel):
    bl_label = "Quality"
    bl_options = set()

    def draw(self, context):
        layout = self.layout
        problem = sources.library_problem()
        if problem:
            layout.label(text=problem, icon='ERROR')
            return
        measured = measured_quality.of(context.scene)
        split = layout.row()
        for name, label, _ in quality.COLUMNS:
            settings = quality.column(context.scene, name)
            column = split.column()
            column.label(text=label)
            column.prop(settings, 'level', text="")
            if _is_changed(settings):
                column.label(text="Changed by hand", icon='INFO')
            _draw_figures(column, context.scene, name, measured)
        if measured is not None:
            line = layout.row()
            line.active = measured_quality.is_current(context.scene, measured)
            line.label(text=f"Measured by {measured.camera_name} at frame {measured.frame}", icon='INFO')
        line = layout.row(align=True)
        line.operator('stipple.accuracy_measure', icon='TIME')
        line.operator('stipple.accuracy_compare', icon='IMAGE_ALPHA')


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
                row.prop(quality.column(context.scene, name), knob.name, text="")
            draw_text(box, context, knob.bound)


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
        grid = layout.grid_flow(row_major=True, columns=5, align=True)
        for title in ("Setting", "Looks", "Time", "PSNR", "99.9 % within"):
            grid.label(text=title)
        for row in measured.report.rows:
            grid.label(text=row.name, icon='KEYTYPE_KEYFRAME_VEC' if row.is_on_front else 'BLANK1')
            grid.label(text=_verdict(row))
            grid.label(text=_time(row))
            grid.label(text=f"{row.psnr:.1f} dB")
            grid.label(text=f"{row.error_99_9:.2g}")
        layout.label(text="Marked: no other setting is as fast and as good", icon='KEYTYPE_KEYFRAME_VEC')
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
        self.layout.template_icon(icon_value=image.preview_ensure().icon_id, scale=12.0)
        self.layout.label(text=f"Image '{image.name}'", icon='IMAGE_DATA')


def _draw_figures(layout, scene, name, measured):
    """Words before numbers, or a dash."""
    row = measured_quality.row_of(scene, measured, name) if measured is not None else None
    column = layout.column(align=True)
    if row is None:
        column.label(text="Time: \N{EN DASH}")
        return
    column.active = measured_quality.is_current(scene, measured)
    column.label(text=_verdict(row).capitalize())
    column.label(text=f"{_time(row)}, {row.psnr:.1f} dB")


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
