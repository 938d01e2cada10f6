# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tab of the 3D view: fitting splats to views."""

import bpy

from ..binding.errors import StippleError
from ..operators import show_report
from ..scene.fit import fit_proposal, fitting, series, strategies, view_pace, view_task
from ..scene.source import splat_data
from .text import draw_text


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
        settings, state = context.scene.stipple.fit, fitting.state
        column = layout.column()
        column.enabled = not state.is_running
        _draw_views(column, context, settings)
        column.separator()
        column.prop(settings, 'max_splats')
        column.prop(settings, 'quality')
        _draw_switch(column, settings, 'view_dependent')
        layout.separator()
        if state.is_running:
            _draw_running(layout, settings, state)
            _draw_shown(layout, context)
            return
        if fit_proposal.find(context) is not None:
            _draw_result(layout, state)
            _draw_shown(layout, context)
            row = layout.row(align=True)
            row.scale_y = 1.3
            row.operator('stipple.fit_accept', icon='CHECKMARK')
            row.operator('stipple.fit_discard', icon='X')
        else:
            row = layout.row()
            row.scale_y = 1.3
            row.operator('stipple.splats_fit', icon='OUTLINER_DATA_POINTCLOUD')
            if state.problem:
                _draw_problem(layout, context, state.problem)
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
        if settings.model == 'EXPLICIT':
            layout.prop(settings, 'begin_with')
        if settings.model == 'FIELD':
            _draw_switch(layout, settings, 'density_gradient')
            layout.prop(settings, 'shell')
        elif settings.model == 'RELAY':
            layout.prop(settings, 'key_frame_spacing')
        elif settings.model != 'SCAFFOLD':
            _draw_strategy(layout, context, settings)
        layout.prop(settings, 'seed')
        layout.prop(settings, 'report')
        layout.prop(settings, 'checkpoint')
        row = layout.row()
        row.active = fitting.has_checkpoint(settings)
        _draw_switch(row, settings, 'resume')


class STIPPLE_PT_densify(_FitPanel, bpy.types.Panel):
    bl_label = "Densify"
    bl_parent_id = 'STIPPLE_PT_fit'
    bl_options = {'DEFAULT_CLOSED'}

    @classmethod
    def poll(cls, context):
        return splat_data.is_splat_object(context.object)

    def draw(self, context):
        layout = self.layout
        layout.enabled = not fitting.state.is_running
        chosen = strategies.text_of(context.scene.stipple.fit)
        draw_text(layout, context,
                  f"Splits, copies and removes splats of '{context.object.name}' where the views above "
                  f"ask for it, as the strategy in Advanced says: {chosen}")
        layout.operator('stipple.splats_densify', icon='OUTLINER_DATA_POINTCLOUD')
        layout.operator('stipple.add_detail', icon='MOD_MULTIRES')


def _draw_strategy(layout, context, settings):
    layout.prop(settings, 'strategy')
    sentence = strategies.summary(settings)
    if sentence:
        draw_text(layout, context, sentence)
    column = layout.column(align=True)
    column.use_property_split = False
    for name, title, _sentence, _bit in strategies.part_items():
        is_chosen = name in settings.parts
        column.prop_enum(settings, 'parts', name, text=title, icon='CHECKBOX_HLT' if is_chosen else 'CHECKBOX_DEHLT')
    problem = strategies.problem(strategies.text_of(settings))
    if problem:
        _draw_problem(layout, context, problem)


def _draw_views(layout, context, settings):
    layout.prop(settings, 'views_from')
    if settings.views_from == 'DATASET':
        layout.prop(settings, 'dataset')
        layout.prop(settings, 'up_axis')
        layout.prop(settings, 'downscale')
        if settings.model in series.MOVING_MODELS:
            _draw_series(layout, settings)
        row = layout.row()
        row.enabled = bool(settings.dataset)
        row.operator_context = 'EXEC_DEFAULT'  # the folder is chosen
        shown = row.operator('stipple.cameras_import', text="Show Cameras", icon='CAMERA_DATA')
        shown.filepath, shown.up_axis = settings.dataset, settings.up_axis
        return
    if settings.views_from == 'RIG':
        layout.prop(settings, 'rig')
        layout.prop(settings, 'view_count', text="Cameras" if settings.model in series.MOVING_MODELS else "Count")
    if settings.model in series.MOVING_MODELS:
        _draw_times(layout, context, settings)
    layout.prop(settings, 'view_size')
    layout.prop(settings, 'engine')
    if settings.engine != 'WORKBENCH':
        layout.prop(settings, 'samples')
    _draw_switch(layout, settings, 'transparent')


def _draw_times(layout, context, settings):
    """Of splats that move: which frames, and how many images that makes."""
    _draw_switch(layout, settings, 'scene_range')
    if not settings.scene_range:
        column = layout.column(align=True)
        column.prop(settings, 'range_start')
        column.prop(settings, 'range_end')
    layout.prop(settings, 'frame_step')
    layout.prop(settings, 'image_count')
    layout.prop(settings, 'held_out_cameras')
    try:
        plan = fitting.plan_of(context, settings)
    except StippleError as error:
        _draw_problem(layout, context, str(error))
        return
    seconds = view_pace.expected(view_task.capture_settings(settings), plan.image_count)
    draw_text(layout, context, str(plan) + ('' if seconds is None else f', about {duration(seconds)}'))
    layout.separator()


def _draw_series(layout, settings):
    """Of photographs of things that move: which frames are used."""
    _draw_switch(layout, settings, 'series_whole')
    if not settings.series_whole:
        column = layout.column(align=True)
        column.prop(settings, 'series_first')
        column.prop(settings, 'series_last')
    for name in ('series_step', 'series_rate', 'image_count', 'held_out_names'):
        layout.prop(settings, name)


def _draw_switch(layout, settings, name):
    """Over the whole width: half of a sidebar cuts its words off."""
    row = layout.row()
    row.use_property_split = False
    row.prop(settings, name)


def _draw_running(layout, settings, state):
    column = layout.column()
    column.label(text=state.stage)
    if hasattr(column, 'progress'):
        column.progress(factor=state.fraction, text=f'{state.fraction:.0%}', type='BAR')
    else:
        column.use_property_split = False
        bar = column.row()
        bar.prop(settings, 'progress', text="", slider=True)
    figures = state.figures
    rows = []
    if state.seconds_left >= 1:
        rows.append(("Time Left", duration(state.seconds_left)))
    elif state.views_left >= 1:
        rows.append(("Views", f'ready in {duration(state.views_left)}'))
    if figures is not None and figures.iteration:
        rows.append(("Step", f'{figures.iteration:,} of {figures.iterations:,}'))
        rows.append(("Splats", f'{figures.splat_count:,}'))
        rows.append(("Loss", f'{figures.loss:.4f}'))
        if figures.psnr == figures.psnr:
            best = '' if figures.psnr >= figures.best_psnr else f', best {figures.best_psnr:.1f}'
            rows.append((_measured(figures), f'{figures.psnr:.1f} dB{best}'))
        rows += _moving_rows(figures)
        if figures.estimated_bytes:
            rows.append(("Estimate", f'{duration(figures.estimated_seconds)}, {size(figures.estimated_bytes)}'))
    _draw_rows(layout, rows)
    if figures is None:
        layout.label(text="Esc cancels", icon='EVENT_ESC')
    else:
        layout.operator('stipple.fit_stop', icon='EVENT_ESC')


def _draw_result(layout, state):
    figures = state.figures
    layout.label(text="Not accepted yet", icon='INFO')
    if figures is None:
        return
    rows = [("Splats", f'{state.kept_count:,}'), ("Steps", f'{figures.iteration:,}'),
            ("Fitted In", duration(figures.seconds))]
    if figures.best_psnr == figures.best_psnr:
        rows[:0] = [(_measured(figures), f'{figures.best_psnr:.1f} dB'), *_moving_rows(figures)]
    _draw_rows(layout, rows)


def _moving_rows(figures):
    """Of the best state: the pixels in which something moves."""
    known = figures.best_moving_psnr == figures.best_moving_psnr
    return [("What Moves", f'{figures.best_moving_psnr:.1f} dB')] if known else []


def _measured(figures):
    return "On Views" if figures.measured_on_training else "Held Out"


def _draw_shown(layout, context):
    if fit_proposal.comparable(context) is not None:
        row = layout.row(align=True)
        row.use_property_split = False
        row.prop(context.scene.stipple.fit, 'shown', expand=True)


def _draw_rows(layout, rows):
    """Names on the left, as settings have them."""
    column = layout.column(align=True)
    for name, value in rows:
        split = column.split(factor=0.4)
        left = split.column()
        left.alignment = 'RIGHT'
        left.label(text=name)
        split.label(text=value)


def _draw_problem(layout, context, problem):
    draw_text(layout, context, problem, 'ERROR')


def duration(seconds):
    if seconds < 90:
        return f'{seconds:.0f} s'
    if seconds < 90 * 60:
        return f'{seconds / 60:.0f} min'
    return f'{seconds / 3600:.1f} h'


def size(count):
    return f'{count / 2**20:,.0f} MiB' if count < 2**30 else f'{count / 2**30:.1f} GiB'


classes = (STIPPLE_PT_fit, STIPPLE_PT_fit_advanced, STIPPLE_PT_densify)
