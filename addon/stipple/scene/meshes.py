# SPDX-License-Identifier: GPL-3.0-or-later
"""Evaluated Blender meshes as native meshes: modifiers, instances, any number of objects."""

import contextlib
import zlib
from dataclasses import dataclass, field

import bpy
import numpy as np

from .. import version
from ..binding.errors import StippleError, invalid
from ..binding.mesh import Mesh
from ..binding.structs import MaterialColour
from . import bake, colour
from .source import splat_data

MESH_LIKE = {'MESH', 'CURVE', 'SURFACE', 'META', 'FONT'}


@dataclass
class Triangles:
    """One evaluated mesh as arrays; filled once however many instances it has."""

    name: str
    positions: np.ndarray   # [V,3] object space
    triangles: np.ndarray   # [T,3]
    normals: np.ndarray     # [T,3,3], or None for flat faces
    material_index: np.ndarray  # [T] slot
    materials: list         # per slot; None for an empty one
    uvs: dict = field(default_factory=dict)      # map → [T,3,2]
    colours: dict = field(default_factory=dict)  # attribute → [T,3,4]
    render_uv: str = ''
    active_colour: str = ''


def source_objects(objects):
    """The objects among these that splats can be made from."""
    return [obj for obj in objects if (obj.type in MESH_LIKE and not splat_data.is_splat_object(obj))
            or obj.instance_type != 'NONE']


def native_mesh(context, objects, depsgraph, color_from, notes=None, may_be_empty=False, baking=bake.Settings()):
    """All triangles of the objects and of what they instance, with colours, as one native mesh.

    Where a material's texture, UV map or colour attribute is missing, its viewport colour takes the place; notes gets
    the sentences that say so. may_be_empty: objects may have no faces, and where none has any, there is no mesh: None.
    Errors: StippleError that names the object: no faces, NaN vertices, no colour attribute where color_from asks for
    it.
    """
    mesh = Mesh.create(context)
    materials = _Materials(mesh, [] if notes is None else notes, baking.views and color_from == 'BAKED')
    placed, shapes = [], {}
    try:
        _collect(objects, depsgraph, color_from, placed, shapes)
        parts = {key: _part(shape, materials, color_from, objects, baking) for key, shape in shapes.items()}
    finally:
        for shape in shapes.values():
            if shape.to_bake is not None:
                bpy.data.meshes.remove(shape.to_bake)
    seen = set()
    for owner, name, key, matrix in placed:
        if parts[key] is None:
            continue
        seen.add(owner)
        try:
            mesh.add_part(matrix=matrix, **parts[key])
        except StippleError as error:
            raise StippleError(f"Object '{name}': {error}", error.status) from None
    for obj in objects:
        if obj not in seen and not may_be_empty:
            raise invalid(f"Object '{obj.name}' has no faces; at least one is needed to make splats.")
    return mesh if seen else None


@contextlib.contextmanager
def shown(context, objects):
    """Makes hidden source objects evaluate; puts them back as they were."""
    hidden = [(obj, obj.hide_get(), obj.hide_viewport) for obj in objects]
    try:
        for obj, _, _ in hidden:
            obj.hide_viewport = False
            obj.hide_set(False)
        context.view_layer.update()
        yield
    finally:
        for obj, was_hidden, was_disabled in hidden:
            obj.hide_viewport = was_disabled
            obj.hide_set(was_hidden)


def fingerprint(objects):
    """A short text that changes with the shape, placement and materials of source objects."""
    value = 0
    for obj in objects:
        value = zlib.crc32(np.array(obj.matrix_world, np.float32).tobytes(), value)
        mesh = obj.data
        if isinstance(mesh, bpy.types.Mesh):
            positions = np.empty(len(mesh.vertices) * 3, np.float32)
            mesh.vertices.foreach_get('co', positions)
            value = zlib.crc32(positions, value)
            value = zlib.crc32(f'{len(mesh.loops)} {len(mesh.polygons)}'.encode(), value)
        value = zlib.crc32(' '.join(s.material.name for s in obj.material_slots if s.material).encode(), value)
        value = zlib.crc32(' '.join(f'{m.type}{m.show_viewport}' for m in obj.modifiers).encode(), value)
    return f'{value:08x}'


@dataclass
class _Shape:
    """What one evaluated object shows, taken out of Blender: arrays, or a mesh of our own that has to be baked."""

    name: str
    matrix: np.ndarray      # of its first instance
    kinds: list             # base colour per material slot; None to bake the light of all
    read: Triangles = None  # None where there is no triangle
    to_bake: bpy.types.Mesh = None


def _collect(objects, depsgraph, color_from, placed, shapes):
    """Everything that the objects show: adds (owner among objects, name, key, [4,4]) to placed, key: _Shape to shapes.

    An instance's evaluated object lives for its turn of the iterator only, so all that is wanted of it is taken here,
    before baking or anything else can evaluate the scene anew.
    """
    wanted = set(objects)
    for entry in depsgraph.object_instances:
        owner = entry.parent.original if entry.is_instance else entry.object.original
        if owner not in wanted or not (entry.show_self or entry.is_instance):
            continue
        evaluated = entry.object
        if evaluated.type not in MESH_LIKE or splat_data.is_splats(evaluated.data):
            continue
        matrix = version.copy_of_evaluated_matrix(entry.matrix_world)
        key = evaluated.data.as_pointer() if color_from != 'BAKED' else (evaluated.data.as_pointer(), matrix.tobytes())
        if key not in shapes:
            shapes[key] = _shape(evaluated, matrix, color_from, depsgraph)
        placed.append((owner, evaluated.name, key, matrix))


def _shape(evaluated, matrix, color_from, depsgraph):
    kinds = None if color_from == 'BAKED' else [colour.base_colour_of(m) for m in _materials_of(evaluated)]
    if color_from != 'ATTRIBUTE' and (kinds is None or any(k.kind.startswith('BAKE') for k in kinds)):
        return _Shape(evaluated.name, matrix, kinds, to_bake=bake.copy_of(evaluated, depsgraph))
    temporary = evaluated.to_mesh()
    try:
        if temporary is None:
            return _Shape(evaluated.name, matrix, kinds)
        read = _read(temporary, evaluated.name, _materials_of(evaluated, temporary))
    finally:
        evaluated.to_mesh_clear()
    if len(read.triangles) == 0:
        return _Shape(evaluated.name, matrix, kinds)
    return _Shape(evaluated.name, matrix, [colour.base_colour_of(m) for m in read.materials], read)


def _part(shape, materials, color_from, objects, baking):
    """The arguments of add_part for a shape, or None where it has no triangle."""
    if shape.to_bake is not None:
        with bake.baked(shape.to_bake, shape.name, shape.matrix, shape.kinds, objects, baking) as result:
            if result is None:
                return None
            read = _read(result.mesh, shape.name, list(result.mesh.materials))
            return _with_colours(read, shape.kinds or [], materials, color_from, result)
    if shape.read is None:
        return None
    return _with_colours(shape.read, shape.kinds, materials, color_from, None)


def _materials_of(evaluated, mesh=None):
    """Materials per slot: the evaluated data's, and the object's own where a slot says so."""
    data = mesh if mesh is not None else evaluated.data
    found = list(data.materials) if hasattr(data, 'materials') else []
    for index, slot in enumerate(evaluated.material_slots):
        if index >= len(found):
            found.append(slot.material)
        elif slot.link == 'OBJECT':
            found[index] = slot.material
    # Originals outlive the next evaluation of the scene.
    return [material.original if material else None for material in found]


def _read(mesh, name, materials):
    mesh.calc_loop_triangles()
    triangle_count, loop_count = len(mesh.loop_triangles), len(mesh.loops)
    loops = np.empty(triangle_count * 3, np.int32)
    mesh.loop_triangles.foreach_get('loops', loops)
    loops = loops.reshape(-1, 3)
    vertices = np.empty(triangle_count * 3, np.int32)
    mesh.loop_triangles.foreach_get('vertices', vertices)
    vertices = vertices.reshape(-1, 3)
    positions = np.empty(len(mesh.vertices) * 3, np.float32)
    mesh.vertices.foreach_get('co', positions)
    slots = np.empty(triangle_count, np.int32)
    mesh.loop_triangles.foreach_get('material_index', slots)
    result = Triangles(name, positions.reshape(-1, 3), vertices, version.corner_normals(mesh, loops, vertices), slots,
                       materials)
    for layer in mesh.uv_layers:
        result.uvs[layer.name] = version.loop_uvs(layer, loop_count)[loops]
        if layer.active_render:
            result.render_uv = layer.name
    for attribute in mesh.color_attributes:
        values = np.empty(len(attribute.data) * 4, np.float32)
        attribute.data.foreach_get('color', values)
        index = vertices if attribute.domain == 'POINT' else loops
        values = values.reshape(-1, 4)
        # A colour attribute's alpha is not the material's.
        values[:, 3] = 1
        result.colours[attribute.name] = values[index]
    if len(mesh.color_attributes) and mesh.color_attributes.active_color is not None:
        result.active_colour = mesh.color_attributes.active_color.name
    return result


def _with_colours(read, kinds, materials, color_from, baked):
    """Chooses per triangle its material, UV and colour, as the native mesh wants them."""
    count = len(read.triangles)
    part = {'positions': read.positions, 'triangles': read.triangles, 'corner_normals': read.normals}
    if color_from == 'ATTRIBUTE':
        part['corner_colours'] = _attribute(read, '')
        part['triangle_materials'] = np.full(count, materials.corner(), np.uint32)
        return part
    if baked is not None and color_from == 'BAKED':
        part['corner_uvs'] = baked.uvs
        part['triangle_materials'] = np.full(count, materials.baked_light(baked), np.uint32)
        return part
    uvs = colours = None
    baked_materials = {}
    chosen = np.zeros(count, np.uint32)
    slot_of = np.minimum(read.material_index, max(len(kinds) - 1, 0))
    for slot in np.unique(slot_of):
        mask = slot_of == slot
        kind = kinds[slot] if len(kinds) else colour.BaseColour('CONSTANT')
        material_name = read.materials[slot].name if len(kinds) and read.materials[slot] else 'none'
        if kind.kind == 'CONSTANT':
            chosen[mask] = materials.constant(kind.rgba)
        elif kind.kind in {'CORNER', 'TEXTURE'}:
            try:
                if kind.kind == 'CORNER':
                    values = _attribute(read, kind.attribute)
                    colours = values if colours is None else np.where(mask[:, None, None], values, colours)
                    chosen[mask] = materials.corner()
                else:
                    values = _uv(read, kind.uv_map, kind.image.name)
                    chosen[mask] = materials.texture(kind.image, material_name, kind.with_alpha)
                    uvs = values if uvs is None else np.where(mask[:, None, None], values, uvs)
            except StippleError as problem:
                chosen[mask] = materials.fallback(read.materials[slot], problem)
        else:
            uvs = baked.uvs if uvs is None else np.where(mask[:, None, None], baked.uvs, uvs)
            if kind.kind not in baked_materials:
                baked_materials[kind.kind] = materials.baked(baked.image(kind.kind))
            chosen[mask] = baked_materials[kind.kind]
    part.update(corner_uvs=uvs, corner_colours=colours, triangle_materials=chosen)
    return part


def _uv(read, name, image_name):
    values = read.uvs.get(name or read.render_uv)
    if values is None:
        wanted = f"UV map '{name}'" if name else 'UV map'
        raise invalid(f"Object '{read.name}' has no {wanted}, which image '{image_name}' needs; unwrap the object or "
                      'choose another color source.')
    return values


def _attribute(read, name):
    values = read.colours.get(name or read.active_colour)
    if values is None:
        wanted = f"color attribute '{name}'" if name else 'color attribute'
        raise invalid(f"Object '{read.name}' has no {wanted}; add one or choose another color source.")
    return values


class _Materials:
    """Native materials and textures, each made once."""

    def __init__(self, mesh, notes, with_views):
        self._mesh = mesh
        self._notes = notes
        self._indices = {}
        self._with_views = with_views
        if with_views:
            mesh.set_view_directions(bake.view_directions())

    def constant(self, rgba):
        return self._once(('constant', rgba), lambda: self._mesh.add_material(base_colour=rgba))

    def fallback(self, material, problem):
        """The viewport colour of a material whose own colours are missing; the problem is noted once."""
        note = f"{str(problem).rstrip('.')}. The viewport color of '{material.name}' takes its place."
        if note not in self._notes:
            self._notes.append(note)
        return self.constant(tuple(material.diffuse_color))

    def corner(self):
        return self._once('corner', lambda: self._mesh.add_material(MaterialColour.CORNER))

    def texture(self, image, material_name, with_alpha):
        def make():
            pixels, srgb = colour.image_pixels(image, material_name, with_alpha)
            return self._mesh.add_material(MaterialColour.TEXTURE, texture=self._mesh.add_texture(pixels, srgb))
        return self._once(('image', image.name_full, with_alpha), make)

    def baked(self, pixels):
        texture = self._mesh.add_texture(pixels, srgb=False)
        return self._mesh.add_material(MaterialColour.TEXTURE, texture=texture)

    def baked_light(self, baked):
        """What an object shows in the light of the scene, from all sides alike or as it changes with them."""
        if not self._with_views:
            return self.baked(baked.image('COMBINED'))
        texture = self._mesh.add_texture(baked.image('COMBINED'), srgb=False)
        views = [self._mesh.add_texture(pixels, srgb=False) for pixels in baked.view_images()]
        return self._mesh.add_material(MaterialColour.TEXTURE, texture=texture, view_textures=views)

    def _once(self, key, make):
        if key not in self._indices:
            self._indices[key] = make()
        return self._indices[key]
