# SPDX-License-Identifier: GPL-3.0-or-later
"""Detail that images show, added to coarse splats by a network."""

from ctypes import byref

from .handle import new_handle, path_bytes
from .job import Job
from .structs import StippleDetailOptions


def detail_start(context, cloud, views, weights_path, max_splats=0, view_count=0):
    """A job that makes the Cloud. In: weights_path: detail.safetensors of a training; max_splats: 0: every splat
    becomes finer; view_count: 0: as many as in training."""
    options = StippleDetailOptions()
    context.library.stipple_detail_options_init(byref(options))
    options.max_splats = max_splats
    options.view_count = view_count
    return Job(context.library, new_handle(context.library, 'stipple_detail_start', context.pointer, cloud.pointer,
                                           views.pointer, path_bytes(weights_path), byref(options)))
