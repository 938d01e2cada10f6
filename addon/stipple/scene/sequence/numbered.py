# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbered files: name_0001.ply, name_0002.ply, ... and folders such as name_0001/meta.json."""

import os
import re
from dataclasses import dataclass

from ..source import formats
from ..source.sources import MODEL_SUFFIX

# The last number of a name, with what may follow it: name_0001.ply, name_0001_splats.ply.
_LAST_NUMBER = re.compile(r'(\d+)(\D*)$')


@dataclass(frozen=True)
class Numbered:
    """The path of one file of a series, around its number."""

    prefix: str
    digits: str
    suffix: str

    @property
    def number(self):
        return int(self.digits)

    @property
    def series(self):
        """What all files of the series have in common."""
        return self.prefix, self.suffix

    def path(self, number):
        """The path of another number, padded as this one is. A file that is there without padding counts too."""
        padded = f'{self.prefix}{number:0{len(self.digits)}d}{self.suffix}'
        plain = f'{self.prefix}{number}{self.suffix}'
        return plain if plain != padded and not os.path.exists(padded) and os.path.exists(plain) else padded

    def numbers(self):
        """The numbers that are there, in order."""
        folder, start = os.path.split(self.prefix)
        inside, _, rest = self.suffix.partition('/')
        try:
            names = os.listdir(folder or '.')
        except OSError:
            return []
        fits = re.compile(re.escape(start) + r'(\d+)' + re.escape(inside))
        found = {int(match[1]) for match in map(fits.fullmatch, names) if match}
        return sorted(n for n in found if not rest or os.path.exists(self.path(n)))


def parse(path):
    """A path with a number in its name as a Numbered, or None."""
    stem, suffix = split_extension(path)
    if stem.endswith(('/', os.sep)):
        stem, suffix = stem[:-1], '/' + suffix
    folder, name = os.path.split(stem)
    match = _LAST_NUMBER.search(name)
    if match is None:
        return None
    return Numbered(os.path.join(folder, name[:match.start()]), match[1], match[2] + suffix)


def split_extension(path):
    """(path without its extension, extension): the longest extension of a splat format, else the part after the last
    dot."""
    fits = [e for e in (*formats.read_extensions(), MODEL_SUFFIX) if path.lower().endswith(e)]
    length = max(map(len, fits), default=len(os.path.splitext(path)[1]))
    return path[:len(path) - length], path[len(path) - length:]


def frame_path(path, number):
    """The path of one frame of a series that is named after path: a.ply becomes a_0001.ply, a/meta.json
    a_0001/meta.json."""
    stem, extension = split_extension(path)
    if stem.endswith(('/', os.sep)):
        return f'{stem[:-1]}_{number:04d}/{extension}'
    return f'{stem}_{number:04d}{extension}'


def grouped(paths):
    """[paths of one series, by number], in the order of their first files; a path without a number is alone."""
    groups = {}
    for path in paths:
        part = parse(path)
        groups.setdefault(part.series if part else path, []).append((part.number if part else 0, path))
    return [[path for _, path in sorted(group)] for group in groups.values()]


def series_of(paths):
    """[(first path, frame count)] of chosen files: those of one series become one entry, from the first chosen
    number to the last. A file that was chosen alone stands for all numbers of its series."""
    found = []
    for group in grouped(paths):
        part = parse(group[0])
        if part is None:
            found.append((group[0], 1))
            continue
        numbers = [parse(path).number for path in group] if len(group) > 1 else part.numbers() or [part.number]
        found.append((part.path(numbers[0]), numbers[-1] - numbers[0] + 1))
    return found
