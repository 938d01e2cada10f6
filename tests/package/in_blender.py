# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside a Blender that has the zip installed and enabled: splats, files of several kinds, a volume and a render.
Or, with the word damaged after --, that a refused library is an error of the operator and Blender lives on.

    blender --background --python-exit-code 1 --python in_blender.py -- FOLDER [damaged]
"""

import os
import sys

import bpy

folder, *rest = sys.argv[sys.argv.index('--') + 1:]


def file(name):
    return os.path.join(folder, name)


def splats(anchors):
    bpy.ops.mesh.primitive_cube_add()
    return bpy.ops.stipple.splats_from_mesh(anchors=anchors)


def in_memory(*names):
    with open('/proc/self/maps') as maps:
        return sorted({line.split()[-1] for line in maps if any(name in line for name in names)})


def work():
    assert splats(300) == {'FINISHED'}
    for form in ('ply', 'spz', 'sog', 'glb', 'usdz'):
        assert bpy.ops.stipple.splats_export(filepath=file(f'out.{form}')) == {'FINISHED'}
    assert bpy.ops.stipple.splats_to_volume(filepath=file('out.vdb'), resolution=24) == {'FINISHED'}
    # Blender reads it with an OpenVDB of its own.
    volume = bpy.data.volumes.new('Read')
    volume.filepath = file('out.vdb')
    assert volume.grids.load(), volume.grids.error_message
    assert {'density', 'color'} <= {grid.name for grid in volume.grids}
    assert volume.grids['density'].data_type == 'FLOAT'
    scene = bpy.context.scene
    camera = bpy.data.objects.new('Camera', bpy.data.cameras.new('Camera'))
    camera.location = (0, 0, 9)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.engine = 'STIPPLE'
    scene.render.resolution_x, scene.render.resolution_y = 160, 120
    scene.render.filepath = file('out.png')
    bpy.ops.render.render(write_still=True)
    for name in ('out.ply', 'out.spz', 'out.sog', 'out.glb', 'out.vdb', 'out.png'):
        assert os.path.getsize(file(name)) > 500, name
    ours = in_memory('libstipple')
    assert len(ours) == 1, ours
    print('WORKED', bpy.app.version_string, ours[0], *in_memory('libtbb'), flush=True)


def refuse():
    try:
        splats(300)
    except RuntimeError as error:
        said = str(error).strip()
    assert 'is damaged: it is not the file that this add-on came with' in said, said
    assert not in_memory('libstipple')
    bpy.ops.mesh.primitive_cube_add()
    print('REFUSED', said, flush=True)


refuse() if rest == ['damaged'] else work()
