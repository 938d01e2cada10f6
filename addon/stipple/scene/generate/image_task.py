# SPDX-License-Identifier: GPL-3.0-or-later
"""An image to models of splats, one for each seed, in a thread of their own."""

import hashlib
import json
import os
from dataclasses import dataclass, replace

from ...binding.cloud import Cloud
from ...binding.errors import invalid
from ...binding.generate import Generation, estimate, generate_options
from ...binding.model import DecodeSettings, Model
from ...jobs import Task
from ..source import source_paths, sources
from . import weights_table

_PREVIEW_STEPS = 2
_DECODE_SHARE = 0.05  # of a generation's bar, for its splats


@dataclass(frozen=True)
class GenerateSettings:
    """What the networks are told; hashable, so that it can key a cache."""

    steps: int = 20
    guidance: float = 3.0
    tokens: int = 8192
    canvas: int = 1024
    seed: int = 42
    size: float = 1.0      # metres
    previews: bool = True
    matches_colours: bool = False

    def fields(self):
        """Fields of StippleGenerateOptions."""
        return {'steps': self.steps, 'guidance': self.guidance, 'token_count': self.tokens, 'canvas_size': self.canvas,
                'seed': self.seed, 'size': self.size, 'preview_steps': _PREVIEW_STEPS if self.previews else 0,
                'matches_colours': int(self.matches_colours)}


@dataclass(frozen=True)
class Made:
    seed: int
    model: object      # Model
    splats: object     # SplatArrays at the budget
    decoding: object   # DecodeSettings of them


_estimates = {}


def require_weights():
    """The weights folder. Errors: StippleError where Preferences name none."""
    folder = weights_table.folder()
    if not folder:
        raise invalid('No weights folder is chosen; Preferences > Add-ons > Stipple says which files it needs and where '
                      'you get them.')
    return folder


def estimate_of(settings):
    """StippleGenerateEstimate of one seed; measured once. Errors: StippleError."""
    folder = require_weights()
    key = (folder, replace(settings, seed=0, size=1.0))
    if key not in _estimates:
        native = sources.context()
        _estimates[key] = estimate(native, generate_options(native.library, folder, **settings.fields()))
    return _estimates[key]


class ImageTask(Task):
    """Polled like a native job. A seed that was cancelled goes on from its last step when the same is asked again."""

    def __init__(self, image, mask, identity, settings, seed_count, anchors, keeps_best=False):
        """image, mask: binding Images, mask may be None. identity: bytes that tell this image from others. anchors: of
        the splats that are made at first. keeps_best: the result is one, that which looks most like the image."""
        self._native, self._folder = sources.context(), require_weights()
        self._image, self._mask = image, mask
        self._settings = [replace(settings, seed=settings.seed + i) for i in range(seed_count)]
        self._checkpoints = [_checkpoint_path(identity, one) for one in self._settings]
        self._anchors, self._keeps_best = anchors, keeps_best and seed_count > 1
        self._running = None  # (index, Generation)
        self._encoded = None  # a Generation of this image that has ended: seeds differ in what comes behind encoders
        super().__init__(self._work)

    def preview(self):
        """(index of the object, SplatArrays) of the newest preview, each once, or None."""
        running = self._running
        cloud = None if running is None else running[1].preview()
        return None if cloud is None else (0 if self._keeps_best else running[0], cloud.columns())

    def _work(self, task):
        count = len(self._settings)
        matches = self._settings[0].matches_colours
        again = self._keeps_best and matches  # the chosen one is made once more, with its colours matched
        parts = [(index / (count + again), (index + 1) / (count + again)) for index in range(count + again)]
        if not self._keeps_best:
            return [self._decoded(task, index, self._model(task, index, part, matches)[0], part)
                    for index, part in enumerate(parts)]
        best, most = None, None
        for index, part in enumerate(parts[:count]):
            model, likeness = self._model(task, index, part, False)
            if best is None or likeness > most:
                best, most = (index, model), likeness
        if again:
            best = best[0], self._model(task, best[0], parts[-1], True)[0]
        made = self._decoded(task, *best, parts[-1])
        for path in self._checkpoints:  # until now, so that a task that was stopped keeps what it has
            _remove(path)
        return [made]

    def _model(self, task, index, part, matches):
        """The Model of a seed, and its likeness to the image. In: matches: whether its colours are matched."""
        begin, middle = part[0], _middle(part)
        path = self._checkpoints[index]
        settings = replace(self._settings[index], matches_colours=matches)
        options = generate_options(self._native.library, self._folder, path, measures_likeness=int(self._keeps_best),
                                   **settings.fields())
        job = Generation.start(self._native, self._image, self._mask, options, self._encoded)
        self._running = index, job
        try:
            task.run(job, begin, middle)
        finally:
            self._running = None
        self._encoded = job
        if not self._keeps_best:
            _remove(path)
        return Model.of_job(job), job.figures().likeness

    def _decoded(self, task, index, model, part):
        """What was made of a seed, with its splats."""
        decoding = DecodeSettings(self._anchors or model.settings().default_budget)
        decoded = task.run(model.decode_start(decoding), _middle(part), part[1])
        return Made(self._settings[index].seed, model, Cloud.of_job(decoded).columns(), decoding)


def _middle(part):
    """Where decoding begins in a seed's part of the bar."""
    begin, end = part
    return end - _DECODE_SHARE * (end - begin)


def _remove(path):
    if os.path.exists(path):
        os.remove(path)


def _checkpoint_path(identity, settings):
    """Where the state of a generation is kept until it ends well."""
    folder = source_paths.cache_folder()
    os.makedirs(folder, exist_ok=True)
    key = hashlib.sha256(identity + json.dumps(settings.fields(), sort_keys=True).encode()
                         + weights_table.folder().encode()).hexdigest()[:16]
    return os.path.join(folder, f'generation_{key}{source_paths.MODEL_SUFFIX}')
