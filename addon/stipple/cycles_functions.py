# SPDX-License-Identifier: GPL-3.0-or-later
"""Cycles for engines of our own that let it draw."""

import inspect

try:
    from cycles import CyclesRender
except ImportError:  # a Blender that was built without Cycles
    CyclesRender = None


def functions():
    """A base class with Cycles' functions.

    Registering a subclass of a registered class takes the latter's Python away from Blender: Cycles itself would
    render no more. So this is not derived from it.
    """
    found = {name: value for name, value in vars(CyclesRender).items()
             if name.startswith('bl_use_') or name != '__init__' and inspect.isfunction(value)}

    def __init__(self, *args, **kwargs):
        super(base, self).__init__(*args, **kwargs)
        self.session = None  # Cycles' own

    base = type('CyclesFunctions', (), {**found, '__init__': __init__})
    return base
