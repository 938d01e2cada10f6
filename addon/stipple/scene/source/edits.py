# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits that are stored as masks on sources: which objects can take them, and writing the result."""

from dataclasses import dataclass

import numpy as np

from ...binding.cloud import Cloud
from ...binding.errors import invalid
from . import bound, decoded, erased, masks, selections, source_settings, sources, splat_data, sync


@dataclass
class Target:
    """A splat datablock that is being edited, with its source."""

    obj: object         # one of its objects: the one whose matrix counts
    cloud: Cloud        # the whole source, as in its file
    mask: np.ndarray    # [N] what stayed before the edit

    def on(self, cloud):
        """The same with another source of as many splats."""
        return Target(self.obj, cloud, self.mask)


@dataclass
class Outcome:
    removed: int = 0
    kept: int = 0

    def add(self, other):
        self.removed += other.removed
        self.kept += other.kept

    def __str__(self):
        return f'{self.removed:,} splats hidden, {self.kept:,} stay'


def selected_splats(context):
    """Selected splat objects, one for each datablock, the active one first."""
    found, active = {}, context.view_layer.objects.active
    for obj in sorted(context.view_layer.objects.selected, key=lambda o: o != active):
        if splat_data.is_splat_object(obj):
            found.setdefault(obj.data.name_full, obj)
    return list(found.values())


def targets(objects):
    """Each object with its source. Errors: StippleError for none, and for one that cannot take a mask."""
    if not objects:
        raise nothing_is_selected()
    for obj in objects:
        _check(obj)
    found = []
    for obj in objects:
        cloud = source_of(obj)
        found.append(Target(obj, cloud, mask_of(obj, cloud)))
    return found


def nothing_is_selected():
    return invalid('No splat object is selected; select at least one.')


def mask_of(obj, cloud):
    """[N] what stays of an object's whole source. Errors: StippleError for a mask of another count."""
    mask, count = masks.read(obj.data), cloud.info().count
    if mask is None:
        return np.ones(count, np.uint8)
    if len(mask) != count:
        raise invalid(f"'{obj.name}' has a mask of {len(mask):,} splats; its source has {count:,}. Clear the mask "
                      'first.')
    return mask


def spread(mask, chosen):
    """A mask of the splats that stayed under another one, as a mask of all."""
    result = mask.copy()
    result[mask != 0] = chosen
    return result


def write(edited):
    """Stores [(target, mask)], each on top of the mask before. Returns what it came to. Undo takes it back."""
    outcome = Outcome()
    for target, mask in edited:
        both = target.mask & mask
        if not both.any():
            raise nothing_stays(target.obj)
    for target, mask in edited:
        data = target.obj.data
        both = target.mask & mask
        before, after = int(np.count_nonzero(target.mask)), int(np.count_nonzero(both))
        outcome.removed += before - after
        outcome.kept += after
        masks.store(data, both)
        selections.trim(data, both)
        show(data, target.cloud)
    return outcome


def attach(data, path, count, is_tree, mask=None, settings=None):
    """Notes a file of splats, or a tree of so many, as the source of a datablock. mask: [count] what stays of it, None
    for all. settings: StippleModelSettings of what is a tree and moves."""
    with sync.paused():
        masks.clear(data)
        if is_tree:
            sources.attach_tree(data, path, count)
            if settings is not None:
                source_settings.note_model(data.stipple, source_settings.of_model(settings))
        else:
            sources.attach_cloud(data, path)
        if mask is not None:
            masks.store(data, mask)


def is_any_hidden(objects):
    """Whether splats of any object were hidden or erased. Cheap enough for a menu."""
    return any(masks.counts(obj.data) is not None or erased.any_of(obj.data) for obj in objects)


def nothing_stays(obj):
    return invalid(f"No splat of '{obj.name}' would stay; at least one has to.")


def show(data, cloud=None):
    """Writes the splats of a datablock anew after its mask has changed. cloud: the whole source, where it is at
    hand."""
    settings = sources.decode_settings(data.stipple)
    if source_settings.of(data.stipple).as_they_are and cloud is not None:
        splats = sources.masked(cloud, data)
    else:
        splats = decoded.decode_data(data, settings)
    sync.write(data, splats.columns(), sync.written_key(data, settings))


def refuse_sequence(obj):
    """Refuses what can only be done to the splats of one file."""
    if obj.data.stipple.is_sequence:
        raise invalid(f"'{obj.name}' is a series of files, and this changes the splats of one; choose Use as New "
                      'Source first, which keeps the present frame alone.')


def refuse_moving(obj):
    """Refuses what would leave one moment of splats that move."""
    if source_settings.of(obj.data.stipple).has_time and not obj.data.stipple.edited:
        raise invalid(f"'{obj.name}' is a clip of splats that move, and this changes the splats of one moment; choose Use "
                      'as New Source first, which keeps the moment that is shown.')


def check_editable(obj, is_edited=sync.is_edited):
    """Refuses splats that nothing can be taken from. is_edited: tells whether a datablock was edited by hand."""
    data = obj.data
    if data.library is not None:
        raise invalid(f"'{obj.name}' is linked from another file; make it local first.")
    refuse_sequence(obj)
    if bound.follows(data):
        raise invalid(f"'{obj.name}' follows a mesh, and its splats are edited where they were bound; turn Follow Mesh "
                      'off in its Splat Binding panel first.')
    if data.stipple.edited or is_edited(data):
        raise invalid(f"'{obj.name}' was edited by hand; choose Use as New Source or Revert to Source first.")


def _check(obj):
    data = obj.data
    known = source_settings.of(data.stipple)
    if not known.takes_mask and data.library is None and not data.stipple.is_sequence:
        made = ('decoded from a learned field' if known.is_learned else
                'made by anchors' if known.most_budget else 'made from meshes')
        raise invalid(f"'{obj.name}' is {made}, so there are no splats of a file to hide; choose Use as New Source "
                      f"first, "
                      'which keeps the present ones.')
    check_editable(obj)


def give_source(obj):
    """Splats that have no source get a file of their own."""
    data = obj.data
    if not source_settings.of(data.stipple).has_source or not data.stipple.source:
        path = sources.save_cloud(sources.ungraded_cloud(obj), obj.name)
        with sync.paused():
            sources.attach_cloud(data, path)


def source_of(obj):
    """The whole cloud of the source; splats that have none get one first."""
    give_source(obj)
    return sources.whole_cloud(obj.data)
