# SPDX-License-Identifier: GPL-3.0-or-later
"""Decoded clouds that are kept in native memory, the ones used last, up to a number of bytes."""

import threading
from collections import OrderedDict

# Positions, rotations, scales and opacity; harmonics come on top.
_PLAIN_FLOATS = 11


def bytes_of(count, sh_degree):
    """Native memory of so many splats."""
    return 4 * (_PLAIN_FLOATS + 3 * (sh_degree + 1) ** 2) * count


class CloudCache:
    """Clouds by key. Renders, workers and Blender's own thread share one."""

    def __init__(self):
        self._lock = threading.RLock()
        self._entries = OrderedDict()  # key → (Cloud, bytes), the one used last at the end

    def get(self, key):
        """The cloud of a key, None where it is not kept."""
        with self._lock:
            entry = self._entries.get(key)
            if entry is None:
                return None
            self._entries.move_to_end(key)
            return entry[0]

    def put(self, key, cloud, limit):
        """Keeps a cloud. What was not used for the longest time goes where all take more than limit bytes; this cloud
        stays."""
        info = cloud.info()
        with self._lock:
            self._entries[key] = (cloud, bytes_of(info.count, info.sh_degree))
            self._entries.move_to_end(key)
            while self._size() > limit and len(self._entries) > 1:
                self._entries.popitem(last=False)

    def __contains__(self, key):
        return key in self._entries

    def measure(self, counts):
        """(number, bytes) of the clouds whose key counts(key)."""
        with self._lock:
            found = [size for key, (_, size) in self._entries.items() if counts(key)]
        return len(found), sum(found)

    def _size(self):
        return sum(size for _, size in self._entries.values())

    def rename(self, changed):
        """Gives clouds other keys. changed(key): the new one, or None where it stays."""
        with self._lock:
            for key in list(self._entries):
                other = changed(key)
                if other is not None:
                    self._entries[other] = self._entries.pop(key)

    def clear(self):
        with self._lock:
            self._entries.clear()
