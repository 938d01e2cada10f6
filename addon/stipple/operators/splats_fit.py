# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats are fitted to views of the scene, or to photographs."""

import time

import bpy
from bpy.props import BoolProperty, StringProperty

from .. import version
from ..jobs import JobOperator, ViewsFirst
from ..scene import overlays
from ..scene.fit import fit_proposal, fit_reports, fitting
from ..scene.source import source_paths, sources, splat_data, sync

_PREVIEW_SECONDS = 1.5


class STIPPLE_OT_splats_fit(ViewsFirst, JobOperator, bpy.types.Operator):
    """Make splats that look like renders of the selected objects, or like the photographs of a data set. Esc keeps the
    best so far"""

    bl_idname = 'stipple.splats_fit'
    bl_label = "Fit Splats"
    bl_options = {'UNDO'}

    source_path: StringProperty(name="Source Path", description="File to keep the splats' source in, empty for a place "
                                "beside the .blend file", subtype='FILE_PATH',
                                options={'SKIP_SAVE'} | version.RELATIVE_PATH)

    _preview = ''
    _shown_at = 0.0

    @classmethod
    def poll(cls, context):
        if fitting.state.is_running:
            cls.poll_message_set('A fit is running')
            return False
        waiting = fit_proposal.find(context)
        if waiting is not None:
            cls.poll_message_set(f"'{waiting.name}' waits to be accepted or discarded")
            return False
        return context.mode == 'OBJECT'

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, context):
        settings = context.scene.stipple.fit
        objects = [] if settings.views_from == 'DATASET' else fitting.seen_objects(context)
        return fitting.FitTask(context, objects, settings, self.source_path and source_paths.absolute(self.source_path))

    @property
    def escape_text(self):
        return 'Esc cancels' if self._job.holds_scene else 'Esc keeps the best so far'

    def modal(self, context, event):
        result = super().modal(context, event)
        if self._job is not None and event.type == 'TIMER':
            self._show(context)
            _redraw(context)
        return result

    def cancel(self, context):
        super().cancel(context)
        self._remove_preview()

    def finish(self, context, job):
        result = job.result
        obj = bpy.data.objects.get(self._preview) if self._preview else None
        if obj is None:
            obj = self._new_object(context)
        stipple = obj.data.stipple
        with sync.paused():
            sources.attach_asset(obj.data, result.path, result.settings)
            stipple.ratio = stipple.ratio_render = 1.0
            stipple.seed = result.decoding.seed
            if result.clip_start is not None:
                stipple.frame_start, stipple.frame_offset, stipple.frame_speed = result.clip_start, 0, 1.0
                stipple.time_mode = 'HOLD'
        if result.clip_start is None:
            sync.write_decoded(obj.data, result.splats)
        else:
            # As they are at the present frame of the scene.
            now = sources.model(result.path).decode(sources.decode_settings(stipple, scene=context.scene)).read()
            now.seen = result.splats.seen
            sync.write_decoded(obj.data, now)
        fit_proposal.remember_key_frames(obj, result.key_frames)
        report = fit_reports.keep(obj.data, obj.name, result.report)
        if bpy.app.background:
            fit_proposal.accept(context, obj, hide_source=False)
        else:
            fit_proposal.propose(obj)
            fit_reports.show_if_wanted(context, report)
        for note in fitting.state.notes:
            self.report({'WARNING'}, note)
        figures = fitting.state.figures
        quality = f', {figures.best_psnr:.1f} dB on held-out views' if figures.best_psnr == figures.best_psnr else ''
        self.report({'INFO'}, f"{result.splats.count:,} splats in '{obj.name}'{quality}")
        _redraw(context)

    def _show(self, context):
        """Brings the preview up to date, now and then."""
        if time.monotonic() - self._shown_at < _PREVIEW_SECONDS:
            return
        self._shown_at = time.monotonic()
        splats = self._job.preview(overlays.shows_contributions(context.scene))
        if splats is None:
            return
        obj = bpy.data.objects.get(self._preview) if self._preview else None
        if obj is None:
            if self._preview:
                return  # removed by hand: it is not wanted
            obj = self._new_object(context)
            self._preview = obj.name
        sync.write(obj.data, splats, '')

    def _new_object(self, context):
        name = fitting.state.name
        obj = splat_data.new_object(name, splat_data.new_data(name))
        fit_proposal.new_object(context, obj, fitting.state.source_names, fitting.state.matrix)
        return obj

    def _failed(self, error):
        self._remove_preview()
        return super()._failed(error)

    def _remove_preview(self):
        obj = bpy.data.objects.get(self._preview) if self._preview else None
        if obj is not None:
            fit_proposal.discard(bpy.context, obj)
        self._preview = ''


class STIPPLE_OT_fit_stop(bpy.types.Operator):
    """End the fit now and keep the best so far"""

    bl_idname = 'stipple.fit_stop'
    bl_label = "Stop and Keep Best"

    @classmethod
    def poll(cls, _context):
        return fitting.state.is_running

    def execute(self, _context):
        fitting.state.wants_stop = True
        return {'FINISHED'}


class _Decision:
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context):
        return fit_proposal.find(context) is not None


class STIPPLE_OT_fit_accept(_Decision, bpy.types.Operator):
    """Keep the fitted splats and hide what they were fitted to"""

    bl_idname = 'stipple.fit_accept'
    bl_label = "Accept"

    hide_source: BoolProperty(name="Hide Source", description="Hide the meshes that the splats were fitted to, in the "
                              "viewport and in renders", default=True)

    def execute(self, context):
        fit_proposal.accept(context, fit_proposal.find(context), self.hide_source)
        return {'FINISHED'}


class STIPPLE_OT_fit_discard(_Decision, bpy.types.Operator):
    """Remove the fitted splats and their report; their file stays"""

    bl_idname = 'stipple.fit_discard'
    bl_label = "Discard"

    def execute(self, context):
        obj = fit_proposal.find(context)
        report = fit_reports.of(obj)
        fit_proposal.discard(context, obj)
        fit_reports.forget(report)
        return {'FINISHED'}


def _redraw(context):
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == 'VIEW_3D':
                area.tag_redraw()


classes = (STIPPLE_OT_splats_fit, STIPPLE_OT_fit_stop, STIPPLE_OT_fit_accept, STIPPLE_OT_fit_discard)
