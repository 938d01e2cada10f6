# SPDX-License-Identifier: GPL-3.0-or-later
"""Splat objects that a view layer shows, with their instances, as native clouds."""

import bpy

from .. import version
from ..binding.errors import StippleError
from . import grades, placement, sequences, sources, splat_data, sync, viewed


def gather(depsgraph, mode, warn=lambda message: None):
    """[(cloud, 4x4 object to world)]. Decodes from evaluated settings; writes no datablock.

    mode: 'VIEWPORT' or 'RENDER', which budget. warn: called with a sentence per object that is left out.
    """
    return [(cloud, matrix) for _, _, cloud, matrix in gather_owned(depsgraph, mode, warn)]


def gather_owned(depsgraph, mode, warn=lambda message: None):
    """[(owner, object, cloud, matrix)] with the original object, and the original one that it is selected and hidden
    with: itself or its instancer."""
    clouds, found = {}, []
    for entry in depsgraph.object_instances:
        obj = entry.object
        if not splat_data.is_splat_object(obj) or not (entry.show_self or entry.is_instance):
            continue
        if not getattr(obj, 'visible_camera', True):
            continue
        if obj.is_holdout:
            warn(f"Splat object '{obj.name}' is a holdout, which splats do not support; it is left out.")
            continue
        matrix = version.copy_of_evaluated_matrix(entry.matrix_world)
        if placement.is_flat(matrix):
            warn(f"Splat object '{obj.name}' is scaled to zero; it is left out.")
            continue
        key = obj.data.as_pointer()
        if key not in clouds:
            clouds[key] = _cloud_of(obj, mode, depsgraph.scene.frame_current)
        if clouds[key] is not None:
            original = obj.original
            owner = entry.parent.original if entry.is_instance else original
            found.append((owner, original, clouds[key], matrix))
    return found


def _cloud_of(obj, mode, frame):
    """Native splats of an evaluated object at a frame of the scene, or None for none."""
    data, original = obj.data, obj.original.data
    stipple = data.stipple
    if mode == 'RENDER' and bpy.app.background and not stipple.edited:
        # Stored splats of a file that is gone or has changed: nobody would see the panel that says so.
        sources.check_unchanged(original)
    from_source = (stipple.is_sequence or stipple.source_kind in sources.MODEL_KINDS) and not stipple.edited
    if from_source and not _has_modifiers(obj) and not _is_edited(original, mode):
        try:
            if stipple.is_sequence:
                cloud = sequences.frame_of(original, stipple, frame, mode).cloud()
            else:
                cloud = sources.decode(original, sources.decode_settings(stipple, mode))
            return cloud and grades.apply(cloud, stipple)
        except StippleError as error:
            raise StippleError(f"Splat object '{obj.name}': {error}", error.status) from None
    if splat_data.count(data) == 0:
        return None
    if _has_modifiers(obj) or mode == 'VIEWPORT' and grades.is_shown(original, grades.settings_of(stipple)):
        # Attributes carry the grade, and modifiers see them. Views are drawn again whenever anything changes: theirs
        # are kept.
        return viewed.stored_cloud(obj) if mode == 'VIEWPORT' else sources.cloud_from_object(obj)
    return grades.cloud_of(obj)


def _is_edited(data, mode):
    return viewed.is_edited(data) if mode == 'VIEWPORT' else sync.is_edited(data)


def _has_modifiers(obj):
    return any(modifier.show_viewport or modifier.show_render for modifier in obj.modifiers)
