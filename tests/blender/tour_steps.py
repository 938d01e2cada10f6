# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of make_pictures.py for the panels and the dialog of docs/in_blender.md; window.py runs them."""

import json
import sys
from pathlib import Path

import bpy
from mathutils import Euler, Vector

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import picture_steps  # noqa: E402
import scenes  # noqa: E402
import series  # noqa: E402

# Blender's own panels of a mesh come first and would fill the picture.
LEFT_OUT = ('DATA_PT_vertex_groups', 'DATA_PT_shape_keys', 'DATA_PT_uv_texture', 'DATA_PT_vertex_colors',
            'DATA_PT_face_maps', 'DATA_PT_mesh_attributes', 'DATA_PT_normals', 'DATA_PT_texture_space',
            'DATA_PT_remesh', 'DATA_PT_customdata', 'DATA_PT_custom_props_mesh')
OPENED = 'STIPPLE_PT_grade'  # starts closed, and is what the picture is of


def folder():
    return Path(sys.argv[sys.argv.index('--') + 2])


def properties_area(window):
    return next(area for area in window.window.screen.areas if area.type == 'PROPERTIES')


def show_tab(window, context):
    properties_area(window).spaces.active.context = context


def keep(name, x, y, width, height):
    """Notes which part of the picture is kept, from its lower left corner; returns the picture's name."""
    (folder() / f'{name}.json').write_text(json.dumps([x, y, width, height]))
    return name


def keep_panels(window, name, height):
    """Keeps the upper part of the Properties editor."""
    area = properties_area(window)
    return keep(name, area.x, area.y + area.height - height, area.width, height)


def build(window):
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    for name in LEFT_OUT:
        bpy.utils.unregister_class(getattr(bpy.types, name))
    panels = sys.modules['stipple'].panels.data.classes
    for panel in panels:
        bpy.utils.unregister_class(panel)
    for panel in panels:  # all of them, so that their order stays
        if panel.__name__ == OPENED:
            panel.bl_options = set()
        bpy.utils.register_class(panel)
    picture_steps.splats_of('terrain.blend')
    head = picture_steps.splats_of('suzanne.blend')
    head.location, head.rotation_euler.z = (0.6, -0.4, 1.6), 0.6
    scenes.select(head)
    view = window.region_data
    view.view_distance, view.view_location = 8.0, Vector((0.0, 0.0, 0.8))
    view.view_rotation = Euler((1.15, 0.0, 0.5)).to_quaternion()
    show_tab(window, 'DATA')


def graded(window):
    """The head in another light, with the panel that does it."""
    settings = bpy.context.object.data.stipple
    settings.exposure, settings.tint, settings.saturation = 0.4, (1.0, 0.72, 0.5), 0.7
    return keep_panels(window, 'panel_grade', 440)


def in_a_series(window):
    files = folder() / 'files'
    files.mkdir()
    stipple = sys.modules['stipple']
    for frame in range(1, 11):
        arrays = series.arrays_of(stipple, frame)
        stipple.binding.cloud.Cloud.create(stipple.scene.source.sources.context(),
                                           arrays).save(str(files / f'swarm_{frame:04d}.ply'))
    with window.context():
        bpy.ops.stipple.splats_import(filepath=str(files / 'swarm_0001.ply'), as_sequence=True, up_axis='Z')
    bpy.context.scene.frame_set(4)
    return keep_panels(window, 'panel_sequence', 545)


def engine_stipple(window):
    bpy.context.scene.render.engine = 'STIPPLE'
    show_tab(window, 'RENDER')
    return keep_panels(window, 'panel_stipple', 400)


def engine_both(window):
    bpy.context.scene.render.engine = 'STIPPLE_CYCLES'
    return keep_panels(window, 'panel_cycles_stipple', 846)


def proxy_dialog(window):
    scenes.select(bpy.data.objects['Suzanne Splats'])
    with window.context():
        bpy.ops.stipple.splats_to_mesh('INVOKE_DEFAULT')
    return keep('dialog_mesh', 540, 370, 520, 420)  # it comes up in the middle of the window


steps = [build, graded, in_a_series, engine_stipple, engine_both, proxy_dialog]
