# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of make_pictures.py for docs/methods/mesh_adaptation.md; window.py runs them."""

import sys
from pathlib import Path

import bpy
from mathutils import Euler, Vector

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import scenes  # noqa: E402
from tour_steps import keep  # noqa: E402


def build(window):
    """From left to right: the target, the template, and the template without density and with it."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    with window.context():
        bpy.ops.mesh.primitive_cube_add(size=1.6)
        stone = bpy.context.object
        bevel = stone.modifiers.new('Bevel', 'BEVEL')
        bevel.width, bevel.segments = 0.15, 6
        balls = []
        for density in ('', 'OFF', 'ADAPTIVE'):
            bpy.ops.mesh.primitive_cube_add(size=2)
            ball = bpy.context.object
            for kind, levels in (('SUBSURF', 4), ('CAST', 0)):
                modifier = ball.modifiers.new(kind, kind)
                if kind == 'SUBSURF':
                    modifier.levels, modifier.subdivision_type = levels, 'SIMPLE'
                else:
                    modifier.factor, modifier.use_radius_as_size, modifier.size = 1.0, False, 1.0
                bpy.ops.object.modifier_apply(modifier=modifier.name)
            balls.append(ball)
            if density:
                scenes.select(ball, stone)
                bpy.ops.stipple.mesh_adapt(density=density)
    for place, obj in enumerate((stone, *balls)):
        obj.location.x, obj.rotation_euler.z = 2.7 * place, 0.5
        obj.show_wire = obj.show_all_edges = place > 0
        obj.select_set(False)
    space = window.space
    space.overlay.show_ortho_grid = space.overlay.show_axis_z = False
    space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
    space.overlay.show_text = space.overlay.show_cursor = space.overlay.show_object_origins = False
    space.show_gizmo = space.show_region_toolbar = space.show_region_header = False
    space.overlay.show_extras = False
    view = window.region_data
    view.view_perspective, view.view_rotation = 'ORTHO', Euler((1.15, 0.0, 0.0)).to_quaternion()
    view.view_location, view.view_distance = Vector((1.5 * 2.7, 0.0, 0.0)), 10.0


def wait(_window):
    return None


def shapes(window):
    region = window.region
    return keep('adapt_mesh', region.x, region.y + region.height // 2 - 170, region.width, 340)


steps = [build, wait, shapes]
