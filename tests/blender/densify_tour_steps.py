# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of make_pictures.py for the panel that densifies splats; window.py runs them."""

import sys
from pathlib import Path

import bpy
from mathutils import Euler

sys.path.insert(0, str(Path(__file__).resolve().parent))
import fit_tour_steps  # noqa: E402
import picture_steps  # noqa: E402
import scenes  # noqa: E402
import tour_steps  # noqa: E402

SIDEBAR_PX, SHOWN_PX = 250, 790


def build(window):
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    fit_tour_steps.few_tabs(window, 'STIPPLE_PT_densify')
    scenes.select(picture_steps.splats_of('suzanne.blend'))
    settings = fit_tour_steps.fit()
    settings.model, settings.strategy, settings.parts = 'EXPLICIT', 'absolute', {'long_axis_split'}
    view = window.region_data
    view.view_distance, view.view_rotation = 5.0, Euler((1.35, 0.0, 0.45)).to_quaternion()


def panel(window):
    area = window.area
    return tour_steps.keep('densify_panel', area.x + area.width - SIDEBAR_PX, area.y + area.height - SHOWN_PX,
                           SIDEBAR_PX, SHOWN_PX)


steps = [build, fit_tour_steps.open_tab, panel]
