# SPDX-License-Identifier: GPL-3.0-or-later
"""Small scenes that several tests start from."""

import bpy
import numpy as np
from mathutils import Euler


def link(obj):
    bpy.context.scene.collection.objects.link(obj)
    return obj


def select(*objects):
    bpy.context.view_layer.update()
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = objects[0]


def mesh_object(name, vertices, faces, uvs=None):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    if uvs is not None:
        layer = mesh.uv_layers.new(name='UVMap')
        for loop, uv in zip(layer.data, uvs):
            loop.uv = uv
    mesh.update()
    return link(bpy.data.objects.new(name, mesh))


def quad(name='Quad', size=2.0, offset=(0.0, 0.0, 0.0), with_uv=True):
    """A square in the xy plane, facing up, centred at the offset."""
    h = size / 2
    x, y, z = offset
    return mesh_object(name, [(x - h, y - h, z), (x + h, y - h, z), (x + h, y + h, z), (x - h, y + h, z)],
                       [(0, 1, 2, 3)], [(0, 0), (1, 0), (1, 1), (0, 1)] if with_uv else None)


def material(name, color=(0.8, 0.1, 0.1), obj=None):
    """A Principled material with this base colour, in the object's next slot."""
    result = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        result.use_nodes = True
    principled(result).inputs['Base Color'].default_value = (*color, 1.0)
    if obj is not None:
        obj.data.materials.append(result)
    return result


def principled(mat):
    return next(n for n in mat.node_tree.nodes if n.type == 'BSDF_PRINCIPLED')


def image_material(name, image, obj):
    mat = material(name, obj=obj)
    node = mat.node_tree.nodes.new('ShaderNodeTexImage')
    node.image = image
    mat.node_tree.links.new(node.outputs['Color'], principled(mat).inputs['Base Color'])
    return mat


def two_coloured_ball(folder):
    """A selected ball of two colours, lit by the world alone, in a file saved in that folder."""
    obj = sphere(segments=24, rings=12)
    image_material('Halves', half_image(), obj)
    bpy.context.scene.world = bpy.data.worlds.new('Sky')
    bpy.context.scene.world.color = (0.5, 0.5, 0.5)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / 'a.blend'))
    select(obj)
    return obj


def half_image(name='halves', left=(1.0, 0.0, 0.0), right=(0.0, 0.0, 1.0), side=64):
    """Left half one colour, right half another."""
    image = bpy.data.images.new(name, side, side)
    pixels = np.ones((side, side, 4), np.float32)
    pixels[:, :side // 2, :3] = left
    pixels[:, side // 2:, :3] = right
    image.pixels.foreach_set(pixels.reshape(-1))
    return image


def in_order(mesh):
    """Sorts the faces of this mesh; Blender's UV sphere has them in another order each time that it is added."""
    uvs = mesh.uv_layers.active
    rows = []
    for polygon in mesh.polygons:
        corners = [(mesh.loops[i].vertex_index, *(uvs.data[i].uv if uvs else ())) for i in polygon.loop_indices]
        first = corners.index(min(corners))
        rows.append(corners[first:] + corners[:first])
    rows.sort()
    vertices = [vertex.co.copy() for vertex in mesh.vertices]
    mesh.clear_geometry()
    mesh.from_pydata(vertices, [], [[corner[0] for corner in row] for row in rows])
    if uvs:
        mesh.uv_layers.new(name='UVMap').data.foreach_set('uv', [x for row in rows for c in row for x in c[1:]])


def sphere(name='Sphere', segments=32, rings=16, radius=1.0):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=segments, ring_count=rings, radius=radius)
    obj = bpy.context.object
    in_order(obj.data)
    obj.name = name
    return obj


def suzanne():
    """A head with a pattern, sun and sky, selected."""
    bpy.ops.mesh.primitive_monkey_add(size=2)
    obj = bpy.context.object
    obj.modifiers.new('Subdivision', 'SUBSURF').render_levels = 2
    obj.modifiers[0].levels = 2
    obj.data.polygons.foreach_set('use_smooth', [True] * len(obj.data.polygons))
    skin = material('Skin', (0.7, 0.35, 0.15), obj)
    tree = skin.node_tree
    noise = tree.nodes.new('ShaderNodeTexNoise')
    noise.inputs['Scale'].default_value = 6
    tree.links.new(noise.outputs['Color'], principled(skin).inputs['Base Color'])
    bpy.context.scene.world = bpy.data.worlds.new('Sky')
    bpy.context.scene.world.use_nodes = True
    bpy.ops.object.light_add(type='SUN', rotation=(0.6, 0.3, 0))
    bpy.context.object.data.energy = 3
    select(obj)
    return obj


def camera(location=(0.0, 0.0, 6.0), rotation=(0.0, 0.0, 0.0), width=64, height=64, **settings):
    data = bpy.data.cameras.new('camera')
    for key, value in settings.items():
        setattr(data, key, value)
    obj = link(bpy.data.objects.new('camera', data))
    obj.location, obj.rotation_euler = location, Euler(rotation)
    scene = bpy.context.scene
    scene.camera = obj
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
    return obj


def make_splats(*objects, **settings):
    """Runs the operator on these objects and returns the splat object."""
    select(*objects)
    assert bpy.ops.stipple.splats_from_mesh(**settings) == {'FINISHED'}
    return bpy.context.object


def refuses(call, text):
    """The one report of an operator that must fail; checks that it names the problem."""
    try:
        result = call()
    except RuntimeError as error:
        assert text in str(error), str(error)
        return str(error)
    raise AssertionError(f'{result} instead of an error with "{text}"')


def colours_of(stipple, obj):
    """Scene linear colours [N,3] of splats whose harmonics are display values."""
    arrays = stipple.scene.source.splat_data.read(obj.data)
    display = 0.5 + 0.28209479177387814 * arrays.sh[:, 0]
    return np.where(display <= 0.04045, display / 12.92, ((np.maximum(display, 0) + 0.055) / 1.055) ** 2.4)


def render_pixels(tmp_path, name='picture'):
    """F12 of this scene as [H,W,4] scene linear, premultiplied, row 0 = bottom."""
    write_exact_pictures()
    bpy.context.scene.render.filepath = str(tmp_path / f'{name}.exr')
    bpy.ops.render.render(write_still=True)
    return picture_pixels(bpy.context.scene.render.filepath)


def write_exact_pictures():
    """From now on pictures of this scene are written as they are."""
    settings = bpy.context.scene.render.image_settings
    if bpy.app.version >= (5, 0, 0):
        settings.media_type = 'IMAGE'
    settings.file_format = 'OPEN_EXR'
    settings.color_depth, settings.color_mode = '32', 'RGBA'
    settings.exr_codec = 'NONE'


def picture_pixels(path):
    """[H,W,4] of a file, row 0 = bottom."""
    image = bpy.data.images.load(str(path), check_existing=False)
    width, height = image.size
    values = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    return values.reshape(height, width, 4)


def make_linear(data):
    """Values of a datablock go straight from keyframe to keyframe, whichever way this Blender keeps its curves."""
    action = data.animation_data.action
    curves = action.fcurves if hasattr(action, 'fcurves') else action.layers[0].strips[0].channelbags[0].fcurves
    for curve in curves:
        for point in curve.keyframe_points:
            point.interpolation = 'LINEAR'
