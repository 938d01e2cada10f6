# SPDX-License-Identifier: GPL-3.0-or-later
"""What a view layer does with the objects of its depsgraph."""

import bpy

from .source import splat_data


def is_shown(entry):
    """Whether an entry of depsgraph.object_instances shows at all: not the hidden objects that only carry instances."""
    return entry.show_self or entry.is_instance


def seen_by_camera(entry, depsgraph):
    """Whether the camera sees an entry: ray visibility, and Indirect Only of its collections."""
    return getattr(entry.object, 'visible_camera', True) and not _owner(entry).indirect_only_get(
        view_layer=depsgraph.view_layer_eval)


def holds_out(entry, depsgraph):
    """Whether an entry is a holdout: by itself or by its collections. Cycles does not ask the object that is
    instanced."""
    return _owner(entry).holdout_get(view_layer=depsgraph.view_layer_eval)


class SplatObjects:
    """Which splats the entries of a depsgraph's object_instances show.

    Geometry nodes instance geometry without its object where As Instance is off: then the splats are those of the
    object that has them as its data.
    """

    def __init__(self, depsgraph):
        self._depsgraph = depsgraph
        self._objects = None  # by name of their data
        self._same = {}

    def of(self, entry):
        """The evaluated object whose splats an entry shows; None where it shows none."""
        obj = entry.object
        found = self._of_geometry(entry) if entry.is_instance else None
        return found or (obj if splat_data.is_splat_object(obj) else None)

    def _of_geometry(self, entry):
        data = entry.object.data
        if not splat_data.is_splats(data) or data.original == entry.object.original.data:
            return None
        if self._objects is None:
            self._objects = {obj.data.name_full: obj for obj in bpy.data.objects if splat_data.is_splat_object(obj)}
        known = self._objects.get(data.original.name_full)
        if known is None:
            return None
        evaluated = known.evaluated_get(self._depsgraph)
        # Nodes may have changed the geometry on its way: then it is no object's.
        key = data.as_pointer()
        if key not in self._same:
            self._same[key] = splat_data.fingerprint(data) == splat_data.fingerprint(evaluated.data)
        return evaluated if self._same[key] else None


def _owner(entry):
    """The evaluated object whose collections count, as in Cycles: instances are where their instancer is."""
    return entry.parent if entry.is_instance else entry.object
