# SPDX-License-Identifier: GPL-3.0-or-later
"""Fitting splats to views."""

from ctypes import byref, c_char_p, c_uint32, c_uint64, c_void_p
from dataclasses import dataclass

import numpy as np

from .cloud import Cloud
from .errors import check
from .handle import new_handle, path_bytes, pointer_to
from .job import Job
from .model import Model
from .structs import (FitModel, FitOptionKind, FitQuality, StippleFitFigures, StippleFitOptionInfo,
                      StippleFitOptions)


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


def check_places(library, report_path=None, checkpoint_path=None):
    """Refuses places where a report or a checkpoint cannot be written, or would replace a file of another kind."""
    check(library, library.stipple_fit_places_check(*(None if path is None else path_bytes(path)
                                                      for path in (report_path, checkpoint_path))))


@dataclass(frozen=True)
class FitOption:
    """A field of StippleFitOptions as the library tells it."""

    name: str             # of the field, without _utf8
    kind: FitOptionKind
    help: str             # one sentence
    models: tuple         # of FitModel: whom it concerns
    fixed_models: tuple   # of FitModel: a fit that goes on needs it as it was
    choices: tuple        # words of a choice, from 0 on
    minimum: float
    maximum: float
    default: str
    presets: tuple        # texts by model and quality, None where the preset leaves it alone
    aliases: tuple        # (name, how much 1 is under it), other names of it


def fit_option_table(library):
    """Every option of a fit, in the order in which settings have them."""
    count = c_uint64()
    check(library, library.stipple_fit_option_count(byref(count)))
    return [_fit_option(library, index) for index in range(count.value)]


def _fit_option(library, index):
    info = StippleFitOptionInfo()
    check(library, library.stipple_fit_option_info(index, byref(info)))
    choices = info.choices_utf8.decode()
    presets = [None if text is None else text.decode()
               for text in (*info.presets_utf8, *info.motion_presets_utf8, *info.scaffold_presets_utf8,
                            *info.relay_presets_utf8)]
    qualities = len(FitQuality)
    return FitOption(info.name_utf8.decode(), FitOptionKind(info.kind), info.help_utf8.decode(),
                     _models_of(info.models), _models_of(info.fixed_models),
                     tuple(choices.split(',')) if choices else (), info.minimum, info.maximum,
                     info.default_utf8.decode(), tuple(tuple(presets[qualities * model:qualities * (model + 1)])
                                                       for model in FitModel),
                     tuple((name.decode(), unit) for name, unit in zip(info.aliases_utf8, info.alias_units) if name))


def _models_of(bits):
    return tuple(model for model in FitModel if bits >> model & 1)


def fit_memory_bound(views, options):
    """Bytes that a fit allocates, about."""
    count = c_uint64()
    check(views.library, views.library.stipple_fit_memory_bound(views.pointer, byref(options), byref(count)))
    return count.value


class Fit(Job):
    """A fit that runs; a cancelled or failed one still has the best that it had measured."""

    @classmethod
    def start(cls, context, views, options, cloud=None):
        """cloud: the splats that it begins with, in the coordinates of the views; None: its own."""
        if cloud is None:
            return cls(context.library, new_handle(context.library, 'stipple_fit_start', context.pointer,
                                                   views.pointer, byref(options)))
        return cls(context.library, new_handle(context.library, 'stipple_fit_start_from', context.pointer,
                                               cloud.pointer, views.pointer, byref(options)))

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

    def watch_time(self, seconds):
        """The time that previews of splats that move show."""
        self._check(self.library.stipple_fit_watch_time(self.pointer, seconds))

    def result(self, budget=0):
        """The best splats, at a budget where the model has budgets; 0: the largest."""
        return Cloud(self.library, new_handle(self.library, 'stipple_fit_cloud', self.pointer, budget))

    def model(self):
        """A field as a model for any budget, splats that move as one for any time; of explicit splats that stand still
        Model.from_cloud_start(result()) makes one."""
        return Model(self.library, new_handle(self.library, 'stipple_fit_model', self.pointer))

    def save_report(self, path):
        """JSON at path, and its curves under the same name with the extension .svg."""
        self._check(self.library.stipple_fit_report_save(self.pointer, path_bytes(path)))

    def draw_report(self, scale):
        """The same curves as an image [H,W,4], display sRGB, row 0 = top; scale 1 is 960 pixels wide."""
        width, height = c_uint32(), c_uint32()
        draw = self.library.stipple_fit_report_draw
        self._check(draw(self.pointer, scale, 0, None, byref(width), byref(height)))
        pixels = np.empty((height.value, width.value, 4), np.float32)
        self._check(draw(self.pointer, scale, pixels.size, pointer_to(pixels), byref(width), byref(height)))
        return pixels
