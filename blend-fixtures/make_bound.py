"""Makes bound.blend, stipple/Head.spz and stipple/Arm.spz: splats that follow meshes. Blender 3.4 or newer with the add-on:

    blender -b --factory-startup --addons stipple --python-exit-code 1 --python blend-fixtures/make_bound.py [-- --fit]

On the left a head: splats that were fitted to renders of Suzanne at rest, with her light, inside a cage, a shell around them, that twists. On
the right an arm: splats that were made from a striped tube, which an armature of two bones bends. Both are at rest at
frame 1 and go on to frame 20. --fit fits the head anew, which takes a minute or two.
"""
import math
import pathlib
import sys
import tempfile

import bpy
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import base_colours  # noqa: E402 (found beside this file)

HEAD, ARM = HERE / 'stipple' / 'Head.spz', HERE / 'stipple' / 'Arm.spz'
LAST = 20
RINGS, SIDES, LENGTH, RADIUS = 40, 20, 3.0, 0.3
ARM_SPLATS = 8000
WIDTH, HEIGHT = 320, 160


def link(obj):
    bpy.context.scene.collection.objects.link(obj)
    return obj


def select(*objects):
    """The first is the active one."""
    bpy.context.view_layer.update()
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = objects[0]


def material(name, colour):
    made = bpy.data.materials.new(name)
    base_colours.use_nodes(made)
    shader = next(node for node in made.node_tree.nodes if node.type == 'BSDF_PRINCIPLED')
    shader.inputs['Base Color'].default_value = (*colour, 1.0)
    return made


def fit_head():
    """Suzanne in the light of a sun and a sky, fitted by the Fast preset."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_monkey_add(size=2)
    head = bpy.context.object
    head.modifiers.new('Subdivision', 'SUBSURF').levels = 2
    for polygon in head.data.polygons:
        polygon.use_smooth = True
    head.data.materials.append(material('Skin', (0.75, 0.4, 0.2)))
    scene.world = bpy.data.worlds.new('Sky')
    scene.world.color = (0.4, 0.5, 0.7)
    sun = link(bpy.data.objects.new('Sun', bpy.data.lights.new('Sun', 'SUN')))
    sun.data.energy, sun.rotation_euler = 3.0, (0.7, 0.4, 0.0)
    with tempfile.TemporaryDirectory() as folder:
        bpy.ops.wm.save_as_mainfile(filepath=str(pathlib.Path(folder) / 'head.blend'))
        fit = scene.stipple.fit
        fit.quality, fit.max_splats, fit.view_count, fit.samples = 'FAST', 4000, 40, 32
        fit.view_size = 160
        select(head)
        bpy.ops.stipple.splats_fit()
        result = next(obj for obj in bpy.data.objects if obj.name.endswith(' Fit'))
        select(result)
        bpy.ops.stipple.splats_export(filepath=str(HEAD), use_selection=True, budget='FULL', up_axis='Z')


def bound_head():
    bpy.ops.stipple.splats_import(filepath=str(HEAD), up_axis='Z')
    head = bpy.context.object
    head.name = head.data.name = 'Head'
    # A shell of few faces, a little larger than the head.
    bpy.ops.mesh.primitive_monkey_add(size=2)
    cage = bpy.context.object
    cage.name = cage.data.name = 'Cage'
    cage.modifiers.new('Larger', 'DISPLACE').strength = 0.08
    twist = cage.modifiers.new('Twist', 'SIMPLE_DEFORM')
    twist.deform_method, twist.deform_axis = 'TWIST', 'Z'
    for frame, angle in ((1, 0.0), (LAST, math.radians(75))):
        twist.angle = angle
        twist.keyframe_insert('angle', frame=frame)
    cage.display_type, cage.hide_render = 'WIRE', True
    bpy.context.scene.frame_set(1)
    select(cage, head)
    bpy.ops.stipple.bind_to_mesh(reach='AROUND')
    cage.location.x = -1.6


def tube():
    """Along z from 0, with stripes across it, as one mesh of quads."""
    up, around = np.meshgrid(np.linspace(0, LENGTH, RINGS + 1), 2 * np.pi * np.arange(SIDES) / SIDES, indexing='ij')
    vertices = np.stack([RADIUS * np.cos(around), RADIUS * np.sin(around), up], axis=-1).reshape(-1, 3)
    faces = [(ring * SIDES + side, ring * SIDES + (side + 1) % SIDES, (ring + 1) * SIDES + (side + 1) % SIDES,
              (ring + 1) * SIDES + side) for ring in range(RINGS) for side in range(SIDES)]
    mesh = bpy.data.meshes.new('Arm')
    mesh.from_pydata(vertices.tolist(), [], faces)
    for colour in ((0.8, 0.15, 0.1), (0.9, 0.85, 0.7)):
        mesh.materials.append(material('Stripe', colour))
    mesh.polygons.foreach_set('material_index', [face // SIDES // 4 % 2 for face in range(len(faces))])
    return link(bpy.data.objects.new('Arm', mesh))


def bound_arm():
    arm = tube()
    rig = link(bpy.data.objects.new('Rig', bpy.data.armatures.new('Rig')))
    select(rig)
    bpy.ops.object.mode_set(mode='EDIT')
    bones = rig.data.edit_bones
    upper, lower = bones.new('Upper'), bones.new('Lower')
    upper.tail, lower.head, lower.tail = (0, 0, LENGTH / 2), (0, 0, LENGTH / 2), (0, 0, LENGTH)
    lower.parent = upper
    bpy.ops.object.mode_set(mode='OBJECT')
    groups = [arm.vertex_groups.new(name=name) for name in ('Upper', 'Lower')]
    for vertex in arm.data.vertices:
        share = min(max((vertex.co.z - LENGTH / 2) / 0.8 + 0.5, 0.0), 1.0)
        for group, weight in zip(groups, (1 - share, share)):
            group.add([vertex.index], weight, 'REPLACE')
    arm.modifiers.new('Armature', 'ARMATURE').object = rig
    bone = rig.pose.bones['Lower']
    bone.rotation_mode = 'XYZ'
    for frame, angle in ((1, 0.0), (LAST, math.radians(80))):
        bone.rotation_euler = (0.0, 0.0, 0.0)
        bone.rotation_euler.z = angle
        bone.keyframe_insert('rotation_euler', frame=frame)
    bpy.context.scene.frame_set(1)
    select(arm)
    bpy.ops.stipple.splats_from_mesh(anchors=ARM_SPLATS)
    made = bpy.context.object
    bpy.ops.stipple.splats_export(filepath=str(ARM), use_selection=True, up_axis='Z')
    bpy.data.batch_remove([made, made.data])
    bpy.ops.stipple.splats_import(filepath=str(ARM), up_axis='Z')
    splats = bpy.context.object
    splats.name = splats.data.name = 'Arm Splats'
    arm.hide_set(False)
    select(arm, splats)
    bpy.ops.stipple.bind_to_mesh(reach='SURFACE')
    arm.hide_set(True)
    rig.location = arm.location = (1.4, 0.0, -1.4)


def make():
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    bpy.context.preferences.filepaths.save_version = 0
    bound_head()
    bound_arm()
    scene.frame_start, scene.frame_end = 1, LAST
    scene.frame_set(1)
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = WIDTH, HEIGHT, 100
    base_colours.prepare_image(scene)
    camera = link(bpy.data.objects.new('Camera', bpy.data.cameras.new('Camera')))
    camera.location, camera.rotation_euler = (0.0, -9.5, 0.6), (math.radians(87), 0.0, 0.0)
    camera.data.lens = 48.0
    scene.camera = camera
    scene.render.engine = 'STIPPLE'
    bpy.ops.wm.save_as_mainfile(filepath=str(HERE / 'bound.blend'), compress=True)


if '--fit' in sys.argv or not HEAD.exists():
    fit_head()
make()
