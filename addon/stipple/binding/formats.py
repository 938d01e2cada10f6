# SPDX-License-Identifier: GPL-3.0-or-later
"""The splat file formats that the library knows."""

from ctypes import byref, c_uint64
from dataclasses import dataclass

from .cloud import save_options
from .errors import check
from .structs import Frame, StippleFormatInfo


@dataclass(frozen=True)
class SplatFormat:
    name: str           # one word
    title: str          # for people
    extensions: tuple      # of file names, lower case, the usual one first
    can_read: bool
    can_write: bool
    max_sh_degree: int  # that it holds
    frame: Frame        # that positions are written in
    holds_times: bool   # one file may hold a series (series_file.py)
    keeps: frozenset    # of 'frame', 'colour_space' and 'antialias': what its files say of their splats


def splat_formats(library):
    """Every format of splat files, in the order in which files are tried."""
    count = c_uint64()
    check(library, library.stipple_format_count(byref(count)))
    formats = []
    kept = ('frame', 'colour_space', 'antialias')
    for index in range(count.value):
        info = StippleFormatInfo()
        check(library, library.stipple_format_info(index, byref(info)))
        formats.append(SplatFormat(info.name.decode(), info.title.decode(), tuple(info.extensions.decode().split()),
                                   bool(info.can_read), bool(info.can_write), info.max_sh_degree, Frame(info.frame),
                                   bool(info.holds_times), frozenset(what for what in kept if getattr(info, f'keeps_{what}'))))
    return formats


def estimated_bytes(library, form, count, degree, **options_given):
    """About how many bytes a file of this many splats takes; 0 where the format is not written. In: degree of the
    splats, which the format may lower; options_given as Cloud.save has them."""
    options, size = save_options(library, **options_given), c_uint64()
    index = splat_formats(library).index(form)
    check(library, library.stipple_format_estimate(index, count, degree, byref(options), byref(size)))
    return size.value


def splat_format_of_file(library, path):
    """The format of an existing file by its content, or None: a glTF file may hold meshes only."""
    index = c_uint64()
    check(library, library.stipple_format_of_file(str(path).encode(), byref(index)))
    formats = splat_formats(library)
    return formats[index.value] if index.value < len(formats) else None
