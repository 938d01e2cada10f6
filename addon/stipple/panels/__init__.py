# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawing only."""

from . import data, effects, fit, menus, overlay, quality, render, sequence

classes = (data.classes + sequence.classes + render.classes + quality.classes + effects.classes + fit.classes
           + overlay.classes + menus.classes)


def register():
    data.register()
    menus.register()
    render.register()


def unregister():
    render.unregister()
    menus.unregister()
    data.unregister()
