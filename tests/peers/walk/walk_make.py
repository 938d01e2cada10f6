# SPDX-License-Identifier: GPL-3.0-or-later
"""First Blender of walk.py: from the import to a file saved elsewhere."""

import math
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).resolve().parent))
import walk_parts as parts  # noqa: E402
import scenes  # noqa: E402  (walk_parts says where)

counts = {}


def truck():
    return bpy.data.objects['truck']


def note_count(name):
    counts[name] = parts.count(truck())
    parts.note(counts=counts)


def import_truck(window):
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    with window.context():
        bpy.ops.stipple.splats_import(filepath=str(parts.ASSETS / 'truck.splat'), up_axis='-Y')
    note_count('imported')
    window.region_data.view_distance = 8.0
    window.region_data.view_location = Vector((0, 0, 0.5))
    return 'imported'


def level(window):
    scenes.select(truck())
    with window.context():
        bpy.ops.stipple.level_to_ground()
    return 'leveled'


def crop(window):
    box = bpy.data.objects.new('Box', None)
    box.empty_display_type = 'CUBE'
    scenes.link(box)
    box.location, box.scale = (0, 0, 0.5), (1.1, 1.1, 0.7)
    scenes.select(truck(), box)
    with window.context():
        bpy.ops.stipple.crop_by_box(keep='INSIDE')
    box.hide_set(True)
    note_count('cropped')
    scenes.select(truck())
    with window.context():
        bpy.ops.view3d.view_selected()
    return 'cropped'


def select_tool(window):
    with window.context():
        bpy.ops.wm.tool_set_by_id(name='stipple.select_brush', space_type='VIEW_3D')
    return 'tool'


def stroke(window):
    """The mouse goes over the ground beside the truck with its button down."""
    region = window.region
    x, y = region.x + region.width // 3, region.y + region.height // 3
    window.window.event_simulate(type='MOUSEMOVE', value='NOTHING', x=x, y=y)
    window.window.event_simulate(type='LEFTMOUSE', value='PRESS', x=x, y=y)
    for i in range(1, 21):
        window.window.event_simulate(type='MOUSEMOVE', value='NOTHING', x=x + 10 * i, y=y + i)
    window.window.event_simulate(type='LEFTMOUSE', value='RELEASE', x=x + 200, y=y + 20)


def stroked(_window):
    return 'selected'


def erase(window):
    with window.context():
        bpy.ops.stipple.erase_selected()


def erased(_window):
    if parts.count(truck()) == counts['cropped']:
        return False  # not decoded yet
    note_count('erased')
    return 'erased'


def budget(window):
    with window.context():
        bpy.ops.stipple.add_budget()
    truck().data.stipple.budget_by = 'COUNT'
    truck().data.stipple.anchors = 20_000
    return 'budget'


def note_budget(_window):
    if parts.count(truck()) > 20_000:
        return False
    note_count('budget')


def helmet(window):
    """A mesh from glTF becomes splats beside the truck; the mesh itself goes."""
    if not hasattr(np, 'bool'):  # Debian 12's importer of glTF is older than its numpy
        np.bool = bool
    before = set(bpy.data.objects)
    with window.context():
        bpy.ops.import_scene.gltf(filepath=str(parts.ASSETS / 'DamagedHelmet.glb'))
    added = [obj for obj in bpy.data.objects if obj not in before]
    mesh = next(obj for obj in added if obj.type == 'MESH')
    scenes.select(mesh)
    with window.context():
        bpy.ops.stipple.splats_from_mesh(anchors=20_000)
    made = bpy.context.object
    made.location, made.scale = made.location + Vector((0.6, -0.5, 0.35)), made.scale * 0.2
    for obj in added:
        bpy.data.objects.remove(obj)
    return 'helmet'


def camera_and_ground(window):
    scenes.camera((2.2, -2.4, 1.6), (math.radians(66), 0, math.radians(42)), parts.WIDTH, parts.HEIGHT, lens=40)
    bpy.ops.mesh.primitive_cube_add(size=0.3, location=(-0.3, -0.8, 0.15))
    bpy.ops.object.light_add(type='SUN', rotation=(0.6, 0.3, 0.0))
    parts.render_all(window)


def save_here_and_elsewhere(window):
    """Save As leaves sources where they are, as Blender's own files; Collect brings them along."""
    for name in ('first', 'second'):
        (parts.WAY / name).mkdir()
        bpy.ops.wm.save_as_mainfile(filepath=str(parts.WAY / name / 'scene.blend'))
    with window.context():
        bpy.ops.stipple.collect_sources()
    bpy.ops.wm.save_mainfile()
    parts.note(objects=sorted(obj.name for obj in parts.splats()))
    return 'saved'


facts = parts.facts
steps = [import_truck, level, crop, select_tool, stroke, stroked, erase, erased, budget, note_budget,
         helmet, camera_and_ground, save_here_and_elsewhere]
