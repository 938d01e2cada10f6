# SPDX-License-Identifier: GPL-3.0-or-later
"""What was erased from splats that are decoded anew at each budget: regions of the object's space, in an ID property.

Splats of meshes and fields are no rows of a file, so no mask can name them. Each erasing keeps the regions that were
selected; decoding leaves out what they contain, at any budget. So undo, saving, appending and copies treat them like
every other setting.
"""

import json
import zlib
from dataclasses import dataclass

import numpy as np

from ...binding import cloud_edit, regions
from ...binding.errors import StippleError, invalid

KEY = 'stipple_erased'
VERSION = 1


@dataclass(frozen=True)
class Erasing:
    """One step of erasing."""

    regions: tuple
    keeps: bool = False  # what the regions contain is what stays

    @property
    def has_neighbours(self):
        """Whether it depends on which splats are beside each other."""
        return any(region.kind == regions.RegionKind.GROW for region in self.regions)


@dataclass(frozen=True)
class Erased:
    """All that was erased of a datablock. Never touches Blender."""

    steps: tuple = ()

    def stays(self, cloud):
        """[N] 1 for a splat of a decoded cloud that was not erased. Errors: StippleError."""
        stays = np.ones(cloud.info().count, np.uint8)
        for step in self.steps:
            if step.has_neighbours:
                # What is gone is nobody's neighbour.
                chosen = np.zeros_like(stays)
                chosen[stays != 0] = regions.select(_kept(cloud, stays), step.regions)
            else:
                chosen = regions.select(cloud, step.regions)
            stays &= chosen if step.keeps else 1 - chosen
        return stays

    def applied(self, cloud):
        """The splats of a decoded cloud that stay: itself where all do. Errors: StippleError."""
        return _kept(cloud, self.stays(cloud)) if self.steps else cloud


NOTHING = Erased()
_read = {}  # by text: the one that was read last


def read(data):
    """What was erased of a datablock. Errors: StippleError for a text that cannot be read."""
    text = data.get(KEY)
    if text is None:
        return NOTHING
    if text not in _read:
        found = _parsed(text, data.name)
        _read.clear()
        _read[text] = found
    return _read[text]


def add(data, chosen, keeps=False):
    """Erases what regions contain, or all else. Errors: StippleError."""
    steps = [{'keeps': step.keeps, 'regions': [region.to_record() for region in step.regions]}
             for step in (*read(data).steps, Erasing(tuple(chosen), keeps))]
    data[KEY] = json.dumps({'version': VERSION, 'steps': steps})


def clear(data):
    if KEY in data:
        del data[KEY]


def copy(old, new):
    if KEY in old:
        new[KEY] = old[KEY]


def any_of(data):
    """Whether anything was erased. Reads nothing."""
    return KEY in data


def key(data):
    """A text that is equal where the same was erased; empty for nothing."""
    text = data.get(KEY)
    return '' if text is None else f'erased {zlib.crc32(text.encode()):08x}'


def _kept(cloud, stays):
    return cloud if np.all(stays) else cloud_edit.keep(cloud, stays)


def _parsed(text, name):
    try:
        stored = json.loads(text)
        if stored['version'] != VERSION:
            raise invalid(f"it has version {stored['version']}, and {VERSION} is known")
        return Erased(tuple(Erasing(tuple(map(regions.Region.from_record, step['regions'])), bool(step['keeps']))
                            for step in stored['steps']))
    except (StippleError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise invalid(f"What was erased of '{name}' cannot be read: {error}. Choose Clear Mask to bring all its splats "
                      'back.') from None
