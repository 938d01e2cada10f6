# SPDX-License-Identifier: GPL-3.0-or-later
"""How exact images are, and what that costs."""

from ctypes import byref, c_uint32, c_uint64
from dataclasses import dataclass

import numpy as np

from .errors import check
from .handle import Handle, new_handle, path_bytes, pointer_to
from .job import Job
from .renderer import instance_array
from .structs import (AccuracyLevel, StippleAccuracy, StippleAccuracyKnobInfo, StippleAccuracyMeasureOptions,
                      StippleAccuracyReportInfo, StippleAccuracyRow)


@dataclass(frozen=True)
class AccuracyKnob:
    name: str        # the field of StippleAccuracy
    label: str
    bound: str       # how far off it may be, and what it costs
    has_bound: bool


def accuracy(library, level=AccuracyLevel.FINAL, **knobs):
    """A StippleAccuracy of a level, with fields set by name; raises StippleError where they do not go together."""
    made = StippleAccuracy()
    check(library, library.stipple_accuracy_init(int(level), byref(made)))
    for name, value in knobs.items():
        if name not in dict(StippleAccuracy._fields_):
            raise TypeError(f"accuracy() has no knob '{name}'")
        setattr(made, name, value)
    check(library, library.stipple_accuracy_check(byref(made)))
    return made


def accuracy_knobs(library):
    """Every knob with its label and the bound of its error, in the order in which they are shown."""
    count = c_uint64()
    check(library, library.stipple_accuracy_knob_count(byref(count)))
    knobs = []
    for index in range(count.value):
        info = StippleAccuracyKnobInfo()
        check(library, library.stipple_accuracy_knob_info(index, byref(info)))
        knobs.append(AccuracyKnob(info.name_utf8.decode(), info.label_utf8.decode(), info.bound_utf8.decode(),
                                  info.has_bound == 1))
    return knobs


def accuracy_level_name(library, level):
    return library.stipple_accuracy_level_name(int(level)).decode()


def accuracy_verdict(library, psnr):
    """What a PSNR means to someone who looks."""
    return library.stipple_accuracy_verdict(psnr).decode()


@dataclass(frozen=True)
class AccuracyRow:
    """What one setting costs, and how far its image is from the reference."""

    name: str              # 'preview', 'final + projection ray'
    setting: StippleAccuracy
    seconds: float         # of an image: median
    seconds_low: float     # quartiles
    seconds_high: float
    psnr: float            # dB; infinite where nothing differs
    largest_error: float
    error_99_9: float
    splat_count: int
    visible_count: int
    repetitions: int
    is_estimated: bool     # seconds follow from the compared pixels
    is_on_front: bool      # no other setting is as fast and as good


class AccuracyReport(Handle):
    """A view, measured. rows: [AccuracyRow], the reference last; info: StippleAccuracyReportInfo."""

    free_function = 'stipple_accuracy_report_free'

    def __init__(self, library, pointer):
        super().__init__(library, pointer)
        self.info = StippleAccuracyReportInfo()
        self._check(library.stipple_accuracy_report_info(self.pointer, byref(self.info)))
        self.rows = [self._row(index) for index in range(self.info.row_count)]

    def _row(self, index):
        row = StippleAccuracyRow()
        self._check(self.library.stipple_accuracy_report_row(self.pointer, index, byref(row)))
        setting = StippleAccuracy.from_buffer_copy(row.setting)
        return AccuracyRow(row.name_utf8.decode(), setting, row.seconds, row.seconds_low, row.seconds_high, row.psnr,
                           row.largest_error, row.error_99_9, row.splat_count, row.visible_count, row.repetitions,
                           row.is_estimated == 1, row.is_on_front == 1)

    def best_within(self, seconds):
        """The best row of at most so many seconds; StippleError says what the fastest needs."""
        return self._chosen(self.library.stipple_accuracy_report_best_within, seconds)

    def cheapest_above(self, psnr):
        """The fastest row of at least so many dB; StippleError says what is reached."""
        return self._chosen(self.library.stipple_accuracy_report_cheapest_above, psnr)

    def _chosen(self, function, value):
        index = c_uint64()
        self._check(function(self.pointer, value, byref(index)))
        return self.rows[index.value]

    def save(self, path):
        """Writes .json, .csv or .svg, as the extension says."""
        self._check(self.library.stipple_accuracy_report_save(self.pointer, path_bytes(path)))

    def draw(self, scale):
        """The plot as an image [H,W,4], display sRGB, row 0 = top; scale 1 is 840 pixels wide."""
        width, height = c_uint32(), c_uint32()
        draw = self.library.stipple_accuracy_report_draw
        self._check(draw(self.pointer, scale, 0, None, byref(width), byref(height)))
        pixels = np.empty((height.value, width.value, 4), np.float32)
        self._check(draw(self.pointer, scale, pixels.size, pointer_to(pixels), byref(width), byref(height)))
        return pixels


class AccuracyMeasurement(Job):
    """A view that is being measured: poll, cancel or wait, then report()."""

    @classmethod
    def start(cls, context, instances, camera, render=None, settings=(), **fields):
        """instances as of instance_array; render: options of a Renderer, or None; settings: [StippleAccuracy], none for
        the usual ones; fields of StippleAccuracyMeasureOptions by name."""
        options = StippleAccuracyMeasureOptions()
        context.library.stipple_accuracy_measure_options_init(byref(options))
        for name, value in fields.items():
            if name not in dict(StippleAccuracyMeasureOptions._fields_):
                raise TypeError(f"measuring has no option '{name}'")
            setattr(options, name, value)
        chosen = (StippleAccuracy * len(settings))(*settings)
        if settings:
            options.settings, options.setting_count = chosen, len(settings)
        array = instance_array(instances)
        pointer = new_handle(context.library, 'stipple_accuracy_measure_start', context.pointer, array, len(instances),
                             byref(camera), byref(render) if render is not None else None, byref(options))
        return cls(context.library, pointer)

    def report(self):
        return AccuracyReport(self.library, new_handle(self.library, 'stipple_job_accuracy_report', self.pointer))
