# SPDX-License-Identifier: GPL-3.0-or-later
"""Models: sources of splats at any budget."""

import math
from ctypes import byref, c_uint64
from dataclasses import dataclass

import numpy as np

from .cloud import Cloud
from .density import Density, check_anchor_count
from .errors import invalid
from .handle import Handle, contiguous, new_handle, path_bytes, pointer_to
from .job import Job
from .mesh import Mesh
from .structs import (AnchorOrder, StippleDecodeOptions, StippleModelFromCloudOptions, StippleModelFromMeshOptions,
                      StippleModelInfo, StippleModelSettings, StippleRefineOptions, ViewRig)

MAX_GAUSSIANS_PER_ANCHOR = 32


@dataclass(frozen=True)
class DecodeSettings:
    """What turns a model into splats; hashable, so that it can key a cache."""

    anchors: int = 20_000
    gaussians_per_anchor: int = 1
    order: int = AnchorOrder.SYSTEMATIC
    seed: int = 0
    time: float = 0.0  # seconds, 0 where nothing moves
    smooth: bool = False  # a budget that moves makes no splat jump

    @property
    def most_splats(self):
        """Number of splats that they give at most."""
        return self.anchors * self.gaussians_per_anchor * (2 if self.smooth else 1)

    def check(self):
        """Refuses what does not fit the library's unsigned fields."""
        check_anchor_count(self.anchors)
        if not 1 <= self.gaussians_per_anchor <= MAX_GAUSSIANS_PER_ANCHOR:
            raise invalid(f'Gaussians per anchor is {self.gaussians_per_anchor}; allowed are 1 to '
                          f'{MAX_GAUSSIANS_PER_ANCHOR}.')
        if self.seed < 0:
            raise invalid(f'Seed is {self.seed}; allowed are 0 and above.')
        if not math.isfinite(self.time):
            raise invalid(f'Time is {self.time} s; a finite number is allowed.')


def _unsigned(value, name, least):
    """Refuses what does not fit the library's unsigned fields."""
    if not least <= value <= 0xffffffff:
        raise invalid(f'{name} is {value}; allowed are {least} and above.')
    return value


def refine_start(cloud, full, iterations=100, view_count=32, view_size=800, view_rig=ViewRig.AUTOMATIC, seed=0):
    """A job that makes the reduced Cloud, fitted to images of the full one, or of the Mesh that it was made from."""
    function = 'stipple_cloud_refine_to_mesh_start' if isinstance(full, Mesh) else 'stipple_cloud_refine_start'
    options = StippleRefineOptions()
    cloud.library.stipple_refine_options_init(byref(options))
    options.iterations = _unsigned(iterations, 'Iterations', 0)
    options.view_count = _unsigned(view_count, 'Views', 1)
    options.view_size = _unsigned(view_size, 'View size', 1)
    options.view_rig = int(view_rig)
    options.seed = seed
    return Job(cloud.library, new_handle(cloud.library, function, cloud.pointer, full.pointer, byref(options)))


class Model(Handle):
    free_function = 'stipple_model_free'
    job_function = 'stipple_job_model'

    @staticmethod
    def from_mesh_start(context, mesh, detail_weight=1.0, seed=0, leaf_level=10, sample_count=0, harmonic_degree=None):
        """A job that makes a Model."""
        if seed < 0:
            raise invalid(f'Seed is {seed}; allowed are 0 and above.')
        options = StippleModelFromMeshOptions()
        context.library.stipple_model_from_mesh_options_init(byref(options))
        options.detail_weight = detail_weight
        options.seed = seed
        options.leaf_level = leaf_level
        options.sample_count = sample_count
        if harmonic_degree is not None:
            options.harmonic_degree = harmonic_degree
        return Job(context.library, new_handle(context.library, 'stipple_model_from_mesh_start', context.pointer,
                                               mesh.pointer, byref(options)))

    @staticmethod
    def from_cloud_start(context, cloud, view_count=10, view_size=400, view_rig=ViewRig.AUTOMATIC, seed=0,
                         footprint=0.0):
        """A job that makes a Model, the merge tree of an existing cloud."""
        options = StippleModelFromCloudOptions()
        context.library.stipple_model_from_cloud_options_init(byref(options))
        options.view_rig = int(view_rig)
        options.view_count = _unsigned(view_count, 'Views', 0)
        options.view_size = _unsigned(view_size, 'View size', 1)
        options.seed = seed
        options.footprint = footprint
        return Job(context.library, new_handle(context.library, 'stipple_model_from_cloud_start', context.pointer,
                                               cloud.pointer, byref(options)))

    def masked(self, mask):
        """The model of a cloud without the splats whose mask [N] is 0, at every budget."""
        mask = contiguous(mask, np.uint8)
        return Model(self.library, new_handle(self.library, 'stipple_model_keep', self.pointer, pointer_to(mask),
                                              len(mask)))

    @classmethod
    def load(cls, context, path):
        return cls(context.library,
                   new_handle(context.library, 'stipple_model_load', context.pointer, path_bytes(path)))

    @staticmethod
    def load_start(context, path):
        """A job that makes the Model of a file: reads ahead."""
        return Job(context.library,
                   new_handle(context.library, 'stipple_model_load_start', context.pointer, path_bytes(path)))

    def save(self, path):
        self._check(self.library.stipple_model_save(self.pointer, path_bytes(path)))

    def info(self):
        info = StippleModelInfo()
        self._check(self.library.stipple_model_info(self.pointer, byref(info)))
        return info

    def settings(self):
        """Which settings it has, and their ranges (StippleModelSettings)."""
        settings = StippleModelSettings()
        self._check(self.library.stipple_model_settings(self.pointer, byref(settings)))
        return settings

    def density(self):
        return Density(self.library, new_handle(self.library, 'stipple_model_density', self.pointer))

    def decode(self, settings):
        """The cloud of these settings; follows a slider."""
        return Cloud(self.library, new_handle(self.library, 'stipple_model_decode', self.pointer,
                                              byref(self._options(settings))))

    def decode_start(self, settings):
        """The same as a job that makes a Cloud."""
        return Job(self.library, new_handle(self.library, 'stipple_model_decode_start', self.pointer,
                                            byref(self._options(settings))))

    def decode_memory_bound(self, settings):
        """Bytes that decoding needs at most."""
        size = c_uint64()
        self._check(self.library.stipple_model_decode_memory_bound(self.pointer, byref(self._options(settings)),
                                                                   byref(size)))
        return size.value

    def _options(self, settings):
        settings.check()
        options = StippleDecodeOptions()
        self.library.stipple_decode_options_init(byref(options))
        options.order = int(settings.order)
        options.anchor_count = settings.anchors
        options.seed = settings.seed
        options.gaussians_per_anchor = settings.gaussians_per_anchor
        options.time = settings.time
        options.smooth = 1 if settings.smooth else 0
        return options
