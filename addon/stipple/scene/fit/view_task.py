# SPDX-License-Identifier: GPL-3.0-or-later
"""Work on views of the scene, or on photographs: the views first, then what is done with them."""

import contextlib
import time
from dataclasses import dataclass

import numpy as np

from ...binding.errors import CancelledError, StippleError, invalid
from ...binding.model import DecodeSettings, Model
from ...binding.structs import ColourSpace, JobState, ViewSplit
from ...binding.views import Views
from ...pace import Pace
from .. import meshes
from . import moving_views, series, view_capture, view_pace, view_rigs, view_times
from ..source import setting_paths, sources
from ..view import facts

# Surface samples that a fit of meshes starts from and learns its density on.
POINT_COUNT = 20_000
_POLL_SECONDS = 0.02


@dataclass(frozen=True)
class Shot:
    """A view to be taken."""

    name: str
    seen_by: object        # view_rigs.Pose, or a camera object
    frame: object = None   # of the scene; None for as it is
    seconds: float = 0.0   # when that is
    split: ViewSplit = ViewSplit.NONE
    camera: object = None  # its name, where whole cameras are held out


@dataclass(frozen=True)
class RigSettings:
    """What a ViewTask asks of its settings, for renders of the scene as it is by a rig of cameras."""

    view_count: int
    view_size: int     # pixels of both sides
    samples: int       # per pixel
    seed: int = 0
    views_from: str = 'RIG'
    rig: str = 'AROUND'
    engine: str = 'CYCLES'
    transparent: bool = True


class ViewTask:
    """Polled like a native job, from Blender's main thread: rendering views needs Blender itself.

    A task gives _use(views), a generator of (part, share of it, stage[, seconds left of it]), and may listen to
    _advanced and _ended. cancel() while views are rendered ends with nothing.
    """

    parts = {'points': 0.05, 'views': 0.30, 'use': 0.62, 'keep': 0.03}  # of the work, and their usual shares
    colour_space = ColourSpace.DISPLAY  # of the splats that the views are for
    cast = None                         # what rays of the rig meet, as view_rigs.poses() takes it
    plan = None                         # view_times.Plan of views at several times; None: the scene as it is

    def __init__(self, context, objects, settings):
        self.result = None
        self.holds_scene = True  # until the views are rendered nothing may change in Blender
        self.job = None          # the native job of _use, while it runs
        self._context, self._objects, self._settings = context, objects, settings
        self._native = sources.context()
        self._cancelled, self._error = False, None
        self.pace = Pace(self.parts)
        self._stage = 'Preparing'
        self._notes = []  # sentences on the views
        self._steps = self._work()

    def poll(self):
        """(state, fraction 0..1, stage). Takes one step: a view, or a look at a native job."""
        if self._steps is not None:
            try:
                part, share, self._stage, *seconds_left = next(self._steps)
                self.pace.update(part, share, *seconds_left)
                self._advanced(self._stage)
                return JobState.RUNNING, self.pace.fraction, self._stage
            except StopIteration:
                pass
            except StippleError as error:
                self._error = error
            self._steps = None
            self._ended(self._error)
        if self._error is None:
            return JobState.DONE, 1.0, self._stage
        ended = JobState.CANCELLED if isinstance(self._error, CancelledError) else JobState.FAILED
        return ended, self.pace.fraction, self._stage

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
        self._ended(None)

    def _use(self, views):
        raise NotImplementedError

    @property
    def is_running(self):
        return self._steps is not None

    def _advanced(self, stage):
        pass

    def _ended(self, error):
        pass

    def _add_view(self, views, seen, shot):
        # No fit looks at normals, and 100 views of 800 x 800 would keep 0.4 GiB of them.
        views.add(seen.camera, seen.linear, depth=seen.depth, name=shot.name, time=shot.seconds, split=shot.split,
                  camera_name=shot.camera, moving=seen.moving)

    def _work(self):
        settings = self._settings
        if settings.views_from == 'DATASET':
            yield 'points', 0.0, 'Reading the data set'
            if not settings.dataset:
                raise invalid('No data set is chosen; a folder with COLMAP cameras or a transforms.json is needed.')
            views = self._open_dataset()
        else:
            views = Views.create(self._native, self.colour_space)
            with contextlib.nullcontext() if self.plan is None else moving_views.Frames(self._context) as frames:
                if frames is None:
                    yield from self._add_points(views)
                    shots = self._shots()
                else:
                    surfaces = moving_views.Surfaces(frames, self.plan.frames)
                    yield from self._add_moving_points(views, surfaces)
                    shots = self._moving_shots(frames, surfaces.bounds)
                yield from self._add_views(views, shots, frames)
        self._check_cancelled()
        self.holds_scene = False
        yield from self._use(views)

    def _open_dataset(self):
        settings = self._settings
        # Who fits keeps the images.
        views = Views.open(self._native, setting_paths.absolute(settings, 'dataset'), downscale=settings.downscale,
                           cache_bytes=0, **series.options_of(settings))
        note = series.used(views.info())
        if note:
            self._notes.append(note)
        return views

    def _add_points(self, views):
        """Samples of the meshes' surfaces: where splats can be."""
        seen = self._meshes()
        yield 'points', 0.0, 'Reading the meshes'
        depsgraph = self._context.evaluated_depsgraph_get()
        mesh = meshes.native_mesh(self._native, seen, depsgraph, 'MATERIAL')
        job = Model.from_mesh_start(self._native, mesh, 0.0, self._settings.seed)
        yield from self._until_done(job, 'points')
        cloud = Model.of_job(job).decode(DecodeSettings(POINT_COUNT, 1, seed=self._settings.seed)).read()
        views.set_points(cloud.positions, _linear_colours(cloud))

    def _add_moving_points(self, views, surfaces):
        """The same of several times."""
        seen = self._meshes()
        yield 'points', 0.0, 'Reading the meshes'
        looking = surfaces.look(self._native, seen, self._settings.seed, POINT_COUNT,
                                lambda job: self._until_done(job, 'points'))
        for share, stage in looking:
            yield 'points', share, stage
            self._check_cancelled()
        if not surfaces.moves:
            looked_at = ', '.join(f'{frame:g}' for frame in surfaces.pointed_at)
            self._notes.append(f'No surface moves between the frames {looked_at}, where they were looked at; the model '
                               'Splats, in Advanced, would do.')
        views.set_points(np.concatenate([cloud.positions for cloud in surfaces.clouds]),
                         np.concatenate([_linear_colours(cloud) for cloud in surfaces.clouds]),
                         times=view_times.seconds_at(self._context.scene, np.concatenate(surfaces.frames),
                                                     self.plan.frames[0]))

    def _meshes(self):
        seen = meshes.source_objects(self._objects)
        if not seen:
            raise invalid('There is no mesh to fit splats to; select one, or show one.')
        return seen

    def _add_views(self, views, shots, frames):
        """frames: moving_views.Frames, None where no shot has a frame."""
        capturing = capture_settings(self._settings)
        shown = None
        with view_capture.Capture(self._context, self._objects, capturing) as capture:
            for i, shot in enumerate(shots):
                yield 'views', i / len(shots), f'Rendering view {i + 1} of {len(shots)}'
                self._check_cancelled()
                began = time.perf_counter()
                if shot.frame != shown:
                    frames.set(shot.frame)
                    shown = shot.frame
                is_pose = isinstance(shot.seen_by, view_rigs.Pose)
                # What moves is told apart where the fit is measured.
                with_moving = shot.frame is not None and shot.split == ViewSplit.TEST
                seen = (capture.pose(shot.name, shot.seen_by, with_moving) if is_pose else
                        capture.camera(shot.seen_by, with_moving))
                self._add_view(views, seen, shot)
                view_pace.note(capturing, time.perf_counter() - began)

    def _shots(self):
        """[Shot] of the scene as it is."""
        settings = self._settings
        if settings.views_from == 'CAMERAS':
            return [Shot(camera.name, camera) for camera in scene_cameras(self._context.scene)]
        depsgraph = self._context.evaluated_depsgraph_get()
        bounds = view_rigs.bounds_of(self._objects, depsgraph)
        poses = view_rigs.poses(settings.rig, self._context.scene, depsgraph, bounds, settings.view_count,
                                settings.seed, cast=self.cast)
        return [Shot(f'view_{i:04d}', pose) for i, pose in enumerate(poses)]

    def _moving_shots(self, frames, bounds):
        """[Shot] of the plan."""
        settings, scene, plan = self._settings, self._context.scene, self.plan
        if settings.views_from == 'CAMERAS':
            cameras = scene_cameras(scene)
            names = [camera.name for camera in cameras]
        else:
            cast = moving_views.Caster(scene, frames, plan.frames)
            cameras = view_rigs.poses(settings.rig, scene, frames.set(plan.frames[0]), bounds, plan.camera_count,
                                      settings.seed, cast=cast)
            names = [f'view_{i:04d}' for i in range(len(cameras))]
        shots, held_out = [], plan.held_out_images()
        for i, (when, camera) in enumerate(plan.images()):
            frame, is_held = plan.frames[when], i in held_out
            is_named = is_held and plan.held_out
            name = f"{names[camera]}{', held out,' if is_named else ''} at frame {frame:08.2f}"
            shots.append(Shot(name, cameras[camera], frame, view_times.seconds_at(scene, frame, plan.frames[0]),
                              ViewSplit.TEST if is_held else ViewSplit.TRAIN,
                              names[camera] if plan.held_out else None))
        return shots

    def _until_done(self, job, part):
        while True:
            job_state, fraction, stage = job.poll()
            if job_state != JobState.RUNNING:
                job.wait()
                return
            if self._cancelled and self.holds_scene:
                job.cancel()
            yield part, fraction, stage

    def _check_cancelled(self):
        if self._cancelled:
            raise CancelledError()


def capture_settings(settings):
    """The view_capture.CaptureSettings of a fit's settings."""
    return view_capture.CaptureSettings(settings.engine, settings.view_size, settings.samples, settings.transparent)


def scene_cameras(scene):
    """view_capture.scene_cameras(). Errors: StippleError for none."""
    cameras = view_capture.scene_cameras(scene)
    if not cameras:
        raise invalid('The scene has no perspective or orthographic camera; add cameras, or choose a rig.')
    return cameras


def _linear_colours(splats):
    """Scene linear colours [N,3] of the constant harmonics."""
    shown = facts.display_colours(splats.sh[:, 0])
    if splats.colour_space == ColourSpace.LINEAR:
        return shown.astype(np.float32)
    return np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4).astype(np.float32)
