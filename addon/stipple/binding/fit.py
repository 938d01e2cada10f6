# SPDX-License-Identifier: GPL-3.0-or-later
"""Fitting splats to views."""

from ctypes import byref, c_char_p, c_uint32, c_uint64, c_void_p

import numpy as np

from .cloud import Cloud
from .errors import check
from .handle import new_handle, path_bytes, pointer_to
from .job import Job
from .model import Model
from .structs import FitModel, FitQuality, StippleFitFigures, StippleFitOptions


def fit_options(library, model=FitModel.EXPLICIT, quality=FitQuality.BALANCED, checkpoint_path=None, strategy=None,
                **fields):
    """Options of a quality, with fields of StippleFitOptions set by name."""
    options = StippleFitOptions()
    library.stipple_fit_options_init(byref(options))
    check(library, library.stipple_fit_options_preset(byref(options), int(model), int(quality)))
    if checkpoint_path is not None:
        options.checkpoint_path_utf8 = path_bytes(checkpoint_path)
    if strategy is not None:
        options.strategy_utf8 = strategy.encode()
    for name, value in fields.items():
        if name not in dict(StippleFitOptions._fields_):
            raise TypeError(f"fit_options() has no option '{name}'")
        setattr(options, name, value)
    return options


def fit_memory_bound(views, options):
    """Bytes that a fit allocates, about."""
    count = c_uint64()
    check(views.library, views.library.stipple_fit_memory_bound(views.pointer, byref(options), byref(count)))
    return count.value


class Fit(Job):
    """A fit that runs; a cancelled or failed one still has the best that it had measured."""

    @classmethod
    def start(cls, context, views, options):
        return cls(context.library, new_handle(context.library, 'stipple_fit_start', context.pointer, views.pointer,
                                               byref(options)))

    def figures(self):
        """StippleFitFigures as they are now; psnr is NaN until held-out views were measured. Never waits."""
        figures = StippleFitFigures()
        self._check(self.library.stipple_fit_figures(self.pointer, byref(figures)))
        return figures

    def notes(self):
        """Sentences that the user should read."""
        text, found = c_char_p(), []
        for index in range(self.figures().note_count):
            self._check(self.library.stipple_fit_note(self.pointer, index, byref(text)))
            found.append(text.value.decode('utf-8', 'replace'))
        return found

    def preview(self):
        """The newest copy of the splats, or None; asks for another. Never waits."""
        pointer = c_void_p()
        self._check(self.library.stipple_fit_preview(self.pointer, byref(pointer)))
        return Cloud(self.library, pointer.value) if pointer.value else None

    def watch_contributions(self, watched):
        """Whether previews tell what each splat contributes: a few views are drawn for each."""
        self._check(self.library.stipple_fit_watch_contributions(self.pointer, int(watched)))

    def result(self, budget=0):
        """The best splats, at a budget where the model has budgets; 0: the largest."""
        return Cloud(self.library, new_handle(self.library, 'stipple_fit_cloud', self.pointer, budget))

    def model(self):
        """A field as a model for any budget; of explicit splats Model.from_cloud_start(result()) makes one."""
        return Model(self.library, new_handle(self.library, 'stipple_fit_model', self.pointer))

    def save_report(self, path):
        """JSON at path, and its curves under the same name with the ending .svg."""
        self._check(self.library.stipple_fit_report_save(self.pointer, path_bytes(path)))

    def draw_report(self, scale):
        """The same curves as a picture [H,W,4], display sRGB, row 0 = top; scale 1 is 960 pixels wide."""
        width, height = c_uint32(), c_uint32()
        draw = self.library.stipple_fit_report_draw
        self._check(draw(self.pointer, scale, 0, None, byref(width), byref(height)))
        pixels = np.empty((height.value, width.value, 4), np.float32)
        self._check(draw(self.pointer, scale, pixels.size, pointer_to(pixels), byref(width), byref(height)))
        return pixels
