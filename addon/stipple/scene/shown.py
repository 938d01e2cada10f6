# SPDX-License-Identifier: GPL-3.0-or-later
"""What a view layer does with the objects of its depsgraph."""


def is_shown(entry):
    """Whether an entry of depsgraph.object_instances shows at all: not the hidden objects that only carry instances."""
    return entry.show_self or entry.is_instance


def seen_by_camera(entry, depsgraph):
    """Whether the camera sees an entry: ray visibility, and Indirect Only of its collections."""
    return getattr(entry.object, 'visible_camera', True) and not _owner(entry).indirect_only_get(
        view_layer=depsgraph.view_layer_eval)


def holds_out(entry, depsgraph):
    """Whether an entry is a holdout: by itself or by its collections. Cycles does not ask the object that is instanced."""
    return _owner(entry).holdout_get(view_layer=depsgraph.view_layer_eval)


def _owner(entry):
    """The evaluated object whose collections count, as in Cycles: instances are where their instancer is."""
    return entry.parent if entry.is_instance else entry.object
