# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of test_quality_window.py inside the Blender with a window; window.py runs them."""

import importlib
import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import scenes  # noqa: E402
from window_steps import addon  # noqa: E402

facts = {}


def module(name):
    return importlib.import_module(name, addon().__name__)


def build(window):
    """A ball of splats before a camera, and the render settings, where the panels are the only ones with figures."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    ball = scenes.sphere(segments=24, rings=12)
    scenes.image_material('Halves', scenes.half_image(), ball)
    scenes.make_splats(ball, anchors=2000)
    scene = window.window.scene
    scene.camera = scenes.camera((0, -6, 0), (np.pi / 2, 0, 0), width=160, height=120, lens=50.0)
    scene.render.engine = 'STIPPLE'
    scene.stipple.quality_viewport.level = 'DRAFT'
    for area in window.window.screen.areas:
        if area.type == 'PROPERTIES':
            area.spaces.active.context = 'RENDER'
            facts['panels'] = area.x, area.y, area.width, area.height
    # The plot stands open, and nothing long before it.
    classes = module('.panels.quality').classes
    for panel in reversed(classes):
        bpy.utils.unregister_class(panel)
    for panel in classes:
        if panel.__name__ == 'STIPPLE_PT_quality_plot':
            panel.bl_options = set()
        bpy.utils.register_class(panel)


def fresh(_window):
    return 'fresh'


def measure(window):
    with window.context():
        assert bpy.ops.stipple.accuracy_measure('INVOKE_DEFAULT', repetitions=1) == {'RUNNING_MODAL'}


def measured(window):
    return None if module('.scene.view.measured_quality').of(window.window.scene) is not None else False


def figures(_window):
    return 'figures'


def content():
    """Of the Image that comparisons write, None before the first."""
    image = bpy.data.images.get('Quality Comparison')
    return None if image is None else hash(tuple(image.pixels))


def compared(show):
    def step(window):
        window.before = content()
        with window.context():
            assert bpy.ops.stipple.accuracy_compare('INVOKE_DEFAULT', show=show) == {'RUNNING_MODAL'}
    return step


def is_shown(_window):
    return 'compared' if module('.scene.fit.fit_reports').editors(bpy.context) else False


def settled(window):
    return None if content() != window.before else False


def plotted(window):
    with window.context():
        assert bpy.ops.stipple.accuracy_show() == {'FINISHED'}
    (_, area), = module('.scene.fit.fit_reports').editors(bpy.context)
    facts['shown'] = area.spaces.active.image.name
    facts['windows'] = len(bpy.context.window_manager.windows)
    return 'plotted'


steps = [build, fresh, measure, measured, figures, compared('WIPE'), is_shown, compared('ERROR'), settled, plotted]
