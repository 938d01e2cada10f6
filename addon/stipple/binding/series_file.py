# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats at times in one file, written and read."""

from ctypes import byref, c_double, c_void_p

from .cloud import Cloud, save_options
from .handle import Handle, new_handle, path_bytes
from .structs import StippleSeriesInfo


class SeriesWriter(Handle):
    """Writes clouds frame by frame, as time samples; formats.SplatFormat.holds_times tells which formats can.

        writer = SeriesWriter.create(context, 'walk.usda', 24)
        writer.add(cloud, frame)   # of ascending frames
        writer.finish()            # the file is there now

    A writer that is closed before it has finished leaves nothing.
    """

    free_function = 'stipple_series_writer_free'

    @classmethod
    def create(cls, context, path, frames_per_second, **options_given):
        """options_given: as Cloud.save has them, for every cloud."""
        options = save_options(context.library, **options_given)
        return cls(context.library, new_handle(context.library, 'stipple_series_writer_create', context.pointer,
                                               path_bytes(path), frames_per_second, byref(options)))

    def add(self, cloud, frame):
        """cloud: of the degree, colour space and filter of those before, or empty."""
        self._check(self.library.stipple_series_writer_add(self.pointer, cloud.pointer, frame))

    def finish(self):
        self._check(self.library.stipple_series_writer_finish(self.pointer))


class SeriesReader(Handle):
    """A file of a format that holds times (formats.SplatFormat.holds_times), in memory until it is closed.

    count: of its times, 0 where it stands still; frames_per_second: of the numbers that it has for them.
    """

    free_function = 'stipple_series_reader_free'

    @classmethod
    def open(cls, context, path):
        return cls(context.library, new_handle(context.library, 'stipple_series_reader_create', context.pointer,
                                               path_bytes(path)))

    def __init__(self, library, pointer):
        super().__init__(library, pointer)
        info = StippleSeriesInfo()
        self._check(library.stipple_series_reader_info(pointer, byref(info)))
        self.count, self.frames_per_second = info.frame_count, info.frames_per_second

    def read(self, index):
        """(Cloud, which may be empty; number of the frame). index: below count, or 0."""
        frame, cloud = c_double(), c_void_p()
        self._check(self.library.stipple_series_reader_read(self.pointer, index, byref(frame), byref(cloud)))
        return Cloud(self.library, cloud.value), frame.value
