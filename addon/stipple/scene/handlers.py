# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables [(name of a list of bpy.app.handlers, function)] put there and taken away."""

import bpy


def add(table):
    for name, function in table:
        getattr(bpy.app.handlers, name).append(function)


def remove(table):
    """Functions that are not there are passed over: loading a file may have removed them."""
    for name, function in table:
        handlers = getattr(bpy.app.handlers, name)
        if function in handlers:
            handlers.remove(function)
