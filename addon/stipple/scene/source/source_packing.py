# SPDX-License-Identifier: GPL-3.0-or-later
"""Series of files inside the .blend.

Blender packs one file for each Image. A part of a series would be lost when it is unpacked somewhere else, so the
Image of a series is one that Blender passes over (source_paths.py), until it is packed here: then each of the files has
an Image, which Blender unpacks and remaps like any other.
"""

import os

import bpy

from ... import log, preferences
from ...binding import structs
from ...binding.errors import StippleError
from . import source_files, source_paths

_MAX_FILE_BYTES = 2**31 - 1  # of a packed file: Blender counts its bytes in 32 bits
_SHARE_OF_MEMORY = 0.6       # as native work has it where the preferences name no limit
_GIB = 2**30

_said = set()  # refusals, by path


def series():
    """This file's datablocks with a series of files."""
    return [data for data in source_paths.splat_datablocks()
            if data.stipple.is_sequence and source_paths.is_own(data) and data.stipple.source_file is not None
            and source_paths.is_own(data.stipple.source_file)]


def pack(data):
    """Packs the files of a series that are not packed yet; returns how many are, and their bytes. Errors: StippleError;
    nothing is packed then."""
    first, entries = data.stipple.source_file, data.stipple.series_files
    path = os.path.normpath(bpy.path.abspath(first.filepath))
    if first.packed_file is None or os.path.exists(path):
        paths = _paths(path)
        _require_room(path, paths)
        files = _images(first, path, paths)
        entries.clear()
        for file in files:
            entries.add().file = file
    packed = source_paths.packed_files(data)
    return len(packed), sum(file.packed_file.size for file in packed)


def complete():
    """Before a save: of a series that is to be packed all files are, of one that is not none."""
    for data in series():
        if data.stipple.source_file.packed_file is None and not bpy.data.use_autopack:
            data.stipple.series_files.clear()
            continue
        try:
            pack(data)
        except StippleError as error:
            if str(error) not in _said:
                _said.add(str(error))
                log.error('%s', error)


def forget():
    _said.clear()


def _images(first, path, paths):
    """Packed Images of the files of a series, some of which may be there already."""
    known = source_paths.packed_images()
    fresh, found = [], []
    try:
        for other in paths:
            file = first if other == path else known.get(other)
            if file is None:
                file = source_paths.new_image(source_paths.stored(other), source_paths.FILE)
            found.append(file)
            if file.packed_file is None:
                fresh.append(file)
                file.pack()
    except RuntimeError as error:  # what Blender reports
        for file in fresh:
            if file.packed_file is not None:
                file.unpack(method='REMOVE')
        raise StippleError(f"'{other}' cannot be packed: {str(error).strip().removeprefix('Error: ')}",
                           structs.Status.ERROR_IO) from None
    return found


def _paths(path):
    files = source_files.of(path, True)
    if not source_paths.is_alone(path):
        raise StippleError(f"The series '{path}' has {len(files.names):,} files in several folders, which a .blend "
                           'cannot hold; choose Collect Splat Sources instead.', structs.Status.ERROR_UNSUPPORTED)
    return [os.path.normpath(os.path.join(files.root, name)) for name in files.names]


def _require_room(path, paths):
    sizes = [os.path.getsize(each) for each in paths]
    room, chosen = _memory(), preferences.get()
    if chosen is not None and chosen.memory_limit:
        room = chosen.memory_limit << 20
    problem = ''
    if max(sizes) > _MAX_FILE_BYTES:
        problem = f'one of them has {max(sizes) / _GIB:.1f} GiB, and a .blend holds files of less than 2 GiB'
    elif sum(sizes) > room:
        problem = f'together {sum(sizes) / _GIB:.1f} GiB, and the memory limit is {room / _GIB:.1f} GiB'
    if problem:
        raise StippleError(f"The series '{path}' has {len(paths):,} files, {problem}; choose Collect Splat Sources "
                           'instead.', structs.Status.ERROR_MEMORY_LIMIT)


def _memory():
    try:
        return _SHARE_OF_MEMORY * os.sysconf('SC_PHYS_PAGES') * os.sysconf('SC_PAGE_SIZE')
    except (AttributeError, ValueError, OSError):  # a system that does not tell
        return float('inf')
