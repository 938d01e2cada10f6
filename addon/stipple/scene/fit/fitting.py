# SPDX-License-Identifier: GPL-3.0-or-later
"""A fit from the scene's settings to splats: views, surface points, the native fit, the tree that makes a slider."""

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from ...binding import cloud_edit
from ...binding.errors import invalid
from ...binding.fit import Fit, fit_options
from ...binding.model import DecodeSettings, Model
from ...binding.structs import FitModel, FitQuality, FitShell, JobState
from .. import meshes
from . import fit_proposal, fit_reports, strategies
from ..sequence import frames
from ..source import sources
from ..view import photo_cameras
from .view_task import VIEWS_END, ViewTask

# Share of the whole in the progress bar until the fit ends.
_FIT_END = 0.95

# What a native stage is called.
_STAGES = {'Splats': 'Fitting splats', 'Density': 'Learning where surfaces are', 'Attributes': 'Learning attributes',
           'Joint': 'Learning density and attributes'}


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
    seconds_left: float = 0.0  # of what goes on now, 0 where it is not known
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


_CHECKPOINT_SUFFIX = '.safetensors'


def _checkpoint_path(settings):
    """Of the file that keeps a fit that runs, None where none is wanted."""
    return Path(bpy.path.abspath(settings.checkpoint)) if settings.checkpoint else None


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


class FitTask(ViewTask):
    """cancel() while it fits ends with the best so far."""

    def __init__(self, context, objects, settings, path):
        if settings.model == 'EXPLICIT':
            strategies.require(strategies.text_of(settings))
        _require_checkpoint(settings)
        super().__init__(context, objects, settings)
        self._path = path
        self._frame = self._frame_of_views()
        state.__init__(name=self._name(), stage='Preparing', is_running=True,
                       source_names=fit_proposal.visible_names(meshes.source_objects(objects)),
                       matrix=Matrix(frames.to_world(self._frame).tolist()))

    def poll(self):
        if state.wants_stop and self.is_running:
            self.cancel()
        return super().poll()

    def _advanced(self, fraction, stage):
        state.fraction, state.stage = fraction, stage

    def _views_left(self, seconds):
        state.seconds_left = seconds

    def _ended(self, error):
        state.is_running = False
        state.problem = '' if error is None else str(error)

    def preview(self, with_contributions=False):
        """The splats as they are now (SplatArrays), or None. with_contributions: the next one tells them."""
        if self.job is not None:
            self.job.watch_contributions(with_contributions)
        cloud = None if self.job is None else self.job.preview()
        return None if cloud is None else cloud.read()

    def _name(self):
        if self._settings.views_from == 'DATASET':
            return bpy.path.display_name_from_filepath(bpy.path.abspath(self._settings.dataset).rstrip('/\\')) + ' Fit'
        return (self._objects[0].name if self._objects else 'Scene') + ' Fit'

    def _frame_of_views(self):
        """Which way the axes of the splats to be point."""
        settings = self._settings
        if settings.views_from != 'DATASET':
            return frames.WORLD
        return photo_cameras.chosen_frame(bpy.path.abspath(settings.dataset), settings.up_axis)

    def _use(self, views):
        settings = self._settings
        chosen = {'density_gradient': int(settings.density_gradient), 'seed': settings.seed}
        if settings.model == 'EXPLICIT':
            chosen.update(max_splats=settings.max_splats, strategy=strategies.text_of(settings))
        else:
            chosen['shell'] = FitShell[settings.shell]
        if not settings.view_dependent:
            chosen['sh_degree'] = 0
        checkpoint = _checkpoint_path(settings)
        resumes = settings.resume and has_checkpoint(settings)
        options = fit_options(self._native.library, FitModel[settings.model], FitQuality[settings.quality], checkpoint,
                              resume=int(resumes), **chosen)
        if settings.model == 'FIELD':
            most = max(1, settings.max_splats // options.gaussians_per_anchor)
            options.max_anchors = min(options.max_anchors, most)
            options.min_anchors = min(options.min_anchors, options.max_anchors)
        self.job = Fit.start(self._native, views, options)
        try:
            while True:
                job_state, fraction, stage = self.job.poll()
                state.figures = self.job.figures()
                if job_state != JobState.RUNNING:
                    break
                state.seconds_left = state.figures.seconds_left if state.figures.iteration else 0.0
                yield VIEWS_END + (_FIT_END - VIEWS_END) * fraction, _STAGES.get(stage, stage)
            state.notes = tuple(self.job.notes())
            if not state.figures.iteration:
                self.job.wait()  # says why
            is_field = settings.model == 'FIELD'
            made = self.job.model() if is_field else self.job.result()
            report = self.job.draw_report(fit_reports.SCALE)
            if settings.report:
                self.job.save_report(bpy.path.abspath(settings.report))
        finally:
            self.job = None
        state.seconds_left = 0.0
        is_whole = state.figures.iteration == state.figures.iterations
        yield _FIT_END, 'Keeping the result'
        if is_field:
            self._keep(made, sources.first_settings(made.settings()), report)  # seed 0: the fit's own draws
            self._forget(checkpoint if is_whole else None)
            return
        seen = made.seen()
        made = cloud_edit.merge([(made, np.eye(4))], self._frame)  # the same splats, with the label of their frame
        job = Model.from_cloud_start(self._native, made, seed=settings.seed)
        yield from self._until_done(job, _FIT_END, 1.0)
        self._keep(Model.of_job(job), DecodeSettings(made.info().count), report, seen)
        self._forget(checkpoint if is_whole else None)

    @staticmethod
    def _forget(checkpoint):
        """Of a fit whose result is kept; what is stopped early keeps it."""
        if checkpoint is not None:
            checkpoint.unlink(missing_ok=True)

    def _keep(self, model, decoding, report, seen=None):
        """seen: of the splats at these settings."""
        path = sources.save_model(model, self._path or sources.model_path_for(state.name), bool(self._path))
        sources.remember_model(path, model)
        self.result = Result(state.name, model.decode(decoding).read(), path, decoding, model.settings(),
                             report)
        self.result.splats.seen = seen or {}
        state.kept_count = self.result.splats.count


def seen_objects(context):
    """What views are made of: selected objects that splats can come from, else all that render."""
    chosen = meshes.source_objects(context.selected_objects)
    if chosen:
        return chosen
    return [obj for obj in meshes.source_objects(context.view_layer.objects) if not obj.hide_render]
