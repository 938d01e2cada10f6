# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds and loads libstipple, and refuses one that does not fit."""

import os
import sys
from ctypes import CDLL, c_uint32
from pathlib import Path

from . import contents
from .declarations import declare
from .errors import LibraryError
from .structs import ABI_VERSION

# What the library is called on each system.
FILE_NAMES = {'win32': 'stipple.dll', 'darwin': 'libstipple.dylib'}
FILE_NAME = FILE_NAMES.get(sys.platform, 'libstipple.so')
ENVIRONMENT_VARIABLE = 'STIPPLE_LIBRARY'

_loaded = {}
_refused = {}  # file → (time of the file, why it did not load)


def find(path=''):
    """The library's file: the given one, else the environment's, else the one inside the add-on."""
    if path:
        return Path(path)
    named = os.environ.get(ENVIRONMENT_VARIABLE)
    if named:
        return Path(named)
    return Path(__file__).resolve().parent.parent / 'lib' / FILE_NAME


def load(path=''):
    """The library with its functions declared; loaded once per file.

    Errors: LibraryError when the path is not absolute, the file is missing, is not the one that the add-on came with,
    cannot be loaded, or has another ABI version.
    """
    file = find(path)
    if not file.is_absolute():
        raise LibraryError(_relative(file))
    known = _loaded.get(file)
    if known is not None:
        return known
    if not file.is_file():
        raise LibraryError(_missing(file))
    try:
        _loaded[file] = _load(file)
    except LibraryError as error:
        _refused[file] = (file.stat().st_mtime_ns, str(error))
        raise
    return _loaded[file]


def problem(path=''):
    """Why the library cannot be used, '' where nothing is known to be wrong. Loads nothing: for menus and panels."""
    file = find(path)
    if file in _loaded:
        return ''
    if not file.is_absolute():
        return _relative(file)
    if not file.is_file():
        return _missing(file)
    time, why = _refused.get(file, (None, ''))
    return why if time == file.stat().st_mtime_ns else ''


def _relative(file):
    """A path that starts at the open file or at the working folder would run whatever lies beside a file from
    elsewhere."""
    return (f"The Stipple library '{file}' is not loaded: its path must be absolute; set the library's path in the "
            f"add-on's "
            "preferences.")


def _missing(file):
    # The zip of another system has the library under another name.
    return contents.platform_problem(file) or (
        f"The Stipple library '{file}' is missing; install the add-on again or set the library's path in the "
        "add-on's preferences.")


def _load(file):
    contents.check(file)
    try:
        library = CDLL(str(file))
    except OSError as error:
        raise LibraryError(f"The Stipple library '{file}' cannot be loaded: {error}.") from None
    try:
        library.stipple_abi_version.restype = c_uint32
        library.stipple_abi_version.argtypes = []
        version = library.stipple_abi_version()
    except AttributeError:
        raise LibraryError(f"'{file}' is not a Stipple library: it has no function stipple_abi_version.") from None
    if version != ABI_VERSION:
        raise LibraryError(f"The Stipple library '{file}' has ABI version {version}; this add-on needs version "
                           f"{ABI_VERSION}.")
    try:
        declare(library)
    except AttributeError as error:
        raise LibraryError(f"The Stipple library '{file}' says ABI version {version} but lacks a function: "
                           f"{error}.") from None
    return library
