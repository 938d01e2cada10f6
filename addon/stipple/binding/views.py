# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras from files."""

from ctypes import byref, c_uint64

from .errors import check
from .handle import Handle, new_handle, path_bytes
from .structs import StippleCamera


class Views(Handle):
    free_function = 'stipple_views_free'

    @classmethod
    def load(cls, context, path):
        return cls(context.library,
                   new_handle(context.library, 'stipple_views_load', context.pointer, path_bytes(path)))

    def __len__(self):
        count = c_uint64()
        self._check(self.library.stipple_views_count(self.pointer, byref(count)))
        return count.value

    def camera(self, index):
        camera = StippleCamera()
        self._check(self.library.stipple_views_camera(self.pointer, index, byref(camera)))
        return camera


def resize_camera(library, camera, width, height):
    """Changes a camera's picture size in place."""
    check(library, library.stipple_camera_resize(byref(camera), width, height))
