# SPDX-License-Identifier: GPL-3.0-or-later
"""The targets of mesh_adaptation that Blender makes. By hand:
blender -b --factory-startup --python tests/peers/make_adapt_targets.py -- FOLDER"""

import os
import sys

import bpy
import numpy

numpy.bool = bool  # Blender 3.4's glTF writer asks for the name that newer numpy has dropped


def bevelled(width, segments):
    modifier = bpy.context.object.modifiers.new('Bevel', 'BEVEL')
    modifier.width, modifier.segments = width, segments


def subdivided(levels, subdivision):
    modifier = bpy.context.object.modifiers.new('Subdivision', 'SUBSURF')
    modifier.levels, modifier.subdivision_type = levels, subdivision


def suzanne():
    bpy.ops.mesh.primitive_monkey_add()
    subdivided(2, 'CATMULL_CLARK')


def cube():
    bpy.ops.mesh.primitive_cube_add(size=1.6)
    bevelled(0.12, 3)
    subdivided(3, 'SIMPLE')


def cone():
    bpy.ops.mesh.primitive_cone_add(vertices=64)
    subdivided(3, 'SIMPLE')


def cylinder():
    bpy.ops.mesh.primitive_cylinder_add(vertices=64, depth=1.6, radius=0.8)
    bevelled(0.1, 3)
    subdivided(2, 'SIMPLE')


def main(folder):
    os.makedirs(folder, exist_ok=True)
    for make in (suzanne, cube, cone, cylinder):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        make()
        bpy.ops.export_scene.gltf(filepath=os.path.join(folder, f'{make.__name__}.glb'), export_apply=True,
                                  export_materials='NONE', export_texcoords=False)


main(sys.argv[sys.argv.index('--') + 1])
