# SPDX-License-Identifier: GPL-3.0-or-later
"""Every difference between Blender versions (3.4 to 5.x), in one place."""

import contextlib
import ctypes
import os

import bpy
import numpy as np

VERSION = bpy.app.version

# Splat objects are point clouds where Python can size one, vertex meshes before.
HAS_SIZED_POINT_CLOUDS = VERSION >= (5, 2, 0)
HAS_NATIVE_SPLATS = VERSION >= (5, 3, 0)
ROTATION_TYPE = 'QUATERNION' if VERSION >= (4, 0, 0) else 'FLOAT_COLOR'
# Point clouds carry four plain floats as FLOAT4; on meshes FLOAT_COLOR is the only type with four.
BASE_TYPE = 'FLOAT4' if HAS_SIZED_POINT_CLOUDS else 'FLOAT_COLOR'
ATTRIBUTE_FIELDS = {'FLOAT': 'value', 'FLOAT_VECTOR': 'vector', 'FLOAT_COLOR': 'color', 'QUATERNION': 'value',
                    'FLOAT4': 'vector'}
# Path properties say since 4.5 whether they may start with // (the .blend's folder).
RELATIVE_PATH = {'PATH_SUPPORTS_BLEND_RELATIVE'} if VERSION >= (4, 5, 0) else set()
FLAT_COLOR_SHADER = 'FLAT_COLOR' if VERSION >= (4, 0, 0) else '3D_FLAT_COLOR'
UNIFORM_COLOR_SHADER = 'UNIFORM_COLOR' if VERSION >= (4, 0, 0) else '3D_UNIFORM_COLOR'
UNIFORM_COLOR_2D_SHADER = 'UNIFORM_COLOR' if VERSION >= (4, 0, 0) else '2D_UNIFORM_COLOR'
# Voxels by which Cycles and EEVEE draw an OpenVDB grid too far along each axis: older ones put a voxel's corner
# where its centre belongs (measured with one splat: 3.4.1 and 4.3.2 half a voxel, 5.2.2 nothing).
VOXEL_SHIFT = 0.5 if VERSION < (5, 0, 0) else 0.0
# Files dropped into a window and Collection Exporters find their operators by a FileHandler.
HAS_FILE_HANDLERS = VERSION >= (4, 1, 0)
# What Cycles calls the light of the world that the camera sees.
ENVIRONMENT_PASS = 'Environment' if VERSION >= (5, 0, 0) else 'Env'
OBJECT_INDEX_PASS = 'Object Index' if VERSION >= (5, 0, 0) else 'IndexOB'
# A Cycles without a denoiser leaves an image as it is that shall be denoised; before, it fails when it has drawn it.
CYCLES_PASSES_OVER_DENOISING = VERSION >= (5, 0, 0)
EEVEE_ENGINE = 'BLENDER_EEVEE_NEXT' if (4, 2, 0) <= VERSION < (5, 0, 0) else 'BLENDER_EEVEE'
# Operators that read meshes of files: those for PLY and STL have become Blender's own.
MESH_IMPORTERS = {'.glb': 'import_scene.gltf', '.gltf': 'import_scene.gltf', '.obj': 'wm.obj_import',
                  '.ply': 'wm.ply_import' if VERSION >= (4, 0, 0) else 'import_mesh.ply',
                  '.stl': 'wm.stl_import' if VERSION >= (4, 1, 0) else 'import_mesh.stl'}


def panorama_settings(camera):
    """The owner of panorama_type, fisheye_fov and others: from 4.3 at the latest the camera itself, before Cycles'
    part."""
    return camera if hasattr(camera, 'panorama_type') else getattr(camera, 'cycles', None)


def motion_blur_position(scene):
    """'START', 'CENTER' or 'END': where a frame lies in the time that its shutter is open."""
    for owner in (scene.render, getattr(scene, 'cycles', None)):
        position = getattr(owner, 'motion_blur_position', None)
        if position is not None:
            return position
    return 'CENTER'


def user_folder():
    """The folder in Blender's user resources where this add-on may write."""
    if VERSION >= (4, 2, 0) and __package__.startswith('bl_ext.'):
        return bpy.utils.extension_path_user(__package__, create=True)
    return bpy.utils.user_resource('DATAFILES', path='stipple', create=True)


def set_text_size(blf, size):
    """Size of the text that is drawn next, pixels. blf: Blender's module, which background Blender need not load."""
    if VERSION >= (4, 0, 0):
        blf.size(0, size)
    else:
        blf.size(0, size, 72)


def is_writable_folder(path):
    return os.path.isdir(path) and os.access(path, os.W_OK)


def session_uid(data):
    """A number that stays with a datablock during this session, or 0 where Blender has none."""
    return getattr(data, 'session_uid', 0)


def corner_normals(mesh, loop_indices, triangle_vertices):
    """Normals [T,3,3] of the triangle corners, or None where every face is flat."""
    if VERSION >= (4, 1, 0):
        if mesh.normals_domain == 'FACE':
            return None
        if mesh.normals_domain == 'POINT':
            return _get(mesh.vertex_normals, 'vector', len(mesh.vertices), 3)[triangle_vertices]
        return _get(mesh.corner_normals, 'vector', len(mesh.loops), 3)[loop_indices]
    smooth = np.empty(len(mesh.polygons), np.bool_)
    mesh.polygons.foreach_get('use_smooth', smooth)
    if not mesh.has_custom_normals:
        if not smooth.any():
            return None
        if smooth.all() and not mesh.use_auto_smooth:
            return _get(mesh.vertices, 'normal', len(mesh.vertices), 3)[triangle_vertices]
    mesh.calc_normals_split()
    return _get(mesh.loops, 'normal', len(mesh.loops), 3)[loop_indices]


def set_triangles(mesh, vertices, triangles):
    """Fills an empty mesh with vertices [V,3] and triangles [T,3]."""
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set('co', np.ascontiguousarray(vertices, np.float32).reshape(-1))
    mesh.loops.add(3 * len(triangles))
    mesh.loops.foreach_set('vertex_index', triangles.reshape(-1).astype(np.int32))
    mesh.polygons.add(len(triangles))
    mesh.polygons.foreach_set('loop_start', np.arange(0, 3 * len(triangles), 3, dtype=np.int32))
    if VERSION < (4, 1, 0):  # later ones tell it by the next polygon's start
        mesh.polygons.foreach_set('loop_total', np.full(len(triangles), 3, np.int32))
    mesh.update()


def loop_uvs(layer, count):
    """UVs [count,2] of a UV layer."""
    if VERSION >= (3, 5, 0):
        return _get(layer.uv, 'vector', count, 2)
    return _get(layer.data, 'uv', count, 2)


def set_loop_uvs(layer, uvs):
    flat = np.ascontiguousarray(uvs, np.float32).reshape(-1)
    if VERSION >= (3, 5, 0):
        layer.uv.foreach_set('vector', flat)
    else:
        layer.data.foreach_set('uv', flat)


def _get(collection, field, count, width):
    array = np.empty(count * width, np.float32)
    collection.foreach_get(field, array)
    return array.reshape(count, width)


def attribute_values(elements, field, count, width):
    """[count*width] float32 of an attribute or of positions: Blender's own memory where they lie there one after the
    other, to be read before anything is written; a copy otherwise."""
    if 0 < count == len(elements):
        first, last = elements[0].as_pointer(), elements[count - 1].as_pointer()
        if last - first == 4 * width * (count - 1):
            return np.frombuffer((ctypes.c_float * (count * width)).from_address(first), np.float32)
    values = np.empty(count * width, np.float32)
    elements.foreach_get(field, values)
    return values


def fill_pass(render_pass, array):
    """Fills a render pass from float32 values, bottom row first."""
    flat = np.ascontiguousarray(array, np.float32).reshape(-1)
    if VERSION >= (4, 0, 0) or render_pass.channels == 1:
        render_pass.rect.foreach_set(flat)
        return
    # Before 4.0 the length is checked in pixels while all channels are copied: a view of the first
    # width*height floats of the whole, contiguous buffer passes.
    pixel_count = len(render_pass.rect)
    assert flat.size == pixel_count * render_pass.channels
    render_pass.rect.foreach_set(flat[:pixel_count])


def read_pass(render_pass, width, height):
    """The values of a render pass as [height,width,channels], bottom row first."""
    values = np.empty(width * height * render_pass.channels, np.float32)
    # As in fill_pass.
    short = VERSION < (4, 0, 0) and render_pass.channels > 1
    render_pass.rect.foreach_get(values[:width * height] if short else values)
    return values.reshape(height, width, render_pass.channels)


def pixel_border(border_minimum, border_maximum, size):
    """First and last+1 pixel of a render border along one side; Blender truncates single floats."""
    low = int(np.float32(border_minimum) * np.float32(size))
    high = int(np.float32(border_maximum) * np.float32(size))
    return low, max(high, low + 1)


@contextlib.contextmanager
def importing():
    """Importers of meshes work while this lasts: that of glTF in 3.4 asks numpy for a name that it has lost since."""
    is_missing = 'bool' not in vars(np)
    if is_missing:
        np.bool = bool
    try:
        yield
    finally:
        if is_missing:
            del np.bool


def use_nodes(material):
    """Gives a new material its node tree (5.x materials always have one)."""
    if VERSION < (5, 0, 0):
        material.use_nodes = True


def has_nodes(owner):
    """Of a material or world."""
    return owner.node_tree is not None and (VERSION >= (5, 0, 0) or owner.use_nodes)


def copy_of_evaluated_matrix(matrix):
    """Depsgraph iterators reuse their memory: values have to be taken at once."""
    return np.array(matrix, np.float64)


def animation_curves(owner, path):
    """The curves and drivers that animate a property of a datablock itself."""
    animation = owner.animation_data
    if animation is None:
        return []
    found, action = list(animation.drivers), animation.action
    if action is not None and VERSION < (4, 4, 0):
        found += action.fcurves
    elif action is not None and animation.action_slot is not None:
        for layer in action.layers:
            for strip in layer.strips:
                bag = strip.channelbag(animation.action_slot)
                found += [] if bag is None else bag.fcurves
    return [curve for curve in found if curve.data_path == path]
