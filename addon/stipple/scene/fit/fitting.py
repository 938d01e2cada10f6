# SPDX-License-Identifier: GPL-3.0-or-later
"""A fit from the scene's settings to splats: views, surface points, the native fit, the tree that makes a slider."""

import math
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from ...binding import cloud_edit
from ...binding.errors import invalid
from ...binding.fit import Fit, check_places, fit_options
from ...binding.model import DecodeSettings, Model
from ...binding.structs import FitModel, FitQuality, FitShell, JobState
from .. import meshes
from . import fit_proposal, fit_reports, series, strategies, view_task, view_times
from ..sequence import frames
from ..source import decoded, edits, placement, setting_paths, source_paths, sources
from ..view import photo_cameras

# What a native stage is called.
_STAGES = {'Splats': 'Fitting splats', 'Density': 'Learning where surfaces are', 'Attributes': 'Learning attributes',
           'Joint': 'Learning density and attributes', 'Anchors': 'Learning anchors', 'Key frames': 'Learning key frames',
           'Windows': 'Learning what moves', 'Blending': 'Blending key frames'}
# Models whose budgets count anchors; strategies do not concern them.
_OF_ANCHORS = 'FIELD', 'SCAFFOLD', 'RELAY'


@dataclass
class State:
    """What the panel shows of the fit that runs or ran last."""

    name: str = ''        # of the object to be
    stage: str = ''
    figures: object = None  # StippleFitFigures, None before the first step
    is_running: bool = False
    problem: str = ''
    notes: tuple = ()
    fraction: float = 0.0
    seconds_left: float = 0.0  # of everything, 0 where it is not known
    views_left: float = 0.0    # until the views are rendered, 0 where it is not known
    source_names: tuple = ()  # of the visible objects that it is fitted to
    matrix: object = None     # of the object to be, to the world
    wants_stop: bool = False
    kept_count: int = 0       # splats of the result


state = State()


@dataclass
class Result:
    name: str
    splats: object      # SplatArrays at the budget of the viewport
    path: str           # of the asset file
    decoding: object    # DecodeSettings of these splats
    settings: object    # StippleModelSettings of the asset
    report: object      # image of the fit's curves, [H,W,4]
    clip_start: object = None  # frame of the scene at which splats that move begin; None: they stand still
    key_frames: tuple = ()     # of a long shot, frames of the scene


_CHECKPOINT_SUFFIX = '.safetensors'


def _checkpoint_path(settings):
    """Of the file that keeps a fit that runs, None where none is wanted."""
    path = setting_paths.absolute(settings, 'checkpoint')
    return Path(path) if path else None


def has_checkpoint(settings):
    """Whether a fit was left that can go on."""
    path = _checkpoint_path(settings)
    return path is not None and path.is_file()


def _require_checkpoint(settings):
    """Before views are rendered for nothing, and so that no file of another kind is written over."""
    path = _checkpoint_path(settings)
    if path is None:
        return
    if path.suffix.lower() != _CHECKPOINT_SUFFIX:
        raise invalid(f"The checkpoint '{path}' must end in {_CHECKPOINT_SUFFIX}")
    if not path.parent.is_dir():
        raise invalid(f"The checkpoint cannot be written: there is no folder '{path.parent}'")


def _check_places(native, settings):
    """The library's judgement of the same, and of the report. A fit that goes on reads its checkpoint."""
    report = setting_paths.absolute(settings, 'report') or None
    resumes = settings.resume and has_checkpoint(settings)
    check_places(native.library, report, None if resumes else _checkpoint_path(settings))


class FitTask(view_task.ViewTask):
    """cancel() while it fits ends with the best so far."""

    def __init__(self, context, objects, settings, path):
        if settings.model not in _OF_ANCHORS:
            strategies.require(strategies.text_of(settings))
        _require_checkpoint(settings)
        super().__init__(context, objects, settings)
        _check_places(self._native, settings)
        self.plan = plan_of(context, settings)
        self._start = None
        begins_with = settings.begin_with if settings.model == 'EXPLICIT' else None
        if begins_with is not None:
            self._start = _start_of(begins_with, self._frame_of_views(), settings.max_splats)
            self.colour_space = self._start.info().colour_space
        self._path = path
        self._clip_start, self._clip_begin = None, 0.0
        self._key_frames = ()
        if settings.model in series.MOVING_MODELS:
            self._frame_rate = context.scene.render.fps / context.scene.render.fps_base
            self._clip_start = context.scene.frame_start if self.plan is None else math.floor(self.plan.frames[0])
        self._frame = self._frame_of_views()
        state.__init__(name=self._name(), stage='Preparing', is_running=True,
                       source_names=fit_proposal.visible_names(meshes.source_objects(objects)),
                       matrix=Matrix(frames.to_world(self._frame).tolist()))

    def poll(self):
        if state.wants_stop and self.is_running:
            self.cancel()
        return super().poll()

    def _advanced(self, stage):
        state.fraction, state.stage = self.pace.fraction, stage
        state.seconds_left = self.pace.seconds_left or 0.0
        state.views_left = (self.pace.part_left or 0.0) if self.holds_scene else 0.0

    def _ended(self, error):
        state.is_running = False
        state.problem = '' if error is None else str(error)

    def preview(self, with_contributions=False):
        """The splats as they are now (SplatArrays), or None. with_contributions: the next one tells them."""
        if self.job is not None:
            self.job.watch_contributions(with_contributions)
            if self._clip_start is not None:
                scene = self._context.scene
                now = scene.frame_current + scene.frame_subframe
                self.job.watch_time(self._clip_begin + view_times.seconds_at(scene, now, self._clip_start))
        cloud = None if self.job is None else self.job.preview()
        return None if cloud is None else cloud.read()

    def _name(self):
        if self._settings.views_from == 'DATASET':
            return bpy.path.display_name_from_filepath(setting_paths.absolute(self._settings, 'dataset')) + ' Fit'
        return (self._objects[0].name if self._objects else 'Scene') + ' Fit'

    def _frame_of_views(self):
        """Which way the axes of the splats to be point."""
        settings = self._settings
        if settings.views_from != 'DATASET':
            return frames.WORLD
        return photo_cameras.chosen_frame(setting_paths.absolute(settings, 'dataset'), settings.up_axis)

    def _use(self, views):
        settings = self._settings
        chosen = {'density_gradient': int(settings.density_gradient), 'seed': settings.seed}
        if settings.model == 'FIELD':
            chosen['shell'] = FitShell[settings.shell]
        elif settings.model == 'RELAY':
            chosen['key_frame_spacing'] = settings.key_frame_spacing
        elif settings.model != 'SCAFFOLD':
            chosen.update(max_splats=settings.max_splats, strategy=strategies.text_of(settings))
        if self._clip_start is not None:
            times = sorted({views.view_info(i).time for i in range(len(views))})
            self._clip_begin = times[0] if times else 0.0
            if settings.model == 'RELAY':
                seconds = view_times.key_frame_seconds(times, settings.key_frame_spacing)
                self._key_frames = tuple(self._clip_start + s * self._frame_rate for s in seconds)
        if not settings.view_dependent:
            chosen['sh_degree'] = 0
        checkpoint = _checkpoint_path(settings)
        resumes = settings.resume and has_checkpoint(settings)
        options = fit_options(self._native.library, FitModel[settings.model], FitQuality[settings.quality], checkpoint,
                              resume=int(resumes), **chosen)
        if settings.model in _OF_ANCHORS:
            most = max(1, settings.max_splats // options.gaussians_per_anchor)
            options.max_anchors = min(options.max_anchors, most)
            options.min_anchors = min(options.min_anchors, options.max_anchors)
        yield 'use', 0.0, 'Starting the fit'
        self.job = Fit.start(self._native, views, options, self._start)
        begun = None
        try:
            while True:
                job_state, fraction, stage = self.job.poll()
                state.figures = self.job.figures()
                if job_state != JobState.RUNNING:
                    break
                if begun is None and state.figures.iteration:
                    begun = state.figures.iteration - 1  # of a fit that goes on
                left = None if begun is None else _seconds_left(state.figures, begun)
                yield 'use', fraction, _STAGES.get(stage, stage or 'Starting the fit'), left
            state.notes = (*self._notes, *self.job.notes())
            if not state.figures.iteration:
                self.job.wait()  # says why
            is_model = settings.model != 'EXPLICIT'
            made = self.job.model() if is_model else self.job.result()
            # Rows of anchors' splats are made anew; of all others they stay.
            seen = {} if settings.model in _OF_ANCHORS else (self.job.result() if is_model else made).seen()
            report = self.job.draw_report(fit_reports.SCALE)
            if settings.report:
                self.job.save_report(setting_paths.absolute(settings, 'report'))
        finally:
            self.job = None
        is_whole = state.figures.iteration == state.figures.iterations
        yield 'keep', 0.0, 'Keeping the result'
        if is_model:
            self._keep(made, sources.first_settings(made.settings()), report, seen,  # seed 0: the fit's own draws
                       settings.model == 'RELAY')
            self._forget(checkpoint if is_whole else None)
            return
        made = cloud_edit.merge([(made, np.eye(4))], self._frame)  # the same splats, with the label of their frame
        job = Model.from_cloud_start(self._native, made, seed=settings.seed)
        yield from self._until_done(job, 'keep')
        self._keep(Model.of_job(job), DecodeSettings(made.info().count), report, seen)
        self._forget(checkpoint if is_whole else None)

    @staticmethod
    def _forget(checkpoint):
        """Of a fit whose result is kept; what is stopped early keeps it."""
        if checkpoint is not None:
            checkpoint.unlink(missing_ok=True)
            frames_folder = checkpoint.with_name(checkpoint.name + '.frames')  # of a long shot
            for file in frames_folder.glob('*.safetensors'):
                file.unlink(missing_ok=True)
            with suppress(OSError):  # what else lies there stays
                frames_folder.rmdir()

    def _keep(self, model, decoding, report, seen=None, is_of_key_frames=False):
        """seen: of the splats at these settings."""
        path = sources.save_model(model, self._path or source_paths.place_for(state.name), bool(self._path))
        if is_of_key_frames:  # which it reads from what _forget() removes
            model = Model.load(self._native, path)
        sources.remember_model(path, model)
        self.result = Result(state.name, model.decode(decoding).read(), path, decoding, model.settings(), report,
                             self._clip_start, self._key_frames)
        self.result.splats.seen = seen or {}
        state.kept_count = self.result.splats.count


def _seconds_left(figures, begun):
    """Of the steps: at the pace of the last ones, or of all with their measurements where that is slower."""
    rest = figures.iterations - figures.iteration
    return max(figures.seconds_left, figures.seconds * rest / (figures.iteration - begun))


def _start_of(obj, frame, max_splats):
    """All splats of an object, where views of this frame see them. Errors: StippleError for what has no splats of its
    own, and for more than the fit may have."""
    edits.refuse_sequence(obj)
    edits.refuse_moving(obj)
    cloud = decoded.full_cloud(obj.data)
    count = cloud.info().count
    if count > max_splats:
        raise invalid(f"'{obj.name}', which the fit begins with, has {count:,} splats, and Splats allows {max_splats:,}; "
                      'raise it, or begin with fewer.')
    to_views = np.linalg.inv(frames.to_world(frame)) @ placement.matrix_of(obj)
    return cloud if np.array_equal(to_views, np.eye(4)) else cloud.transformed(to_views)


def plan_of(context, settings):
    """The view_times.Plan of a fit's views, None for views at one time and for photographs, which have times of their
    own. Errors: StippleError that says what to change."""
    if settings.model not in series.MOVING_MODELS or settings.views_from == 'DATASET':
        return None
    count = settings.view_count if settings.views_from == 'RIG' else len(view_task.scene_cameras(context.scene))
    return view_times.plan(settings, context.scene, count)


def seen_objects(context):
    """What views are made of: selected objects that splats can come from, else all that render."""
    chosen = meshes.source_objects(context.selected_objects)
    if chosen:
        return chosen
    return [obj for obj in meshes.source_objects(context.view_layer.objects) if not obj.hide_render]
