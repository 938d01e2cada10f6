# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes of the scene that take another shape: what they begin with, what they aim at, and where the result goes."""

from dataclasses import dataclass

import bpy
import numpy as np

from .. import version
from ..binding.errors import invalid
from ..binding.mesh import Mesh
from . import meshes, shapes
from .fit import view_rigs
from .source import placement, sources, splat_data

_UNSEEN = {'ARMATURE', 'CAMERA', 'LATTICE', 'LIGHT', 'LIGHT_PROBE', 'SPEAKER'}


@dataclass
class Template:
    """A mesh whose vertices shall move, taken out of Blender."""

    name: str               # of the object
    positions: np.ndarray   # [V,3] object space
    triangles: np.ndarray   # [T,3]
    matrix: np.ndarray      # [4,4] object to world

    def native(self):
        """As a native mesh, in the world. A matrix that mirrors would turn its faces inside out."""
        mesh = Mesh.create(sources.context())
        is_mirrored = np.linalg.det(self.matrix[:3, :3]) < 0
        mesh.add_part(self.world(), self.triangles[:, ::-1] if is_mirrored else self.triangles, np.eye(4))
        return mesh

    def world(self):
        """[V,3] positions in the world."""
        return self.positions.astype(np.float64) @ self.matrix[:3, :3].T + self.matrix[:3, 3]

    def local(self, mesh):
        """[V,3] positions of a native mesh in the world, in object space."""
        back = np.linalg.inv(self.matrix)
        return (mesh.read()[0].astype(np.float64) @ back[:3, :3].T + back[:3, 3]).astype(np.float32)


def template_of(obj, result, from_mix):
    """The Template that an object with a mesh is, without its modifiers. from_mix: its shape keys as they are mixed;
    otherwise the one that the others refer to. Errors: StippleError for what cannot be written afterwards."""
    if any(data.library is not None for data in (obj, obj.data)):
        raise invalid(f"'{obj.name}' is linked from another file; make it local first.")
    matrix = placement.matrix_of(obj)
    keys = obj.data.shape_keys
    if keys is not None and result == 'APPLY':
        raise invalid(f"'{obj.name}' has shape keys, which hold its shape; choose the result Shape Key.")
    if keys is not None and not keys.use_relative:
        raise invalid(f"'{obj.name}' has absolute shape keys; turn on Relative for them.")
    positions, triangles = shapes.mesh_arrays(obj.data)
    if len(triangles) == 0:
        raise invalid(f"'{obj.name}' has no faces; at least four triangles are needed.")
    if keys is not None:
        positions = _mixed(obj) if from_mix else _coordinates(keys.reference_key.data)
    return Template(obj.name, positions, triangles, matrix)


def target_of(obj, depsgraph):
    """What start_adapt() aims at for an object, in the world, as it is shown: a Mesh, a Cloud or points. Errors:
    StippleError for an object that is none of them."""
    evaluated = obj.evaluated_get(depsgraph)
    matrix = placement.matrix_of(evaluated)
    if splat_data.is_splat_object(obj):
        return sources.cloud_from_object(evaluated).transformed(matrix)
    if obj.type in meshes.MESH_LIKE or obj.instance_type != 'NONE':
        mesh = shapes.bare_mesh(sources.context(), [obj], depsgraph, may_be_empty=True)
        if mesh is not None:
            return mesh
    points = _points(obj, depsgraph)
    if len(points) == 0:
        raise invalid(f"'{obj.name}' has neither faces nor points; a mesh, a point cloud or splats are needed as the "
                      'target.')
    return points, None


def can_render(obj):
    """Whether an object is of a kind that Cycles shows."""
    if obj.type in _UNSEEN or splat_data.is_splat_object(obj):
        return False
    return obj.type != 'EMPTY' or obj.instance_type != 'NONE'


def require_shown_instances(objects, view_layer):
    """Errors: StippleError where an object shows another one that has to be hidden from the renders at its own place:
    Blender then hides it in the collection's instances, too."""
    for obj in objects:
        collection = obj.instance_collection if obj.instance_type == 'COLLECTION' else None
        for shown in () if collection is None else collection.all_objects:
            if shown not in objects and shown.name in view_layer.objects and not shown.hide_render:
                raise invalid(f"'{shown.name}' is in the scene itself and in the collection that '{obj.name}' shows; "
                              'select it, too, or exclude its collection from the view layer.')


def require_nearness(template, objects, depsgraph):
    """Errors: StippleError where the box of a Template and that of objects have no part in common, so that no image of
    them can say where its vertices belong; or where nothing of the objects is visible."""
    bounds = view_rigs.bounds_of(objects, depsgraph)
    places = template.world()
    if (places.min(0) > bounds.highest).any() or (places.max(0) < bounds.lowest).any():
        raise invalid(f"'{template.name}' lies apart from what is rendered; move it there, or choose the alignment "
                      'Location and Size.')


def landmarks_of(obj, collection_name):
    """[(vertex, place in the world)]: each object of a collection says where the vertex belongs that weighs most in the
    vertex group of its name. Errors: StippleError for a name without a collection, a group or a vertex."""
    if not collection_name:
        return []
    collection = bpy.data.collections.get(collection_name)
    if collection is None:
        raise invalid(f"There is no collection '{collection_name}', which the landmarks are to be in.")
    marks = list(collection.all_objects)
    groups = {}
    for mark in marks:
        group = obj.vertex_groups.get(mark.name)
        if group is None:
            raise invalid(f"'{obj.name}' has no vertex group '{mark.name}', which the landmark of that name needs.")
        groups[group.index] = (0.0, None)
    for vertex in obj.data.vertices:
        for entry in vertex.groups:
            if entry.group in groups and entry.weight > groups[entry.group][0]:
                groups[entry.group] = (entry.weight, vertex.index)
    found = []
    for mark in marks:
        vertex = groups[obj.vertex_groups[mark.name].index][1]
        if vertex is None:
            raise invalid(f"No vertex of '{obj.name}' is in the vertex group '{mark.name}', which the landmark of that "
                          'name needs.')
        found.append((vertex, tuple(mark.matrix_world.translation)))
    return found


class Shown:
    """Where the result goes, and shapes on the way to it. Objects are looked up by their names each time, since the
    user may undo, rename or remove them meanwhile."""

    def __init__(self, template, result, key_name):
        self._template = template
        self._result = result
        self._wanted_name = key_name
        self._key_name = ''  # of the key that this has made
        self._values = {}    # of the other keys, before
        self._made_basis = False
        self._is_written = False

    def problem(self):
        """A sentence where nothing can be written now, else ''."""
        obj = bpy.data.objects.get(self._template.name)
        if obj is None or obj.type != 'MESH':
            return f"'{self._template.name}' is not there any more; its new shape is lost."
        if len(obj.data.vertices) != len(self._template.positions):
            return f"The vertices of '{obj.name}' are others now; its new shape fits them no more."
        if obj.mode == 'EDIT':
            return f"'{obj.name}' is in Edit Mode; its new shape cannot be written."
        return ''

    def write(self, positions):
        """In: [V,3] object space. Errors: StippleError where problem() has one."""
        problem = self.problem()
        if problem:
            raise invalid(problem)
        obj = bpy.data.objects[self._template.name]
        elements = obj.data.vertices if self._result == 'APPLY' else self._key(obj).data
        elements.foreach_set('co', np.ascontiguousarray(positions, np.float32).ravel())
        self._is_written = True
        obj.data.update()

    def take_back(self):
        """Leaves everything as it was before the first write()."""
        if not self._is_written or self.problem():
            return
        obj = bpy.data.objects[self._template.name]
        if self._result == 'APPLY':
            self.write(self._template.positions)
            return
        keys = obj.data.shape_keys
        key = keys.key_blocks.get(self._key_name) if keys is not None else None
        if key is None:
            return
        obj.shape_key_remove(key)
        for name, value in self._values.items():
            if name in keys.key_blocks:
                keys.key_blocks[name].value = value
        if self._made_basis and len(keys.key_blocks) == 1:
            obj.shape_key_clear()
        obj.data.update()

    def _key(self, obj):
        keys = obj.data.shape_keys
        if keys is not None and self._key_name in keys.key_blocks:
            return keys.key_blocks[self._key_name]
        if keys is None:
            obj.shape_key_add(name='Basis', from_mix=False)
            keys, self._made_basis = obj.data.shape_keys, True
        others = [key for key in keys.key_blocks if key != keys.reference_key]
        self._values = {key.name: key.value for key in others}
        for key in others:
            key.value = 0.0
        key = obj.shape_key_add(name=self._wanted_name, from_mix=False)
        key.relative_key, key.value = keys.reference_key, 1.0
        self._key_name = key.name
        obj.active_shape_key_index = len(keys.key_blocks) - 1
        return key


def _points(obj, depsgraph):
    """[P,3] vertices and points that an object shows, in the world: its own, and what geometry nodes make of it."""
    found = [np.zeros((0, 3))]
    for entry in depsgraph.object_instances:
        owner = entry.parent.original if entry.is_instance else entry.object.original
        data = entry.object.data
        if owner != obj or not isinstance(data, (bpy.types.Mesh, bpy.types.PointCloud)):
            continue
        matrix = version.copy_of_evaluated_matrix(entry.matrix_world)
        local = _coordinates(data.vertices) if isinstance(data, bpy.types.Mesh) else _positions(data)
        found.append(local.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3])
    return np.concatenate(found)


def _positions(cloud):
    attribute = cloud.attributes.get('position')
    return np.zeros((0, 3), np.float32) if attribute is None else _coordinates(attribute.data, 'vector')


def _mixed(obj):
    """[V,3] of the shape keys as they are mixed now."""
    index = obj.active_shape_key_index
    key = obj.shape_key_add(name='mix', from_mix=True)
    try:
        return _coordinates(key.data)
    finally:
        obj.shape_key_remove(key)
        obj.active_shape_key_index = index


def _coordinates(elements, name='co'):
    positions = np.empty(len(elements) * 3, np.float32)
    elements.foreach_get(name, positions)
    return positions.reshape(-1, 3)
