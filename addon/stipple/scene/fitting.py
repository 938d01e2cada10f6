# SPDX-License-Identifier: GPL-3.0-or-later
"""A fit from the scene's settings to splats: views, surface points, the native fit, the tree that makes a slider."""

import time
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from ..binding import cloud_edit
from ..binding.errors import CancelledError, StippleError, invalid
from ..binding.fit import Fit, fit_options
from ..binding.model import DecodeSettings, Model
from ..binding.structs import ColourSpace, FitModel, FitQuality, JobState
from ..binding.views import Views
from . import (facts, fit_proposal, fit_reports, frames, meshes, photo_cameras, sources, view_capture,
               view_rigs)

# Surface samples that a fit of meshes starts from and learns its density on.
POINT_COUNT = 20_000
_POLL_SECONDS = 0.02
# Shares of the whole in the progress bar: until points are known, until views are, until the fit ends.
_POINTS_END, _VIEWS_END, _FIT_END = 0.05, 0.35, 0.95

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


state = State()


@dataclass
class Result:
    name: str
    splats: object      # SplatArrays at the budget of the viewport
    path: str           # of the asset file
    decoding: object    # DecodeSettings of these splats
    kind: str           # source kind: 'TREE', or 'MODEL' of a field
    info: object        # StippleModelInfo of the asset
    report: object      # picture of the fit's curves, [H,W,4]


class FitTask:
    """Polled like a native job, from Blender's main thread: rendering views needs Blender itself.

    cancel() while views are rendered ends with nothing; while it fits, with the best so far.
    """

    def __init__(self, context, objects, settings, path):
        self.result = None
        self.holds_scene = True  # until the views are rendered nothing may change in Blender
        self.job = None          # of the native fit, while it runs
        self._context, self._objects, self._settings = context, objects, settings
        self._native, self._path = sources.context(), path
        self._cancelled, self._error = False, None
        self._progress = (0.0, 'Preparing')
        self._steps = self._work()
        self._frame = self._frame_of_views()
        state.__init__(name=self._name(), stage='Preparing', is_running=True,
                       source_names=fit_proposal.visible_names(meshes.source_objects(objects)),
                       matrix=Matrix(frames.to_world(self._frame).tolist()))

    def poll(self):
        """(state, fraction 0..1, stage). Takes one step: a view, or a look at a native job."""
        if self._steps is not None:
            if state.wants_stop:
                self.cancel()
            try:
                self._progress = next(self._steps)
                state.fraction, state.stage = self._progress
                return (JobState.RUNNING, *self._progress)
            except StopIteration:
                pass
            except StippleError as error:
                self._error = error
            self._steps = None
            state.is_running = False
            state.problem = '' if self._error is None else str(self._error)
        if self._error is None:
            return JobState.DONE, 1.0, self._progress[1]
        ended = JobState.CANCELLED if isinstance(self._error, CancelledError) else JobState.FAILED
        return (ended, *self._progress)

    def cancel(self):
        self._cancelled = True
        if self.job is not None:
            self.job.cancel()

    def wait(self):
        """Until the end; raises what went wrong."""
        while self.poll()[0] == JobState.RUNNING:
            if not self.holds_scene:
                time.sleep(_POLL_SECONDS)
        if self._error is not None:
            raise self._error

    def close(self):
        """Ends at once, with nothing."""
        self.cancel()
        if self._steps is not None:
            self._steps.close()  # puts the scene back
            self._steps = None
        state.is_running = False

    def preview(self):
        """The splats as they are now (SplatArrays), or None."""
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

    def _work(self):
        settings = self._settings
        if settings.views_from == 'DATASET':
            yield 0.0, 'Reading the data set'
            if not settings.dataset:
                raise invalid('No data set is chosen; a folder with COLMAP cameras or a transforms.json is needed.')
            views = Views.open(self._native, bpy.path.abspath(settings.dataset), settings.downscale)
        else:
            views = Views.create(self._native, ColourSpace.DISPLAY)
            yield from self._add_points(views)
            yield from self._add_views(views)
        self._check_cancelled()
        self.holds_scene = False
        yield from self._fit(views)

    def _add_points(self, views):
        """Samples of the meshes' surfaces: where splats can be."""
        seen = meshes.source_objects(self._objects)
        if not seen:
            raise invalid('There is no mesh to fit splats to; select one, or show one.')
        depsgraph = self._context.evaluated_depsgraph_get()
        mesh = meshes.native_mesh(self._native, seen, depsgraph, 'MATERIAL')
        job = Model.from_mesh_start(self._native, mesh, 0.0, self._settings.seed)
        yield from self._until_done(job, 0.0, _POINTS_END)
        cloud = job.model().decode(DecodeSettings(POINT_COUNT, 1, seed=self._settings.seed)).read()
        views.set_points(cloud.positions, _linear_colours(cloud))

    def _add_views(self, views):
        settings = self._settings
        capturing = view_capture.CaptureSettings(settings.engine, settings.view_size, settings.samples,
                                                 settings.transparent)
        shots = self._shots()
        start = time.monotonic()
        with view_capture.Capture(self._context, self._objects, capturing) as capture:
            for i, (name, shot) in enumerate(shots):
                share = i / len(shots)
                state.seconds_left = (time.monotonic() - start) * (len(shots) / i - 1) if i else 0.0
                yield _POINTS_END + (_VIEWS_END - _POINTS_END) * share, f'Rendering view {i + 1} of {len(shots)}'
                self._check_cancelled()
                is_pose = isinstance(shot, view_rigs.Pose)
                seen = capture.pose(name, shot) if is_pose else capture.camera(shot)
                views.add(seen.camera, seen.linear, depth=seen.depth, normals=seen.normals, name=name)

    def _shots(self):
        """[(name, pose or camera object)]."""
        settings, scene = self._settings, self._context.scene
        if settings.views_from == 'CAMERAS':
            cameras = view_capture.scene_cameras(scene)
            if not cameras:
                raise invalid('The scene has no perspective or orthographic camera; add cameras, or choose a rig.')
            return [(camera.name, camera) for camera in cameras]
        depsgraph = self._context.evaluated_depsgraph_get()
        bounds = view_rigs.bounds_of(self._objects, depsgraph)
        rig = settings.rig if settings.rig != 'AUTO' else view_rigs.choose(scene, bounds, depsgraph)
        place = view_rigs.inside if rig == 'INSIDE' else view_rigs.around
        poses = place(scene, depsgraph, bounds, settings.view_count, settings.seed)
        return [(f'view_{i:04d}', pose) for i, pose in enumerate(poses)]

    def _fit(self, views):
        settings = self._settings
        chosen = {'density_gradient': int(settings.density_gradient), 'seed': settings.seed}
        if settings.model == 'EXPLICIT':
            chosen.update(max_splats=settings.max_splats, strategy=settings.strategy)
        if not settings.view_dependent:
            chosen['sh_degree'] = 0
        options = fit_options(self._native.library, FitModel[settings.model], FitQuality[settings.quality], **chosen)
        if settings.model == 'FIELD':
            most = max(1, settings.max_splats // options.gaussians_per_anchor)
            options.most_anchors = min(options.most_anchors, most)
            options.least_anchors = min(options.least_anchors, options.most_anchors)
        self.job = Fit.start(self._native, views, options)
        try:
            while True:
                job_state, fraction, stage = self.job.poll()
                state.figures = self.job.figures()
                if job_state != JobState.RUNNING:
                    break
                state.seconds_left = state.figures.seconds_left if state.figures.iteration else 0.0
                yield _VIEWS_END + (_FIT_END - _VIEWS_END) * fraction, _STAGES.get(stage, stage)
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
        yield _FIT_END, 'Keeping the result'
        if is_field:
            info = made.info()
            decoding = DecodeSettings(info.most_anchors, info.gaussians_per_anchor, seed=settings.seed)
            self._keep(made, decoding, 'MODEL', report)
            return
        made = cloud_edit.merge([(made, np.eye(4))], self._frame)  # the same splats, with the label of their frame
        job = Model.from_cloud_start(self._native, made, seed=settings.seed)
        yield from self._until_done(job, _FIT_END, 1.0)
        self._keep(job.model(), DecodeSettings(made.info().count), 'TREE', report)

    def _keep(self, model, decoding, kind, report):
        path = sources.save_model(model, self._path or sources.model_path_for(state.name), bool(self._path))
        sources.remember_model(path, model)
        self.result = Result(state.name, model.decode(decoding).read(), path, decoding, kind, model.info(),
                             report)

    def _until_done(self, job, start, end):
        while True:
            job_state, fraction, stage = job.poll()
            if job_state != JobState.RUNNING:
                job.wait()
                return
            if self._cancelled and self.holds_scene:
                job.cancel()
            yield start + (end - start) * fraction, stage

    def _check_cancelled(self):
        if self._cancelled:
            raise CancelledError()


def seen_objects(context):
    """What views are made of: selected objects that splats can come from, else all that render."""
    chosen = meshes.source_objects(context.selected_objects)
    if chosen:
        return chosen
    return [obj for obj in meshes.source_objects(context.view_layer.objects) if not obj.hide_render]


def _linear_colours(splats):
    """Scene linear colours [N,3] of the constant harmonics."""
    shown = facts.display_colours(splats.sh[:, 0])
    if splats.colour_space == ColourSpace.LINEAR:
        return shown.astype(np.float32)
    return np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4).astype(np.float32)

