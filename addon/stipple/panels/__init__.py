# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawing only."""

from . import data, effects, fit, menus, mesh_panels, overlay, quality, render, selection, sequence, start

classes = (data.classes + selection.classes + sequence.classes + render.classes + quality.classes + effects.classes + start.classes
           + fit.classes + overlay.classes + menus.classes)


def register():
    data.register()
    mesh_panels.register()
    menus.register()
    render.register()


def unregister():
    render.unregister()
    menus.unregister()
    mesh_panels.unregister()
    data.unregister()
