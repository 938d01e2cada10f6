# SPDX-License-Identifier: GPL-3.0-or-later
"""What an engine that hands no pixels to Python wrote: uncompressed scanline OpenEXR, one or several parts.

Source: the OpenEXR file layout (openexr.com, Technical Introduction).
"""

import struct

import numpy as np

_MAGIC = 20000630
_MULTI_PART = 0x1000
_TYPES = {0: np.dtype('<u4'), 1: np.dtype('<f2'), 2: np.dtype('<f4')}


def read(path):
    """{channel: [H,W] values as stored, row 0 = top}. Errors: ValueError for another kind of file, OSError."""
    with open(path, 'rb') as file:
        data = file.read()
    try:
        return _channels(data)
    except (struct.error, IndexError, KeyError, ValueError) as error:
        raise ValueError(f"'{path}' is not a complete, uncompressed OpenEXR file: {error}") from None


def _channels(data):
    magic, version = struct.unpack_from('<II', data, 0)
    if magic != _MAGIC:
        raise ValueError('it is another kind of file')
    headers, offset = [], 8
    while True:
        header, offset = _header(data, offset)
        headers.append(header)
        if not version & _MULTI_PART:
            break
        if data[offset] == 0:
            offset += 1
            break
    tables = []
    for header in headers:
        if header['compression'][0] != 0:
            raise ValueError('it is compressed')
        rows = _window(header)[1]
        tables.append(struct.unpack_from(f'<{rows}Q', data, offset))
        offset += 8 * rows
    found = {}
    for header, table in zip(headers, tables):
        found.update(_part(data, header, table, 12 if version & _MULTI_PART else 8))
    return found


def _header(data, offset):
    header = {}
    while True:
        name, offset = _text(data, offset)
        if not name:
            return header, offset
        _, offset = _text(data, offset)
        size, = struct.unpack_from('<i', data, offset)
        header[name] = data[offset + 4:offset + 4 + size]
        offset += 4 + size


def _text(data, offset):
    end = data.index(b'\0', offset)
    return data[offset:end].decode('latin1'), end + 1


def _window(header):
    x0, y0, x1, y1 = struct.unpack('<4i', header['dataWindow'])
    return x1 - x0 + 1, y1 - y0 + 1


def _part(data, header, table, head_bytes):
    width, rows = _window(header)
    channels, at = [], 0
    entries = header['channels']
    while entries[at]:
        name, at = _text(entries, at)
        kind, = struct.unpack_from('<i', entries, at)
        channels.append((name, _TYPES[kind]))
        at += 16
    # Parts that hold one layer may leave its name out of their channels.
    part = header['name'].decode('latin1').rstrip('\0') if 'name' in header else ''
    prefix = f'{part}.' if part and not any('.' in name for name, _ in channels) else ''
    row_bytes = width * sum(kind.itemsize for _, kind in channels)
    pixels = np.empty((rows, row_bytes), np.uint8)
    for y, start in enumerate(table):
        row = np.frombuffer(data, np.uint8, row_bytes, start + head_bytes)
        pixels[y] = row
    found, begin = {}, 0
    for name, kind in channels:
        end = begin + width * kind.itemsize
        found[prefix + name] = np.ascontiguousarray(pixels[:, begin:end]).view(kind)
        begin = end
    return found
