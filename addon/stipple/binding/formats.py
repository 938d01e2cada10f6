# SPDX-License-Identifier: GPL-3.0-or-later
"""The splat file formats that the library knows."""

from ctypes import byref, c_uint64
from dataclasses import dataclass

from .errors import check
from .structs import Frame, StippleFormatInfo


@dataclass(frozen=True)
class SplatFormat:
    name: str           # one word
    title: str          # for people
    endings: tuple      # of file names, lower case, the usual one first
    can_read: bool
    can_write: bool
    max_sh_degree: int  # that it holds
    frame: Frame        # that positions are written in


def splat_formats(library):
    """Every format of splat files, in the order in which files are tried."""
    count = c_uint64()
    check(library, library.stipple_format_count(byref(count)))
    formats = []
    for index in range(count.value):
        info = StippleFormatInfo()
        check(library, library.stipple_format_info(index, byref(info)))
        formats.append(SplatFormat(info.name.decode(), info.title.decode(), tuple(info.endings.decode().split()),
                                   bool(info.can_read), bool(info.can_write), info.max_sh_degree, Frame(info.frame)))
    return formats


def splat_format_of_file(library, path):
    """The format of an existing file by its content, or None: a glTF file may hold meshes only."""
    index = c_uint64()
    check(library, library.stipple_format_of_file(str(path).encode(), byref(index)))
    formats = splat_formats(library)
    return formats[index.value] if index.value < len(formats) else None
