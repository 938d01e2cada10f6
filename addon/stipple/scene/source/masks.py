# SPDX-License-Identifier: GPL-3.0-or-later
"""Which splats of its source a datablock leaves out: packed bits in an ID property.

So undo, saving, linking and linked duplicates treat a mask like every other setting, and every budget
keeps it. The property is text: from Blender 4 on, bytes end at the first zero.
"""

import base64
import zlib

import numpy as np

MASK_KEY = 'stipple_mask'
COUNTS_KEY = 'stipple_mask_counts'  # splats of the source, and those that stay


def read(data):
    """The mask [N], 1 for a splat that stays, or None where all stay."""
    packed = data.get(MASK_KEY)
    if packed is None:
        return None
    total = data[COUNTS_KEY][0]
    bits = np.frombuffer(zlib.decompress(base64.b64decode(packed)), np.uint8)
    return np.unpackbits(bits, count=total)


def store(data, mask):
    """Replaces the mask of a datablock; one that keeps every splat is none."""
    kept = int(np.count_nonzero(mask))
    if kept == len(mask):
        clear(data)
        return
    data[MASK_KEY] = base64.b64encode(zlib.compress(np.packbits(mask != 0).tobytes(), 1)).decode()
    data[COUNTS_KEY] = [len(mask), kept]


def clear(data):
    for key in (MASK_KEY, COUNTS_KEY):
        if key in data:
            del data[key]


def copy(old, new):
    for key in (MASK_KEY, COUNTS_KEY):
        if key in old:
            new[key] = old[key]


def counts(data):
    """(splats of the source, splats that stay), or None where all stay."""
    found = data.get(COUNTS_KEY)
    return None if found is None else (found[0], found[1])


def key(data):
    """A text that is equal for equal masks; empty for none."""
    packed = data.get(MASK_KEY)
    return '' if packed is None else f'mask {zlib.crc32(packed.encode()):08x}'
