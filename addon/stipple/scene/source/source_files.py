# SPDX-License-Identifier: GPL-3.0-or-later
"""The files that a source consists of, and copies of them."""

import filecmp
import json
import os
import shutil
from dataclasses import dataclass

from ...binding.errors import StippleError
from ...binding.structs import Status
from ..sequence import numbered
from . import source_paths

_MOST_COPIES = 1000  # of one name


@dataclass(frozen=True)
class SourceFiles:
    """One file, or a series of files, or one that names others beside it."""

    path: str    # that the datablock names
    root: str    # folder of all
    names: tuple  # paths from the root
    folder: str  # name of a folder for them, '' for one file

    def _destinations(self, folder):
        """Roots and names of copies in a folder, the first choice first."""
        if self.folder:
            for number in range(_MOST_COPIES):
                yield os.path.join(folder, self.folder + (f'.{number:03d}' if number else '')), self.names
            return
        stem, extension = numbered.split_extension(self.names[0])
        for number in range(_MOST_COPIES):
            yield folder, (f'{stem}.{number:03d}{extension}' if number else self.names[0],)


def of(path, is_sequence):
    """The files of a source by the absolute path of its first. Errors: StippleError where that is not there."""
    first = numbered.parse(path) if is_sequence else None
    paths = [path] if first is None else [first.path(number) for number in first.numbers()]
    if not paths or not all(map(os.path.isfile, paths)):
        raise StippleError(f"The source '{path}' is missing.", Status.ERROR_IO)
    root = os.path.dirname(path if first is None or '/' not in first.suffix else os.path.dirname(path))
    found = {}
    for entry in paths:
        _add(found, entry)
    names = tuple(os.path.relpath(entry, root) for entry in found)
    if first is not None:
        folder = os.path.basename(first.prefix).rstrip('_-. ')
    else:
        folder = os.path.basename(root) if len(names) > 1 else ''
    return SourceFiles(path, root, names, folder or ('series' if first is not None else ''))


def copy(files, folder):
    """Copies files of a source into a folder and returns the path of the first there. Another file of a name stays: the
    copy gets a number, unless it is the same to the byte. A copy that fails leaves nothing. Errors: StippleError."""
    for root, names in files._destinations(folder):
        pairs = [(os.path.join(files.root, old), os.path.join(root, new)) for old, new in zip(files.names, names)]
        if all(not os.path.lexists(to) or _is_same(old, to) for old, to in pairs):
            _copy_all([(old, to) for old, to in pairs if not os.path.lexists(to)])
            return os.path.join(root, os.path.relpath(files.path, files.root) if files.folder else names[0])
    raise StippleError(f"'{folder}' has {_MOST_COPIES:,} numbered copies of '{os.path.basename(files.path)}' already; "
                       'remove some of them.', Status.ERROR_IO)


def _copy_all(pairs):
    made = []
    try:
        for old, to in pairs:
            os.makedirs(os.path.dirname(to), exist_ok=True)
            fresh = f'{to}.{os.getpid()}.new'
            made.append(fresh)
            shutil.copyfile(old, fresh)
            os.rename(fresh, to)
            made[-1] = to
    except OSError as error:
        for path in made:
            if os.path.exists(path):
                os.remove(path)
        raise StippleError(f"'{old}' cannot be copied to '{to}': {error.strerror}.", Status.ERROR_IO) from None


def _is_same(a, b):
    try:
        return os.path.isfile(b) and filecmp.cmp(a, b, shallow=False)
    except OSError:
        return False


def _add(found, path):
    """A file and those that it names, as keys of a dictionary: in order, each once."""
    if path in found:
        return
    found[path] = None
    if source_paths.is_alone(path):
        return
    try:
        with open(path, encoding='utf-8') as file:
            texts = list(_texts(json.load(file)))
    except (OSError, ValueError, RecursionError) as error:
        raise StippleError(f"'{path}' cannot be read: {error}.", Status.ERROR_IO) from None
    folder = os.path.dirname(path)
    for text in texts:
        beside = os.path.normpath(os.path.join(folder, text))
        if source_paths.is_under(beside, folder) and os.path.isfile(beside):
            _add(found, beside)


def _texts(value):
    """All strings in parsed JSON."""
    waiting = [value]
    while waiting:
        value = waiting.pop()
        if isinstance(value, str) and '\0' not in value:
            yield value
        elif isinstance(value, dict):
            waiting += value.values()
        elif isinstance(value, list):
            waiting += value
