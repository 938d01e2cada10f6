# SPDX-License-Identifier: GPL-3.0-or-later
"""Density control of finished splats."""

from ctypes import byref

from .handle import new_handle
from .job import Job
from .structs import StippleDensifyOptions


def densify_start(context, cloud, views, strategy=None, **fields):
    """A job that makes the Cloud; fields of StippleDensifyOptions by name."""
    options = StippleDensifyOptions()
    context.library.stipple_densify_options_init(byref(options))
    if strategy is not None:
        options.strategy_utf8 = strategy.encode()
    for name, value in fields.items():
        if name not in dict(StippleDensifyOptions._fields_):
            raise TypeError(f"densify_start() has no option '{name}'")
        setattr(options, name, value)
    return Job(context.library, new_handle(context.library, 'stipple_densify_start', context.pointer, cloud.pointer,
                                           views.pointer, byref(options)))
