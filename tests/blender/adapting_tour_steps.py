# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of make_pictures.py for docs/methods/mesh_adaptation.md; window.py runs them."""

import sys
from pathlib import Path

import bpy
from mathutils import Euler, Vector

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import scenes  # noqa: E402
import uneven_meshes  # noqa: E402
from tour_steps import keep  # noqa: E402


def strip():
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)


def stage(window, objects, wired, gap, tilt):
    """Objects side by side, those that are `wired` with all their edges, and nothing else in the view."""
    for place, obj in enumerate(objects):
        obj.location.x, obj.rotation_euler.z = gap * place, 0.5
        obj.show_wire = obj.show_all_edges = obj in wired
        obj.select_set(False)
    space = window.space
    space.overlay.show_ortho_grid = space.overlay.show_axis_z = False
    space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
    space.overlay.show_text = space.overlay.show_cursor = space.overlay.show_object_origins = False
    space.show_gizmo = space.show_region_toolbar = space.show_region_header = False
    space.overlay.show_extras = False
    view = window.region_data
    view.view_perspective, view.view_rotation = 'ORTHO', Euler((tilt, 0.0, 0.0)).to_quaternion()
    view.view_location, view.view_distance = Vector((0.5 * gap * (len(objects) - 1), 0.0, 0.0)), 10.0


def build(window):
    """From left to right: the target, the template, and the template without density and with it."""
    strip()
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
    stage(window, (stone, *balls), balls, 2.7, 1.15)


def build_uneven(window):
    """Two meshes of uneven triangles, each as given and evened out."""
    strip()
    objects = []
    with window.context():
        for make, density in ((uneven_meshes.crowded_box, 'UNIFORM'), (uneven_meshes.pulled_ball, 'ADAPTIVE')):
            objects.append(make())
            objects.append(make())
            scenes.select(objects[-1])
            bpy.ops.stipple.mesh_even_out(density=density)
    stage(window, objects, objects, 2.4, 0.9)


def wait(_window):
    return None


def strip_of(window, name):
    region = window.region
    return keep(name, region.x, region.y + region.height // 2 - 170, region.width, 340)


def shapes(window):
    return strip_of(window, 'adapt_mesh')


def evened(window):
    return strip_of(window, 'even_mesh')


steps = [build, wait, shapes, build_uneven, wait, evened]
