# SPDX-License-Identifier: GPL-3.0-or-later
"""Selecting splats of objects, and erasing what is selected.

Both kinds of targets have the same doors: after(regions) tells what a selection would be, keep_selected() stores it,
erase() hides splats, selected_cloud() and ground() are what Separate and Fill take. Only splats that are not erased can
be selected.
"""

from dataclasses import dataclass

import numpy as np

from ...binding import cloud_edit, regions
from ...binding.errors import StippleError, invalid
from ...binding.regions import Region, RegionKind, RegionOperation
from ..view import viewed
from . import decoded, edits, erased, masks, placement, selections, source_settings, sources, splat_data, sync

# Splats of what was decoded last, for the strokes that come after: {name of the data: (state, cloud)}.
_decoded = {}
# Masks of selections that are regions: {name of the data: (state, mask)}.
_masks = {}


@dataclass
class Outcome:
    total: int = 0
    selected: int = 0

    def __str__(self):
        return f'{self.selected:,} of {self.total:,} splats selected'


class MaskTarget:
    """Splats of a file: all of the source count, whatever the budget shows."""

    def __init__(self, obj):
        self.obj = obj
        self.cloud = edits.source_of(obj)
        self.stays = edits.mask_of(obj, self.cloud)
        self.selected = selections.read_mask(obj.data, len(self.stays)) & self.stays

    def after(self, chosen):
        """What would be selected after these regions. Errors: StippleError."""
        before = self.selected
        if any(region.kind == RegionKind.GROW and _shrinks(region) for region in chosen):
            before = before | (1 - self.stays)  # a hole is no edge that a selection shrinks from
        return regions.select(self.cloud, chosen, before) & self.stays

    def keep_selected(self, selected, _chosen):
        selections.store_mask(self.obj.data, selected, int(np.count_nonzero(self.stays)))
        return Outcome(int(np.count_nonzero(self.stays)), int(np.count_nonzero(selected)))

    def check_erase(self, keeps=False):
        """Errors: StippleError where no splat would stay."""
        if not np.any(self.stays & self._left(keeps)):
            raise edits.nothing_stays(self.obj)

    def erase(self, keeps=False):
        """Hides what is selected, or all else. Returns an edits.Outcome. Errors: StippleError."""
        outcome = edits.write([(edits.Target(self.obj, self.cloud, self.stays), self._left(keeps))])
        selections.clear(self.obj.data)
        return outcome

    def selected_cloud(self):
        return cloud_edit.keep(self.cloud, self.selected)

    def visible_cloud(self):
        return self.cloud if np.all(self.stays) else cloud_edit.keep(self.cloud, self.stays)

    def ground(self):
        """What Fill works on: what is selected, else what was hidden before. None where there is neither."""
        if np.any(self.selected):
            return Ground(self.obj, self.visible_cloud(), self.selected[self.stays != 0], self.cloud, self.stays,
                          1 - self.selected)
        if np.all(self.stays):
            return None
        return Ground(self.obj, self.cloud, 1 - self.stays, self.cloud, self.stays, self.stays)

    def _left(self, keeps):
        return self.selected if keeps else 1 - self.selected


class RegionTarget:
    """Splats that are decoded anew at each budget: those of the present one are counted."""

    def __init__(self, obj):
        self.obj = obj
        self.cloud = _decoded_cloud(obj)
        self.stays = np.ones(self.cloud.info().count, np.uint8)
        self.regions = selections.read_regions(obj.data)
        self.selected = mask_of_regions(obj)

    after = MaskTarget.after
    check_erase = MaskTarget.check_erase
    _left = MaskTarget._left

    def keep_selected(self, selected, chosen):
        if chosen[0].kind != RegionKind.GROW and chosen[0].operation == RegionOperation.SET:
            self.regions = []
        self.regions = [*self.regions, *chosen]
        total, count = len(selected), int(np.count_nonzero(selected))
        if chosen[-1].kind == RegionKind.ALL and chosen[-1].operation == RegionOperation.SUBTRACT:
            self.regions = []
        data = self.obj.data
        selections.store_regions(data, self.regions, total, count)
        _masks[data.name_full] = (_mask_state(data), selected)
        return Outcome(total, count)

    def erase(self, keeps=False):
        data = self.obj.data
        before, count = data.get(erased.KEY), splat_data.count(data)
        erased.add(data, self.regions, keeps)
        try:
            edits.show(data)
        except StippleError:
            erased.clear(data)
            if before is not None:
                data[erased.KEY] = before
            raise
        selections.clear(data)
        left = splat_data.count(data)
        return edits.Outcome(count - left, left)

    def selected_cloud(self):
        """What is selected at the render budget. Errors: StippleError where that is nothing."""
        full = decoded.full_cloud(self.obj.data)
        mask = regions.select(full, self.regions)
        if not np.any(mask):
            raise invalid(f"Nothing of '{self.obj.name}' is selected at its render budget; choose a larger one.")
        return cloud_edit.keep(full, mask)

    def visible_cloud(self):
        return self.cloud

    def ground(self):
        data = self.obj.data
        if self.regions:
            whole = decoded.full_cloud(data)
            left = 1 - regions.select(whole, self.regions)
        elif erased.any_of(data):
            whole = sources.model_of(data).decode(sources.decode_settings(data.stipple, 'RENDER'))
            left = erased.read(data).stays(whole)
        else:
            return None
        return Ground(self.obj, whole, 1 - left, whole, np.ones_like(left), left)


@dataclass(frozen=True)
class Ground:
    """Where splats are to be filled in."""

    obj: object
    cloud: object       # in which the hole is
    hole: np.ndarray    # [N] 1 for a splat of it that is removed
    whole: object       # the cloud that the new source is made of
    stays: np.ndarray   # [M] 1 for a splat of that which was not hidden
    rest: np.ndarray    # [M] 1 for one that the new source has, too


def targets(context, objects):
    """Each object with its splats. Errors: StippleError for none, and for one whose splats cannot be edited."""
    if not objects:
        raise edits.nothing_is_selected()
    context.view_layer.update()  # what was edited by hand just now counts
    for obj in objects:
        edits.check_editable(obj, viewed.is_edited)
    return [MaskTarget(obj) if selections.takes_mask(obj.data) else RegionTarget(obj) for obj in objects]


def prepare(objects):
    """Takes what the next stroke over objects needs: begins to read what is in files, in a thread, and returns whether
    all is at hand. Changes nothing that a stroke gives. Errors: StippleError."""
    is_ready = True
    for obj in objects:
        if selections.takes_mask(obj.data):
            known = source_settings.of(obj.data.stipple)
            # Splats without a file get one by the first stroke, and not because somebody looks at them.
            if known.has_source and obj.data.stipple.source:
                is_ready = sources.read_whole_ahead(obj.data) and is_ready
        else:
            mask_of_regions(obj)
    return is_ready


def select(found, regions_of):
    """Changes the selections of targets. regions_of: a function of an object, its regions in its own space. Returns an
    Outcome. Errors: StippleError, with all selections as they were."""
    outcome, changed = Outcome(), []
    for target in found:
        chosen = regions_of(target.obj)
        changed.append((target, target.after(chosen), chosen))
    for target, selected, chosen in changed:
        one = target.keep_selected(selected, chosen)
        outcome.total += one.total
        outcome.selected += one.selected
    return outcome


def with_selection(context, objects):
    """targets() with something selected. Errors: StippleError where nothing is."""
    found = [target for target in targets(context, objects) if np.any(target.selected)]
    if not found:
        raise invalid('No splats are selected; select some first, for instance with the brush in the toolbar of the 3D '
                      'view.')
    return found


def grounds(context, objects):
    """A Ground for each object that has one. Errors: StippleError for none."""
    found = [ground for ground in (target.ground() for target in targets(context, objects)) if ground is not None]
    if not found:
        raise invalid('No splats are selected, and none were erased; select the ground that is to be filled.')
    return found


def is_any(objects):
    """Whether anything is selected of the splats of any object. Cheap enough for a menu."""
    return any(not selections.is_empty(obj.data) for obj in objects)


def placed(found):
    """[(cloud, 4x4 object to world)] of the splats of targets that can be selected, not graded."""
    return [(target.visible_cloud(), placement.matrix_of(target.obj)) for target in found]


def everything(operation):
    """Regions of all splats: SET selects all, SUBTRACT none, TOGGLE the others."""
    return [Region(RegionKind.ALL, operation)]


def counts(data):
    """(splats that can be selected, those that are), or None where nothing is. Cheap enough for a panel."""
    found = selections.stored_counts(data)
    if found is None or selections.takes_mask(data):
        return found
    known = _masks.get(data.name_full)
    if known is not None and known[0] == _mask_state(data):
        return len(known[1]), int(np.count_nonzero(known[1]))
    return found


def selectable_count(data):
    """Splats that can be selected. Cheap enough for a panel."""
    hidden = masks.counts(data)
    if hidden is not None:
        return hidden[1]
    settings = source_settings.of(data.stipple)
    return data.stipple.source_count if settings.counts_splats else splat_data.count(data)


def positions(obj, most):
    """Centres [n,3] of selected splats of an object, in its own space: `most` at most, evenly chosen. Errors:
    StippleError."""
    data = obj.data
    if selections.is_empty(data):
        return np.zeros((0, 3), np.float32)
    if not selections.takes_mask(data):
        return regions.selected_positions(_decoded_cloud(obj), mask_of_regions(obj), most)
    cloud = sources.whole_cloud(data)
    count = cloud.info().count
    mask, stays = selections.read_mask(data, count), masks.read(data)
    return regions.selected_positions(cloud, mask if stays is None or len(stays) != count else mask & stays, most)


def state(data):
    """Changes with what is selected of the splats that are shown."""
    selected = selections.state(data)
    return None if selected is None else (selected, masks.key(data), data.get(sync.WRITTEN_KEY))


def mask_of_regions(obj):
    """The mask of the splats that are shown which lie in the regions that are selected. Errors: StippleError."""
    data = obj.data
    known, now = _masks.get(data.name_full), _mask_state(data)
    if known is None or known[0] != now:
        cloud = _decoded_cloud(obj)
        chosen = selections.read_regions(data)
        mask = regions.select(cloud, chosen) if chosen else np.zeros(cloud.info().count, np.uint8)
        known = _masks[data.name_full] = (now, mask)
    return known[1]


def forget():
    _decoded.clear()
    _masks.clear()


def _shrinks(region):
    return region.shrink or region.distance < 0


def _mask_state(data):
    return selections.state(data), _shown_state(data)


def _shown_state(data):
    return data.get(sync.WRITTEN_KEY), splat_data.count(data)


def _decoded_cloud(obj):
    """The splats that an object shows, not graded."""
    data = obj.data
    known, now = _decoded.get(data.name_full), _shown_state(data)
    if known is None or known[0] != now:
        _decoded.clear()
        known = _decoded[data.name_full] = (now, sources.ungraded_cloud(obj))
    return known[1]
