# SPDX-License-Identifier: GPL-3.0-or-later
"""Series of splat files, one for each frame: which file a frame shows, and its splats.

Files are read ahead by native jobs and kept in a cache of a limited size, shared by all objects. Nothing
here writes Blender data.
"""

import math
import os
from collections import OrderedDict
from dataclasses import dataclass

import numpy as np

from ... import preferences
from ...binding import cloud_edit
from ...binding.cloud import Cloud, SplatArrays
from ...binding.errors import StippleError, invalid
from ...binding.model import DecodeSettings, Model
from ...binding.structs import JobState, Status
from . import numbered
from ..source import masks, source_paths, source_settings, sources

_entries = OrderedDict()  # (path, time, size, of models) → _Entry, the one used last at the end
_played = {}              # full name of a datablock → (frame shown last, direction of play)


@dataclass
class _Entry:
    """A file that is being read (job) or has been (handle: a Cloud or a Model)."""

    job: object = None
    handle: object = None
    count: int = 0
    size: int = 0       # bytes of memory; while it is being read: of the file
    cut: tuple = None   # (count, Cloud) that was asked for last


@dataclass
class Frame:
    """What a datablock shows at a frame. key: equal for equal splats."""

    key: str
    path: str = ''
    stamp: tuple = ()     # time and size of the file
    of_models: bool = False  # files are models, else splats as they are
    ratio: float = None   # of the file's splats, or
    count: int = None     # as many as this; neither: all
    most: int = None      # limit on top, while a slider is dragged
    ahead: tuple = ()     # paths that are shown next

    def cloud(self):
        """The splats as a native cloud; None where the series shows nothing. Errors: StippleError."""
        if not self.path:
            return None
        entry = _read(self.path, self.stamp, self.of_models)
        _read_ahead(self.ahead, self.of_models, entry)
        return self._cut(entry)

    def read_anew(self, native):
        """The same without the cache: for workers, which must not share it."""
        if not self.path:
            return None
        return self._cut(_filled(_Entry(), _noun(self.of_models).load(native, self.path)))

    def _cut(self, entry):
        count = self._budget(entry.count)
        return _cut(entry, count if self.most is None else min(count, self.most))

    def _budget(self, available):
        if self.ratio is not None:
            return min(available, max(1, round(available * self.ratio)))
        return available if self.count is None else min(available, self.count)

    def shown_count(self):
        """Splats that the budget leaves of the file, without `most`. Errors: StippleError."""
        return self._budget(self.available())

    def available(self):
        """Splats in the file. Errors: StippleError."""
        return _read(self.path, self.stamp, self.of_models).count if self.path else 0

    def splats(self):
        """cloud() as what is stored; that of a series that shows nothing is empty."""
        cloud = self.cloud()
        if cloud is not None:
            return cloud.columns()
        return SplatArrays(*(np.empty(shape, np.float32) for shape in ((0, 3), (0, 4), (0, 3), (0,), (0, 1, 3))))


def attach(data, path, count, of_models=False):
    """Notes a series of this many files as the source of a datablock; path: the first. The rest of its timing stays."""
    if of_models:
        sources.attach_tree(data, path, 0)
    else:
        sources.attach_cloud(data, path)
    masks.clear(data)
    data.stipple.frame_duration = count
    data.stipple.is_sequence = True


def local_frame(stipple, frame):
    """Which frame of its series, 1 to frame_duration, a scene's frame shows; None for none of them."""
    count = stipple.frame_duration
    if count < 1:
        raise invalid(f'A series has {count} frames; at least 1 is needed.')
    # A little more than nothing, so that 3 frames at a third reach the next file.
    index = math.floor((frame - stipple.frame_start) * stipple.frame_speed + 1e-6)
    if stipple.sequence_mode == 'CLIP':
        return index + 1 if 0 <= index < count else None
    if stipple.sequence_mode == 'REPEAT':
        return index % count + 1
    if stipple.sequence_mode == 'PING_PONG' and count > 1:
        index %= 2 * count - 2
        return min(index, 2 * count - 2 - index) + 1
    return min(max(index, 0), count - 1) + 1


def path_at(data, stipple, frame):
    """The file of a scene's frame, '' where the series shows nothing. Errors: StippleError for one that is missing."""
    local = local_frame(stipple, frame)
    return '' if local is None else file_path(data, stipple, local)


def file_path(data, stipple, local):
    """The file of a series' own frame, 1 to frame_duration, with its offset."""
    first = numbered.parse(source_paths.file_of(data))
    if first is None:
        raise invalid(f"The source '{source_paths.of(data)}' of '{data.name}' has no number in its name, which a "
                      f"series of "
                      'files needs.')
    number = first.number + stipple.frame_offset + local - 1
    path = first.path(max(number, 0))
    if number >= 0 and os.path.exists(path):
        return path
    if stipple.missing_frames == 'HOLD':
        before = [n for n in first.numbers() if n < number]
        if before:
            return first.path(before[-1])
    raise StippleError(f"File '{path}' of the series '{data.name}' is missing.", Status.ERROR_IO)


def frame_of(data, stipple, frame, mode, most=None):
    """What a datablock shows at a frame, as a Frame. Reads no splats.

    stipple: evaluated settings. mode: 'VIEWPORT', 'RENDER' or 'FULL', which budget. Errors: StippleError for a file
    that is missing.
    """
    path = path_at(data, stipple, frame)
    if not path:
        return Frame('nothing')
    return frame_of_file(data, stipple, path, mode, most, _ahead(data, stipple, frame, path))


def frame_of_file(data, stipple, path, mode, most=None, ahead=()):
    """The same for a file of the series."""
    stamp = _stamp(path)
    ratio = count = None
    if mode != 'FULL':
        rendering = mode == 'RENDER'
        if stipple.budget_by == 'RATIO':
            ratio = min(1.0, 2.0 ** stipple.detail * (stipple.ratio_render if rendering else stipple.ratio))
        else:
            chosen = stipple.anchors_render if rendering and stipple.anchors_render != 0 else stipple.anchors
            count = sources.detailed(chosen, stipple)
            DecodeSettings(count).check()
    key = f'{os.path.basename(path)}|{stamp[0]}|{stamp[1]}|{ratio}|{count}|{most}'
    return Frame(key, path, stamp, source_settings.of(stipple).has_budget, ratio, count, most, ahead)


def forget():
    """Gives all native memory back; what is being read is cancelled."""
    for entry in _entries.values():
        if entry.job is not None:
            entry.job.close()
    _entries.clear()
    _played.clear()


def cached_bytes():
    return sum(entry.size for entry in _entries.values())


# ---- reading ------------------------------------------------------------------------------------

def _stamp(path):
    try:
        status = os.stat(path)
    except OSError as error:
        raise StippleError(f"The file '{path}' cannot be read: {error.strerror}.", Status.ERROR_IO) from None
    return status.st_mtime_ns, status.st_size


def _noun(of_models):
    return Model if of_models else Cloud


def _read(path, stamp, of_models):
    """The entry of a file, read now unless it has been read ahead. Errors: StippleError."""
    key = (path, *stamp, of_models)
    entry = _entries.pop(key, None)
    if entry is None:
        entry = _filled(_Entry(), _noun(of_models).load(sources.context(), path))
    elif entry.job is not None:
        entry.job.wait()
        _filled(entry, _noun(of_models).of_job(entry.job))
    _entries[key] = entry
    _trim([entry])
    return entry


def _filled(entry, handle):
    info = handle.info()
    entry.job, entry.handle = None, handle
    entry.count = info.count if isinstance(handle, Cloud) else info.leaf_count
    floats = 11 + 3 * (info.sh_degree + 1) ** 2
    # A tree has about as many nodes above its leaves.
    entry.size = 4 * floats * entry.count * (1 if isinstance(handle, Cloud) else 2)
    return entry


def _cut(entry, count):
    if count == entry.count and isinstance(entry.handle, Cloud):
        return entry.handle
    if entry.cut is None or entry.cut[0] != count:
        cut = (cloud_edit.thin(entry.handle, count) if isinstance(entry.handle, Cloud)
               else entry.handle.decode(DecodeSettings(count)))
        entry.cut = (count, cut)
    return entry.cut[1]


def _ahead(data, stipple, frame, path):
    """The files that come next the way the series is played, the nearest first."""
    limit = _limits()[1]
    last, direction = _played.get(data.name_full, (frame, 1))
    if frame != last:
        direction = 1 if frame > last else -1
    _played[data.name_full] = (frame, direction)
    found = []
    # A slow series shows a file for several frames.
    speed = abs(stipple.frame_speed)
    reach = limit if speed >= 1 else math.ceil(limit / max(speed, 0.01))
    for step in range(1, reach + 1):
        try:
            following = path_at(data, stipple, frame + direction * step)
        except StippleError:
            continue
        if following and following != path and following not in found:
            found.append(following)
        if len(found) == limit:
            break
    return tuple(found)


def _read_ahead(paths, of_models, shown):
    """Starts reading files that are shown soon, as far as the cache has room beside what is shown now."""
    room, kept = _limits()[0] - shown.size, [shown]
    for path in paths:
        try:
            key = (path, *_stamp(path), of_models)
        except StippleError:
            continue
        entry = _entries.get(key)
        # A packed file takes more memory than it has bytes: the one that is shown tells how much.
        room -= entry.size if entry is not None and entry.job is None else max(key[2], shown.size)
        if room < 0:
            break
        if entry is None:
            entry = _entries[key] = _Entry(_noun(of_models).load_start(sources.context(), path), size=key[2])
        _entries.move_to_end(key)
        kept.append(entry)
    _trim(kept)


def _trim(kept):
    """Drops what was not used for the longest time, down to the cache's size; never some, nor what is being read."""
    limit, total = _limits()[0], cached_bytes()
    for key, entry in list(_entries.items()):
        if total <= limit:
            return
        if any(entry is other for other in kept) or (entry.job is not None and entry.job.poll()[0] == JobState.RUNNING):
            continue
        total -= entry.size
        del _entries[key]


def _limits():
    """(bytes of the cache, files that are read ahead)."""
    chosen = preferences.get()
    return (1 << 30, 4) if chosen is None else (chosen.sequence_cache << 20, chosen.read_ahead)
