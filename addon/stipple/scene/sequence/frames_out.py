# SPDX-License-Identifier: GPL-3.0-or-later
"""Which frames a conversion writes, and the splats of each, read in a worker.

Files of series do not go through the cache of what is shown, which belongs to Blender's own thread. Decoded budgets
that are kept are taken as they are.
"""

from dataclasses import dataclass

import numpy as np

from ...binding.cloud import Cloud
from ...binding.errors import StippleError, invalid
from ...binding.grade import GradeSettings, graded
from .. import grades
from . import sequences
from ..source import bound, placement, source_settings, sources, splat_data, sync
from ..source.decoded import Carried, Decoder



@dataclass
class Decoded:
    """A model at the budget of one frame, without what was erased."""

    decoder: Decoder
    settings: object

    def read_anew(self, _native):
        return self.decoder.cloud(self.settings, is_image=False)


@dataclass
class FrameOut:
    """One frame: its number, and [(source, 4x4 object to world, grade)]; a source is a Cloud, a Frame of a series,
    Decoded or Carried."""

    number: int
    placed: list

    def clouds(self, native):
        """[(cloud, matrix)] without what shows nothing. Errors: StippleError, with the frame."""
        found = []
        for source, matrix, grade in self.placed:
            try:
                cloud = source if isinstance(source, Cloud) else source.read_anew(native)
            except StippleError as error:
                raise StippleError(f'Frame {self.number}: {error}', error.status) from None
            if cloud is not None and cloud.info().count:
                found.append((graded(cloud, grade), matrix))
        return found


def gather(context, objects, frames, budget, apply_grade=True):
    """[FrameOut] of splat objects, the active one first; frames: a key of choices.FRAMES_OUT but 'CURRENT'; budget:
    'VIEWPORT', 'RENDER' or 'FULL'; apply_grade: with the objects' grades. Reads no file. Errors: StippleError for a gap
    in a series."""
    if frames == 'SCENE':
        return _of_scene(context, objects, budget, apply_grade)
    data = objects[0].data
    if not data.stipple.is_sequence:
        raise invalid(f"'{objects[0].name}' is no series of files; make one active, or choose another range of frames.")
    depsgraph = context.evaluated_depsgraph_get()
    fixed = _fixed_clouds(objects, with_models=True)
    result = []
    for local in range(1, data.stipple.frame_duration + 1):
        placed = []
        for obj in objects:
            evaluated = obj.evaluated_get(depsgraph)
            source = fixed.get(obj)
            if source is None:
                stipple = evaluated.data.stipple
                path = sequences.file_path(obj.data, stipple, min(local, stipple.frame_duration))
                source = sequences.frame_of_file(obj.data, stipple, path, budget)
            placed.append((source, placement.matrix_of(evaluated), _grade_of(evaluated, apply_grade)))
        result.append(FrameOut(local, placed))
    return result


def _of_scene(context, objects, budget, apply_grade):
    scene = context.scene
    before, fixed, result = (scene.frame_current, scene.frame_subframe), _fixed_clouds(objects, with_models=False), []
    try:
        with sync.paused():  # nothing has to be shown
            for number in range(scene.frame_start, scene.frame_end + 1):
                scene.frame_set(number)
                depsgraph = context.evaluated_depsgraph_get()
                placed = []
                for obj in objects:
                    evaluated = obj.evaluated_get(depsgraph)
                    source = fixed.get(obj) or _at_frame(obj.data, evaluated.data.stipple, number, budget, depsgraph)
                    if not placement.is_flat(evaluated.matrix_world):
                        placed.append((source, np.array(evaluated.matrix_world),
                                       _grade_of(evaluated, apply_grade)))
                result.append(FrameOut(number, placed))
    finally:
        scene.frame_set(before[0], subframe=before[1])
    return result


def _grade_of(evaluated, apply_grade):
    return grades.settings_of(evaluated.data.stipple) if apply_grade else GradeSettings()


def _at_frame(data, stipple, number, budget, depsgraph):
    if stipple.is_sequence:
        return sequences.frame_of(data, stipple, number, budget)
    settings = sources.decode_settings(stipple, budget)
    settings.check()
    carrier = bound.carrier(data, depsgraph)
    return Decoded(Decoder(data), settings) if carrier is None else Carried(data, settings, carrier)


def _fixed_clouds(objects, with_models):
    """What stays as it is shown now: all that is no series, and no model unless those are to stay, too."""
    fixed = {}
    for obj in objects:
        stipple = obj.data.stipple
        changes = stipple.is_sequence or (not with_models and (source_settings.of(stipple).has_budget
                                                               or bound.follows(obj.data)))
        if not changes or stipple.edited or sync.is_edited(obj.data):
            fixed[obj] = sources.ungraded_cloud(obj)
    return fixed


def chosen_series(context):
    """The active object, where it is a series."""
    obj = context.view_layer.objects.active
    return obj if splat_data.is_splat_object(obj) and obj.data.stipple.is_sequence else None


def largest_extent(frames, native, advance):
    """The longest side, metres, of any frame's bounds; 0 where there is nothing. advance(share): called between."""
    longest = 0.0
    for i, frame in enumerate(frames):
        advance(i / len(frames))
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for cloud, matrix in frame.clouds(native):
            info = cloud.info()
            ends = np.array([info.bounds_min[:], info.bounds_max[:]], np.float64)
            corners = np.array([[ends[i >> k & 1][k] for k in range(3)] for i in range(8)])
            world = corners @ matrix[:3, :3].T + matrix[:3, 3]
            low, high = np.minimum(low, world.min(0)), np.maximum(high, world.max(0))
        if np.isfinite(low).all():
            longest = max(longest, float((high - low).max()))
    return longest
