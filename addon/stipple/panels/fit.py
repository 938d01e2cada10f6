# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tab of the 3D view: fitting splats to views."""

import bpy

from ..operators import show_report, splats_fit
from ..scene import fitting


class _FitPanel:
    bl_space_type = 'VIEW_3D'
    bl_region_type = 'UI'
    bl_category = "Stipple"


class STIPPLE_PT_fit(_FitPanel, bpy.types.Panel):
    bl_label = "Fit Splats"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        settings = context.scene.stipple.fit
        column = layout.column()
        column.enabled = not fitting.state.is_running
        _draw_views(column, settings)
        column.separator()
        column.prop(settings, 'max_splats')
        column.prop(settings, 'quality')
        column.prop(settings, 'view_dependent')
        if fitting.state.is_running:
            _draw_running(layout, fitting.state)
            return
        if splats_fit.proposed(context) is not None:
            row = layout.row(align=True)
            row.operator('stipple.fit_accept', icon='CHECKMARK')
            row.operator('stipple.fit_discard', icon='X')
        else:
            layout.operator('stipple.splats_fit', icon='OUTLINER_DATA_POINTCLOUD')
        if fitting.state.problem:
            layout.label(text=fitting.state.problem, icon='ERROR')
        elif fitting.state.figures is not None:
            _draw_figures(layout, fitting.state.figures)
        if show_report.reported(context) is not None:
            layout.operator('stipple.show_report', icon='GRAPH')


class STIPPLE_PT_fit_advanced(_FitPanel, bpy.types.Panel):
    bl_label = "Advanced"
    bl_parent_id = 'STIPPLE_PT_fit'
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.enabled = not fitting.state.is_running
        settings = context.scene.stipple.fit
        layout.prop(settings, 'model')
        if settings.model == 'FIELD':
            layout.prop(settings, 'density_gradient')
        else:
            layout.prop(settings, 'strategy')
        layout.prop(settings, 'seed')
        layout.prop(settings, 'report')


def _draw_views(layout, settings):
    layout.prop(settings, 'views_from')
    if settings.views_from == 'DATASET':
        layout.prop(settings, 'dataset')
        layout.prop(settings, 'downscale')
        return
    if settings.views_from == 'RIG':
        layout.prop(settings, 'rig')
        layout.prop(settings, 'view_count')
    layout.prop(settings, 'view_size')
    layout.prop(settings, 'engine')
    if settings.engine != 'WORKBENCH':
        layout.prop(settings, 'samples')
    layout.prop(settings, 'transparent')


def _draw_running(layout, state):
    layout.label(text=state.stage, icon='TIME')
    if state.figures is not None:
        _draw_figures(layout, state.figures)
    layout.label(text="Esc keeps the best so far")


def _draw_figures(layout, figures):
    column = layout.column(align=True)
    column.label(text=f"Step {figures.iteration:,} of {figures.iterations:,}")
    column.label(text=f"{figures.splat_count:,} splats")
    if figures.psnr == figures.psnr:
        column.label(text=f"{figures.psnr:.1f} dB held out, best {figures.best_psnr:.1f} dB")
    if figures.estimated_bytes:
        column.label(text=f"About {figures.estimated_seconds:.0f} s in all, {figures.estimated_bytes / 2**20:,.0f} MiB")
    if 0 < figures.iteration < figures.iterations:
        column.label(text=f"{figures.seconds_left:.0f} s left")


classes = (STIPPLE_PT_fit, STIPPLE_PT_fit_advanced)
