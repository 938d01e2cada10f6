# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of make_pictures.py inside the Blender with a window; window.py runs them."""

import sys
from pathlib import Path

import bpy
from mathutils import Euler, Vector

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import scenes  # noqa: E402

FIXTURES = HERE.parent.parent / 'blend-fixtures'
ANCHORS = 60_000


def splats_of(file_name):
    with bpy.data.libraries.load(str(FIXTURES / file_name)) as (there, here):
        here.objects = there.objects
    mesh = next(obj for obj in here.objects if obj.type == 'MESH')
    scenes.link(mesh)
    made = scenes.make_splats(mesh, anchors=ANCHORS)
    mesh.hide_set(True)
    return made


def build(window):
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    splats_of('terrain.blend')
    head = splats_of('suzanne.blend')
    head.location, head.rotation_euler.z = (0.6, -0.4, 1.6), 0.6
    bpy.ops.mesh.primitive_cone_add(location=(-1.3, -1.0, 0.6), depth=1.8, radius1=0.6)
    bpy.ops.mesh.primitive_torus_add(location=head.location, major_radius=1.35, minor_radius=0.13,
                                     rotation=(0.5, 0.3, 0))
    bpy.ops.object.shade_smooth()
    scenes.select(head)
    view = window.region_data
    view.view_distance, view.view_location = 8.0, Vector((0.0, 0.0, 0.8))
    view.view_rotation = Euler((1.15, 0.0, 0.5)).to_quaternion()
    for area in window.window.screen.areas:
        if area.type == 'PROPERTIES':
            area.spaces.active.context = 'DATA'


def solid(_window):
    return 'viewport'


steps = [build, solid]
