# SPDX-License-Identifier: GPL-3.0-or-later
"""Splat objects that a view layer shows, with their instances, as native clouds."""

from dataclasses import dataclass, replace

import bpy

from .. import version
from ..binding.errors import CancelledError, StippleError
from ..binding.grade import graded
from ..binding.model import DecodeSettings
from ..binding.structs import Status
from . import grades, limits, shown
from .sequence import sequences
from .source import bound, decoded, placement, source_settings, sources, splat_data, sync
from .view import viewed


def gather(depsgraph, mode, warn=lambda message: None):
    """[(cloud, 4x4 object to world, is a holdout)]. Decodes from evaluated settings; writes no datablock.

    mode: 'VIEWPORT' or 'RENDER', which budget. warn: called with a sentence per object that is left out.
    """
    return [entry[3] for entry in gather_keyed(depsgraph, mode, warn)]


def gather_owned(depsgraph, mode, warn=lambda message: None):
    """[(owner, object, placed)], placed as gather has it, with the original object, and the original one that it is
    selected and hidden with: itself or its instancer."""
    return [entry[1:4] for entry in gather_keyed(depsgraph, mode, warn)]


def gather_keyed(depsgraph, mode, warn=lambda message: None, wait=None):
    """The same with a key before each, which stays while it is the same instance: matrices() has it at other times. And
    with a ChangingSplats behind those that a frame changes beside their matrix, None behind others. wait: called with
    (name of an object, job) where a source has to be read, to wait for the job; then what is not decoded yet is a
    LaterCloud, for decode_later()."""
    clouds, found, changing = {}, [], {}
    share, splats = limits.share(depsgraph, mode), shown.SplatObjects(depsgraph)
    for entry in depsgraph.object_instances:
        obj = splats.of(entry)
        if obj is None or not shown.is_shown(entry):
            continue
        if not shown.seen_by_camera(entry, depsgraph):
            continue
        matrix = version.copy_of_evaluated_matrix(entry.matrix_world)
        if placement.is_flat(matrix):
            warn(f"Splat object '{obj.name}' is scaled to zero; it is left out.")
            continue
        key = obj.data.as_pointer()
        if key not in clouds:
            clouds[key] = _cloud_of(obj, mode, depsgraph, share.most(obj.original.data), wait, changing)
        if clouds[key] is not None:
            original = obj.original
            owner = entry.parent.original if entry.is_instance else original
            found.append((_key_of(entry, owner, original), owner, original,
                          (clouds[key], matrix, shown.holds_out(entry, depsgraph)),
                          changing.get(original.data.name_full)))
    return found


@dataclass(frozen=True)
class Moment:
    """How splats change: their settings at a time, and what carries them."""

    settings: DecodeSettings
    carrier: object  # bound.Carrier, or None

    @property
    def key(self):
        """Equal for equal splats of a datablock."""
        return self.settings, self.carrier and self.carrier.key


class ChangingSplats:
    """The splats of a datablock that move or follow a mesh, at the budget of an image, to have them at other times."""

    def __init__(self, data, settings, grade):
        self._data, self._settings, self._grade = data, settings, grade

    def moment(self, depsgraph):
        """How they are at the depsgraph's present time. Errors: StippleError."""
        settings = self._settings
        if source_settings.of(self._data.stipple).has_time:
            stipple = self._data.evaluated_get(depsgraph).stipple
            settings = replace(settings, time=sources.seconds(stipple, depsgraph.scene))
        return Moment(settings, bound.carrier(self._data, depsgraph))

    def cloud_at(self, moment):
        """The splats of a moment, with the grade of the image. Errors: StippleError."""
        return graded(decoded.decode_data(self._data, moment.settings, carrier=moment.carrier), self._grade)


class LaterCloud:
    """The splats of an object that are yet to be decoded. It never touches Blender."""

    def __init__(self, name, pending, grade):
        self._name, self._pending, self._grade, self._cloud = name, pending, grade, None

    def cloud(self, wait):
        """wait: called with (name of the object, job) where decoding takes long. Errors: StippleError."""
        if self._cloud is None:
            try:
                made = self._pending.cloud(lambda job: wait(self._name, job))
            except CancelledError:
                raise
            except StippleError as error:
                raise StippleError(f"Splat object '{self._name}': {error}", error.status) from None
            self._cloud = graded(made, self._grade)
        return self._cloud


def decode_later(placed, wait):
    """What gather() gives, with all splats decoded. wait: as LaterCloud.cloud() has it. Errors: StippleError."""
    return [(entry[0].cloud(wait) if isinstance(entry[0], LaterCloud) else entry[0], *entry[1:]) for entry in placed]


def matrices(depsgraph):
    """{key: 4x4 object to world} of the splat objects at the depsgraph's present time, however they are drawn."""
    found, splats = {}, shown.SplatObjects(depsgraph)
    for entry in depsgraph.object_instances:
        obj = splats.of(entry)
        if obj is not None:
            owner = entry.parent.original if entry.is_instance else obj.original
            found[_key_of(entry, owner, obj.original)] = version.copy_of_evaluated_matrix(entry.matrix_world)
    return found


def _key_of(entry, owner, original):
    return (owner.name_full, original.name_full, *(entry.persistent_id if entry.is_instance else ()))


def _cloud_of(obj, mode, depsgraph, most, wait, changing):
    """Native splats of an evaluated object at the depsgraph's time, `most` at most, or None for none. Those that a
    frame changes are added to `changing` (ChangingSplats by the name of their datablock)."""
    data, original, scene = obj.data, obj.original.data, depsgraph.scene
    stipple = data.stipple
    if mode == 'RENDER' and bpy.app.background and not stipple.edited:
        # Stored splats of a file that is gone or has changed: nobody would see the panel that says so.
        sources.check_unchanged(original)
    # A view shows the splats of a bound file that follow their mesh already.
    moves = limits.has_budget(stipple) or bound.follows(original) and mode == 'RENDER'
    if moves and not _has_modifiers(obj) and not _is_edited(original, mode):
        least = source_settings.of(stipple).least_budget
        settings = sources.at_most(sources.decode_settings(stipple, mode, scene), most, least)
        carrier = None
        try:
            carrier = bound.carrier(original, depsgraph)
            if stipple.is_sequence:
                cloud = sequences.frame_of(original, stipple, scene.frame_current, mode, most).cloud()
            elif _waits(mode) or decoded.is_quick(original, settings):
                pending = decoded.begin(original, settings, wait and (lambda job: wait(obj.name, job)), carrier)
                if carrier is not None or source_settings.of(stipple).has_time:
                    changing[original.name_full] = ChangingSplats(original, settings, grades.settings_of(stipple))
                if wait is not None:
                    return LaterCloud(obj.name, pending, grades.settings_of(stipple))
                cloud = pending.cloud()
            else:
                # Nobody waits for a view: it shows what is stored, and what is wanted when that is there.
                if original.get(sync.WRITTEN_KEY) != sync.written_key(original, settings, carrier):
                    sync.follow_later()
                return _stored(obj, mode)
            return cloud and grades.apply(cloud, stipple)
        except CancelledError:
            raise
        except StippleError as error:
            # Without what the source needs beside its file, what is stored is still what it gives.
            if error.status != Status.ERROR_UNAVAILABLE or not sync.is_stored(original, settings, carrier):
                raise StippleError(f"Splat object '{obj.name}': {error}", error.status) from None
    return _stored(obj, mode)


def _waits(mode):
    """Whether an image is worth nothing without the splats that are wanted: it is no view of a window."""
    return mode == 'RENDER' or bpy.app.background


def _stored(obj, mode):
    """The splats of an evaluated object's attributes, or None for none."""
    if splat_data.count(obj.data) == 0:
        return None
    original, stipple = obj.original.data, obj.data.stipple
    if _has_modifiers(obj) or mode == 'VIEWPORT' and grades.is_shown(original, grades.settings_of(stipple)):
        # Attributes carry the grade, and modifiers see them. Views are drawn again whenever anything changes: theirs
        # are kept.
        return viewed.stored_cloud(obj) if mode == 'VIEWPORT' else sources.cloud_from_object(obj)
    return grades.cloud_of(obj)


def _is_edited(data, mode):
    return viewed.is_edited(data) if mode == 'VIEWPORT' else sync.is_edited(data)


def _has_modifiers(obj):
    return any(modifier.show_viewport or modifier.show_render for modifier in obj.modifiers)
