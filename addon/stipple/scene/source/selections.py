# SPDX-License-Identifier: GPL-3.0-or-later
"""Which splats of a datablock are selected: ID properties, so that undo, saving, appending and copies treat a selection
like every other setting.

Of splats of a file it is a bit for each splat of the source, whatever the budget shows. All others are decoded anew at
each budget: there it is the regions that were selected, one after the other, in the object's space. A selection of bits
is of one source: where that is replaced, nothing is selected any more.
"""

import json
import zlib

import numpy as np

from ...binding import regions
from ...binding.errors import StippleError
from . import masks, source_paths, source_settings

KEY = 'stipple_selection'
COUNTS_KEY = 'stipple_selection_counts'  # splats that can be selected, and those that are
VERSION = 1
_KEYS = (KEY, COUNTS_KEY)


def takes_mask(data):
    """Whether a selection is bits of the source's splats, else regions."""
    return source_settings.of(data.stipple).takes_mask


def is_empty(data):
    return KEY not in data


def read_mask(data, count):
    """[count] 1 for a splat of the source that is selected, erased ones included. What cannot be read, or is of another
    source, selects nothing."""
    try:
        stored = _stored(data)
        if stored is not None and stored['source'] == source_paths.identity(data.stipple) and stored['count'] == count:
            return masks.unpacked(stored['mask'], count)
    except (ValueError, KeyError, TypeError, RecursionError, zlib.error):
        pass
    return np.zeros(count, np.uint8)


def read_regions(data):
    """The regions that are selected, in their order. What cannot be read selects nothing."""
    try:
        stored = _stored(data)
        return [] if stored is None else [regions.Region.from_record(record) for record in stored['regions']]
    except (StippleError, ValueError, KeyError, TypeError, RecursionError):
        return []


def store_mask(data, mask, total):
    """Replaces the selection. total: splats that could be selected."""
    selected = int(np.count_nonzero(mask))
    if selected == 0:
        clear(data)
        return
    _store(data, {'source': source_paths.identity(data.stipple), 'count': len(mask), 'mask': masks.packed(mask)},
           total, selected)


def store_regions(data, chosen, total, selected):
    """Replaces the selection by regions. total, selected: splats that they were counted of, and in them."""
    if not chosen:
        clear(data)
        return
    _store(data, {'regions': [region.to_record() for region in chosen]}, total, selected)


def trim(data, mask):
    """Splats that are hidden now are not selected any more. In: mask [N] of what stays."""
    if not is_empty(data):
        store_mask(data, read_mask(data, len(mask)) & (mask != 0), int(np.count_nonzero(mask)))


def clear(data):
    for key in _KEYS:
        if key in data:
            del data[key]


def copy(old, new):
    for key in _KEYS:
        if key in old:
            new[key] = old[key]


def stored_counts(data):
    """(splats that could be selected, those that were) when the selection was made, or None where there is none."""
    found = data.get(COUNTS_KEY)
    return None if found is None or KEY not in data else (found[0], found[1])


def state(data):
    """Changes with the selection."""
    text = data.get(KEY)
    return None if text is None else zlib.crc32(text.encode())


def _stored(data):
    text = data.get(KEY)
    stored = None if text is None else json.loads(text)
    return stored if stored is not None and stored['version'] == VERSION else None


def _store(data, entries, total, selected):
    data[KEY] = json.dumps({'version': VERSION, **entries})
    data[COUNTS_KEY] = [total, selected]
