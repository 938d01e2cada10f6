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
    text = data.get(MASK_KEY)
    return None if text is None else unpacked(text, data[COUNTS_KEY][0])


def store(data, mask):
    """Replaces the mask of a datablock; one that keeps every splat is none."""
    kept = int(np.count_nonzero(mask))
    if kept == len(mask):
        clear(data)
        return
    data[MASK_KEY] = packed(mask)
    data[COUNTS_KEY] = [len(mask), kept]


def packed(mask):
    """A mask as text."""
    return base64.b64encode(zlib.compress(np.packbits(mask != 0).tobytes(), 1)).decode()


def unpacked(text, count):
    """The mask [count] of a text. Errors: ValueError and zlib.error for a text that is of no such mask."""
    size = -(-count // 8)
    reader = zlib.decompressobj()
    bits = reader.decompress(base64.b64decode(text, validate=True), size + 1)  # whatever the text claims to hold
    if len(bits) != size:
        raise ValueError(f'{len(bits):,} bytes of a mask; {count:,} splats have {size:,}')
    return np.unpackbits(np.frombuffer(bits, np.uint8), count=count)


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
    text = data.get(MASK_KEY)
    return '' if text is None else f'mask {zlib.crc32(text.encode()):08x}'
