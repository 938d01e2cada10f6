# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats from an image."""

from ctypes import byref, c_void_p

from .cloud import Cloud
from .errors import check
from .handle import new_handle, path_bytes
from .job import Job
from .structs import (StippleGenerateEstimate, StippleGenerateFigures, StippleGenerateOptions, StippleGenerateStage)


def generate_options(library, weights_folder, checkpoint_path=None, **fields):
    """Defaults, with fields of StippleGenerateOptions set by name."""
    options = StippleGenerateOptions()
    library.stipple_generate_options_init(byref(options))
    options.weights_folder_utf8 = path_bytes(weights_folder)
    if checkpoint_path is not None:
        options.checkpoint_path_utf8 = path_bytes(checkpoint_path)
    for name, value in fields.items():
        if name not in dict(StippleGenerateOptions._fields_):
            raise TypeError(f"generate_options() has no option '{name}'")
        setattr(options, name, value)
    return options


def estimate(context, options):
    """StippleGenerateEstimate: time and memory on this machine, about. Errors: StippleError for options that are
    refused and weights that are missing."""
    found = StippleGenerateEstimate()
    check(context.library, context.library.stipple_generate_estimate(context.pointer, byref(options), byref(found)))
    return found


class Generation(Job):
    """An image that becomes a Model; Model.of_job(job) gives it."""

    @classmethod
    def start(cls, context, image, mask, options, encoded_by=None):
        """image, mask: Image, or None: without an image, an object that the seed alone tells. encoded_by: None, or another Generation: what the image encoders said in
        it is used where the image and their files are the same."""
        options.encoded_by = None if encoded_by is None else encoded_by.pointer
        return cls(context.library, new_handle(context.library, 'stipple_generate_start', context.pointer,
                                               None if image is None else image.pointer, None if mask is None else mask.pointer, byref(options)))

    def figures(self):
        """StippleGenerateFigures as they are now. Never waits."""
        figures = StippleGenerateFigures()
        self._check(self.library.stipple_generate_figures(self.pointer, byref(figures)))
        return figures

    def stages(self):
        """What has passed by so far: (name, StippleGenerateStage) of each place."""
        stage, found = StippleGenerateStage(), []
        for index in range(self.figures().stage_count):
            self._check(self.library.stipple_generate_stage(self.pointer, index, byref(stage)))
            found.append((stage.name_utf8.decode(), stage))
            stage = StippleGenerateStage()
        return found

    def preview(self):
        """The newest preview (Cloud), each once, or None. Never waits."""
        pointer = c_void_p()
        self._check(self.library.stipple_generate_preview(self.pointer, byref(pointer)))
        return Cloud(self.library, pointer.value) if pointer.value else None
