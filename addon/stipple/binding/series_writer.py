# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats at times, written into one file."""

from ctypes import byref

from .cloud import save_options
from .handle import Handle, new_handle, path_bytes


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
