# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras from files, and views: cameras with what they have seen."""

from ctypes import byref, c_uint64

import numpy as np

from .errors import check, invalid
from .handle import Handle, contiguous, new_handle, path_bytes, pointer_to
from .structs import (ColourSpace, StippleCamera, StippleViewBuffers, StippleViewInfo, StippleViewImage,
                      StippleViewPoints, StippleViewsInfo, StippleViewsOpenOptions, Transfer, ViewSplit)


class Views(Handle):
    free_function = 'stipple_views_free'

    @classmethod
    def load(cls, context, path):
        """Cameras alone."""
        return cls(context.library,
                   new_handle(context.library, 'stipple_views_load', context.pointer, path_bytes(path)))

    @classmethod
    def open(cls, context, path, **options_given):
        """A photo data set with its images; options_given: fields of StippleViewsOpenOptions, such as downscale=2."""
        options = StippleViewsOpenOptions()
        context.library.stipple_views_open_options_init(byref(options))
        for name, value in options_given.items():
            if name not in dict(StippleViewsOpenOptions._fields_):
                raise TypeError(f"Views.open() has no option '{name}'")
            setattr(options, name, value)
        return cls(context.library, new_handle(context.library, 'stipple_views_open', context.pointer,
                                               path_bytes(path), byref(options)))

    @classmethod
    def create(cls, context, colour_space=ColourSpace.DISPLAY):
        """No views yet; colour_space is that of the splats to be."""
        return cls(context.library,
                   new_handle(context.library, 'stipple_views_create', context.pointer, int(colour_space)))

    def add(self, camera, rgba, transfer=Transfer.LINEAR, weights=None, depth=None, normals=None, name=None, time=0.0,
            split=ViewSplit.NONE, camera_name=None, moving=None):
        """rgba [H,W,4] premultiplied, weights [H,W], depth [H,W] planar metres, normals [H,W,3]; row 0 = top. time:
        when it was taken, seconds; split: what the view is for; camera_name: of the camera, where it has taken others at
        other times; moving [H,W]: not 0 where something moves."""
        size = (camera.height, camera.width)
        arrays = {'rgba': (rgba, (*size, 4)), 'weights': (weights, size), 'depth': (depth, size),
                  'normals': (normals, (*size, 3))}
        kept = _shaped('View', arrays) | _shaped('View', {'moving': (moving, size)}, np.uint8)
        picture = StippleViewImage(transfer=int(transfer), time=time, split=int(split),
                                   camera_utf8=None if camera_name is None else camera_name.encode(),
                                   **{key: pointer_to(array) for key, array in kept.items()})
        self._check(self.library.stipple_views_add(self.pointer, byref(camera), byref(picture),
                                                   None if name is None else name.encode()))

    def set_points(self, positions, colours, normals=None, weights=None, times=None):
        """positions [N,3] metres, colours [N,3] scene linear, normals [N,3], weights [N], times [N] seconds when a surface
        was there, NaN for at all times."""
        count = len(positions)
        kept = _shaped('Point', {'positions': (positions, (count, 3)), 'colours': (colours, (count, 3)),
                                 'normals': (normals, (count, 3)), 'weights': (weights, (count,))})
        if times is not None:
            kept |= _shaped('Point', {'times': (times, (count,))}, np.float64)
        points = StippleViewPoints(count=count, **{key: pointer_to(array) for key, array in kept.items()})
        self._check(self.library.stipple_views_set_points(self.pointer, byref(points)))

    def __len__(self):
        count = c_uint64()
        self._check(self.library.stipple_views_count(self.pointer, byref(count)))
        return count.value

    def camera(self, index):
        camera = StippleCamera()
        self._check(self.library.stipple_views_camera(self.pointer, index, byref(camera)))
        return camera

    def info(self):
        info = StippleViewsInfo()
        self._check(self.library.stipple_views_info(self.pointer, byref(info)))
        return info

    def view_info(self, index):
        """Its texts are bytes, and live as long as the views."""
        info = StippleViewInfo()
        self._check(self.library.stipple_views_view_info(self.pointer, index, byref(info)))
        return info

    def read(self, index):
        """(rgba [H,W,4] premultiplied in the views' colour space, weights [H,W], depth [H,W], normals [H,W,3])."""
        camera = self.camera(index)
        size = (camera.height, camera.width)
        arrays = [np.empty(shape, np.float32) for shape in ((*size, 4), size, size, (*size, 3))]
        rgba, weights, depth, normals = (pointer_to(array) for array in arrays)
        buffers = StippleViewBuffers(capacity=camera.height * camera.width, rgba=rgba, weights=weights, depth=depth,
                                     normals=normals)
        self._check(self.library.stipple_views_read(self.pointer, index, byref(buffers)))
        return tuple(arrays)

    def points(self):
        """(positions [N,3], scene linear colours [N,3]) as new arrays."""
        count = self.info().point_count
        positions, colours = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32)
        self._check(self.library.stipple_views_read_points(self.pointer, count, pointer_to(positions),
                                                           pointer_to(colours)))
        return positions, colours


def _shaped(what, arrays, dtype=np.float32):
    """{name: (array or None, shape)} to contiguous arrays, or one clear error."""
    kept = {}
    for name, (array, shape) in arrays.items():
        if array is None:
            continue
        kept[name] = contiguous(array, dtype)
        if kept[name].shape != shape:
            raise invalid(f'{what} array {name} has shape {kept[name].shape}; allowed is {shape}.')
    return kept


def resize_camera(library, camera, width, height):
    """Changes a camera's image size in place."""
    check(library, library.stipple_camera_resize(byref(camera), width, height))
