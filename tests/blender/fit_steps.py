# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of test_fit_window.py inside the Blender with a window; window.py runs them."""

import importlib
import json
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
import scenes  # noqa: E402

facts = {}


def module(name):
    addon = next(module for module in sys.modules if module.rpartition('.')[2] == 'stipple')
    return importlib.import_module(name, addon)


def build(window):
    """A ball; the sidebar shows the panel, in a tab that every Blender opens first."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    ball = scenes.sphere(segments=24, rings=12)
    scenes.image_material('Halves', scenes.half_image(), ball)
    scenes.select(ball)
    settings = bpy.context.scene.stipple.fit
    settings.view_count, settings.view_size, settings.engine, settings.max_splats = 12, 64, 'WORKBENCH', 3000
    settings.quality = 'BALANCED'
    window.space.show_region_ui = True
    for panel in reversed(module('.panels.fit').classes):
        bpy.utils.unregister_class(panel)
    for panel in module('.panels.fit').classes:
        panel.bl_category = 'Item'
        bpy.utils.register_class(panel)
    with window.context():
        bpy.ops.view3d.view_axis(type='FRONT')
    window.region_data.view_distance = 6


def panel(_window):
    return 'panel'


def start(window):
    with window.context():
        assert bpy.ops.stipple.splats_fit('INVOKE_DEFAULT') == {'RUNNING_MODAL'}


def previewed(_window):
    """The preview is there while the fit goes on."""
    state = module('.scene.fitting').state
    if 'Sphere Fit' not in bpy.data.objects and state.is_running:
        return False
    facts['previewed_while_running'] = state.is_running
    bpy.data.objects['Sphere'].hide_set(True)
    return 'running'


def ended(_window):
    if module('.scene.fitting').state.is_running:
        return False
    facts['problem'] = module('.scene.fitting').state.problem
    facts['psnr'] = module('.scene.fitting').state.figures.best_psnr
    return None


def proposed(window):
    bpy.data.objects['Sphere'].hide_set(False)
    scenes.select(bpy.data.objects['Sphere'])
    facts['proposed'] = module('.operators.splats_fit').proposed(bpy.context) is not None
    return 'proposed'


def report(window):
    """In a window of its own: no Image Editor is open."""
    with window.context():
        assert bpy.ops.stipple.show_report() == {'FINISHED'}
    return 'report'


def close_report(window):
    reports = module('.scene.fit_reports')
    (other, area), = reports.editors(bpy.context)
    facts['report'] = area.spaces.active.image.name
    facts['windows'] = len(bpy.context.window_manager.windows)
    with bpy.context.temp_override(window=other):
        bpy.ops.wm.window_close()


def accept(window):
    with window.context():
        assert bpy.ops.stipple.fit_accept() == {'FINISHED'}
    facts['source_is_hidden'] = bpy.data.objects['Sphere'].hide_render
    facts['kind'] = bpy.data.objects['Sphere Fit'].data.stipple.source_kind
    return 'accepted'


def write(_window):
    (Path(sys.argv[sys.argv.index('--') + 2]) / 'facts.json').write_text(json.dumps(facts))


steps = [build, panel, start, previewed, ended, proposed, report, close_report, accept, write]
