# SPDX-License-Identifier: GPL-3.0-or-later
"""Images as files, the channels of layered ones, and the comparison of two."""

from ctypes import byref

import numpy as np

from .handle import Handle, contiguous, new_handle, path_bytes, pointer_to
from .structs import StippleImageChannelInfo, StippleImageComparison, StippleImageInfo, Transfer


class Image(Handle):
    free_function = 'stipple_image_free'

    @classmethod
    def create(cls, context, pixels, transfer=Transfer.LINEAR):
        """pixels [height,width,1, 3 or 4], row 0 = top, premultiplied alpha."""
        pixels = contiguous(pixels)
        height, width, channels = pixels.shape
        return cls(context.library, new_handle(context.library, 'stipple_image_create', context.pointer, width, height,
                                               channels, int(transfer), pointer_to(pixels)))

    @classmethod
    def load(cls, context, path):
        return cls(context.library,
                   new_handle(context.library, 'stipple_image_load', context.pointer, path_bytes(path)))

    def info(self):
        info = StippleImageInfo()
        self._check(self.library.stipple_image_info(self.pointer, byref(info)))
        return info

    def read(self):
        info = self.info()
        pixels = np.empty((info.height, info.width, info.channels), np.float32)
        self._check(self.library.stipple_image_read(self.pointer, pointer_to(pixels), pixels.size))
        return pixels

    def save(self, path, keep_values=False):
        self._check(self.library.stipple_image_save(self.pointer, path_bytes(path), 1 if keep_values else 0))

    def compare(self, other):
        result = StippleImageComparison()
        self._check(self.library.stipple_image_compare(self.pointer, other.pointer, byref(result)))
        return result


class ImageChannels(Handle):
    """The named channels of an OpenEXR file; a name has its layer in front, 'ViewLayer.Depth.Z'."""

    free_function = 'stipple_image_channels_free'

    @classmethod
    def load(cls, context, path):
        return cls(context.library,
                   new_handle(context.library, 'stipple_image_channels_load', context.pointer, path_bytes(path)))

    def names(self):
        return [self._info(i).name_utf8.decode()
                for i in range(self.library.stipple_image_channels_count(self.pointer))]

    def read(self, index):
        """[height,width] float32 of a channel, by its place in names(); row 0 is the top."""
        info = self._info(index)
        values = np.empty((info.height, info.width), np.float32)
        self._check(self.library.stipple_image_channels_read(self.pointer, index, pointer_to(values), values.size))
        return values

    def _info(self, index):
        info = StippleImageChannelInfo()
        self._check(self.library.stipple_image_channels_info(self.pointer, index, byref(info)))
        return info
