# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats that follow a mesh as it deforms: what a datablock is bound to, and its splats at one shape of the mesh.

The mesh at rest is a mesh of the .blend, which goes where the file goes; which triangles a splat follows is found anew
for every budget and kept. Nothing here writes splats.
"""

import threading
import zlib
from collections import OrderedDict
from dataclasses import dataclass

import bpy
import numpy as np

from ... import version
from ...binding.errors import StippleError
from ...binding.job import Job
from ...binding.structs import BindingReach, Status
from ...binding.surface_binding import SurfaceBinding, asset_rest
from . import source_paths, sources

# On objects: it has no influence, but Blender evaluates its target for it, hidden meshes too.
CONSTRAINT = 'Splat Binding'
_KEPT = 8  # bindings that are kept
# Of modifiers: what renders evaluate and what the viewport does.
_MODES = (('show_render', 'show_viewport'), ('render_levels', 'levels'))

_rests = OrderedDict()  # by (key of a binding, of renders): (vertices [V,3], triangles [T,3]), in the splats' space
_held = OrderedDict()   # by (key of a binding, key of a cloud): (Cloud, SurfaceBinding)
_lock = threading.Lock()


def is_bound(data):
    return data.stipple.bind_rest is not None


def follows(data):
    """Whether a datablock's splats follow a mesh at present, and do not rest."""
    return is_bound(data) and data.stipple.bind_follow


def bind(data, obj, reach, matrix, depsgraph, brought=None):
    """Binds a datablock to a mesh object in its present shape. matrix: [4,4], from the space of the mesh object to that
    of the splats. brought: as of brought_rest(), which is taken in place of the present shape and of reach where it has
    the same faces; returns whether it has. Errors: StippleError for an object without a
    triangle."""
    shape = _shape_of(obj, depsgraph, with_triangles=True)
    is_brought = brought is not None and np.array_equal(brought[1], shape.triangles)
    if is_brought:
        shape.vertices, reach = _placed(brought[0], np.linalg.inv(matrix)), brought[2]
    if len(shape.triangles) == 0:
        raise StippleError(f"'{obj.name}' has no faces; at least one is needed for splats to follow.",
                           Status.ERROR_INVALID_ARGUMENT)
    rendered = None if is_brought else _rendered_shape(obj, depsgraph)
    unbind(data)
    stipple = data.stipple
    stipple.bind_object, stipple.bind_reach = obj, reach
    stipple.bind_matrix = np.asarray(matrix, np.float64).reshape(-1).tolist()
    stipple.bind_rest, stipple.bind_topology = _stored(data, shape), shape.topology
    if rendered is not None and len(rendered.triangles) and rendered.topology != shape.topology:
        stipple.bind_rest_render = _stored(data, rendered)
        stipple.bind_topology_render = rendered.topology
    stipple.bind_follow = True
    stipple.bind_key = _key_of(stipple, shape)
    return is_brought


def brought_rest(data):
    """(vertices [V,3] in the space of the splats, triangles [T,3], a name of choices.REACHES) of the mesh that the file
    of a datablock's splats brings, else None. Errors: StippleError."""
    path = source_paths.file_of(data)
    if not path.endswith('.safetensors'):
        return None
    found = asset_rest(sources.context(), path)
    return None if found is None else (found[0], found[1], found[2].name)


def unbind(data):
    """The datablock's splats stay at rest."""
    stipple = data.stipple
    rests = [rest for rest in (stipple.bind_rest, stipple.bind_rest_render) if rest is not None]
    for name in ('bind_object', 'bind_rest', 'bind_rest_render', 'bind_key', 'bind_topology', 'bind_topology_render'):
        stipple.property_unset(name)
    for rest in rests:
        if rest.users == 0:
            bpy.data.meshes.remove(rest)


def _stored(data, shape):
    """A mesh of the .blend that keeps a shape, of triangles."""
    rest = bpy.data.meshes.new(f'{data.name} at rest')
    version.set_triangles(rest, shape.vertices, shape.triangles)
    return rest


def _rendered_shape(obj, depsgraph):
    """The shape that a render gives an object, where its modifiers say that it is another one; else None. Subdivision
    has more levels in renders as soon as it is added."""
    changed = [(modifier, seen, getattr(modifier, seen)) for modifier in obj.modifiers for rendered, seen in _MODES
               if hasattr(modifier, rendered) and getattr(modifier, rendered) != getattr(modifier, seen)]
    if not changed or depsgraph.mode != 'VIEWPORT':
        return None
    try:
        for rendered, seen in _MODES:
            for modifier in {modifier.name: modifier for modifier, name, _ in changed if name == seen}.values():
                setattr(modifier, seen, getattr(modifier, rendered))
        depsgraph.view_layer.update()
        return _shape_of(obj, depsgraph, with_triangles=True)
    finally:
        for modifier, seen, value in changed:
            setattr(modifier, seen, value)
        depsgraph.view_layer.update()


def rebind(data, depsgraph=None):
    """A datablock that is bound has got other splats, in the present shape of its mesh: that is their rest now."""
    stipple = data.stipple
    if not is_bound(data):
        return
    if stipple.bind_object is None:
        unbind(data)
        return
    follow = stipple.bind_follow
    try:
        bind(data, stipple.bind_object, stipple.bind_reach, _matrix_of(stipple), _depsgraph(depsgraph))
    except StippleError:
        unbind(data)
    else:
        stipple.bind_follow = follow


def hold(obj, target):
    """Sees to it that Blender evaluates the mesh that an object's splats follow; target: None for no more."""
    constraint = obj.constraints.get(CONSTRAINT)
    if target is None:
        if constraint is not None:
            obj.constraints.remove(constraint)
        return
    if constraint is None:
        constraint = obj.constraints.new('SHRINKWRAP')
        constraint.name = CONSTRAINT
        constraint.influence = 0.0
        constraint.show_expanded = False
    constraint.target = target


def carrier(data, depsgraph=None):
    """The Carrier of a datablock at the time of a depsgraph (None: of the window), None where it follows no mesh.
    Errors: StippleError for a mesh that is gone or has other faces."""
    if not follows(data):
        return None
    stipple, depsgraph = data.stipple, _depsgraph(depsgraph)
    obj = stipple.bind_object
    if obj is None or not obj.users_scene:
        raise _gone(data, obj)
    shape = _shape_of(obj, depsgraph)
    if shape.topology not in (stipple.bind_topology, stipple.bind_topology_render):
        raise StippleError(f"The faces of '{obj.name}' are not those that '{data.name}' was bound to "
                           f"({len(shape.vertices):,} vertices now, {_count_of(stipple.bind_topology)} then); its "
                           'modifiers must make the same faces in every frame. Choose Unbind, and bind the splats '
                           'again.',
                           Status.ERROR_INVALID_ARGUMENT)
    as_rendered = shape.topology != stipple.bind_topology
    return Carrier(f'{stipple.bind_key}:render' if as_rendered else stipple.bind_key, stipple.bind_reach,
                   _rest_of(stipple, as_rendered), _placed(shape.vertices, _matrix_of(stipple)))


class Carrier:
    """What moves a datablock's splats to one shape of their mesh. Once it is made it never touches Blender."""

    def __init__(self, bind_key, reach, rest, deformed):
        """rest: (vertices [V,3], triangles [T,3]), deformed: [V,3], in the space of the splats."""
        self._bind_key, self._reach = bind_key, BindingReach[reach]
        self._rest, self._deformed = rest, deformed
        self.key = f'{self._bind_key}:{zlib.crc32(deformed):08x}'  # changes with the splats that are carried

    def held(self, key):
        """What is kept of a cloud, None for nothing."""
        with _lock:
            return _held.get((self._bind_key, key))

    def carried(self, key, make, wait=Job.wait):
        """The cloud that make() gives, as the mesh carries it. key: tells such clouds apart; make() is not called for
        one that is kept. wait(job): called with the job that binds it. Errors: StippleError."""
        held = self.held(key)
        if held is None:
            cloud = make()
            job = SurfaceBinding.start(cloud, *self._rest, self._reach)
            wait(job)
            job.wait()
            held = cloud, SurfaceBinding.of_job(job)
        with _lock:
            _held[(self._bind_key, key)] = held
            _held.move_to_end((self._bind_key, key))
            while len(_held) > _KEPT:
                _held.popitem(last=False)
        cloud, binding = held
        return binding.carry(cloud, self._deformed)


def is_held(data, key):
    """Whether the cloud of this key is kept for a datablock that follows a mesh."""
    with _lock:
        return follows(data) and (data.stipple.bind_key, key) in _held


def forget():
    """Gives all native memory back."""
    with _lock:
        _held.clear()
        _rests.clear()


def _gone(data, obj):
    name = 'that' if obj is None else f"'{obj.name}', which"
    return StippleError(f"The mesh {name} '{data.name}' follows is gone; choose Unbind, or bind the splats to another "
                        'mesh.', Status.ERROR_INVALID_ARGUMENT)


def _depsgraph(depsgraph):
    return bpy.context.evaluated_depsgraph_get() if depsgraph is None else depsgraph


def _matrix_of(stipple):
    return np.array(stipple.bind_matrix, np.float64).reshape(4, 4)


def _placed(vertices, matrix):
    """Vertices [V,3] under a 4x4 matrix, float32."""
    return np.ascontiguousarray(vertices @ matrix[:3, :3].T + matrix[:3, 3], np.float32)


@dataclass
class _Shape:
    """An evaluated mesh object, in its own space."""

    vertices: np.ndarray   # [V,3]
    topology: str          # tells its faces from others
    triangles: np.ndarray  # [T,3], where they are wanted


def _shape_of(obj, depsgraph, with_triangles=False):
    """The _Shape of a mesh object at the depsgraph's time. Errors: StippleError for one that Blender does not
    evaluate."""
    evaluated = obj.evaluated_get(depsgraph)
    if not evaluated.is_evaluated:
        raise StippleError(f"Blender does not evaluate '{obj.name}'; choose Unbind, and bind the splats again.",
                           Status.ERROR_INVALID_ARGUMENT)
    # Not its data: those of a subdivision that a graphics card makes have no more vertices than before.
    mesh = evaluated.to_mesh()
    try:
        vertices, corners = np.empty(3 * len(mesh.vertices), np.float32), np.empty(len(mesh.loops), np.int32)
        starts = np.empty(len(mesh.polygons), np.int32)
        mesh.vertices.foreach_get('co', vertices)
        mesh.loops.foreach_get('vertex_index', corners)
        mesh.polygons.foreach_get('loop_start', starts)
        triangles = None
        if with_triangles:
            mesh.calc_loop_triangles()
            triangles = np.empty(3 * len(mesh.loop_triangles), np.int32)
            mesh.loop_triangles.foreach_get('vertices', triangles)
            triangles = triangles.reshape(-1, 3).astype(np.uint32)
    finally:
        evaluated.to_mesh_clear()
    topology = f'{len(vertices) // 3}:{zlib.crc32(starts, zlib.crc32(corners)):08x}'
    return _Shape(vertices.reshape(-1, 3), topology, triangles)


def _count_of(topology):
    return f'{int(topology.partition(":")[0] or 0):,}'


def _rest_of(stipple, as_rendered):
    """(vertices [V,3] in the space of the splats, triangles [T,3]) of the mesh at rest, read once."""
    key = stipple.bind_key, as_rendered
    with _lock:
        known = _rests.get(key)
    if known is None:
        mesh = stipple.bind_rest_render if as_rendered else stipple.bind_rest
        vertices, corners = np.empty(3 * len(mesh.vertices), np.float32), np.empty(len(mesh.loops), np.int32)
        mesh.vertices.foreach_get('co', vertices)
        mesh.loops.foreach_get('vertex_index', corners)
        vertices, triangles = vertices.reshape(-1, 3), corners.reshape(-1, 3).astype(np.uint32)
        known = _placed(vertices, _matrix_of(stipple)), triangles
        with _lock:
            _rests[key] = known
            while len(_rests) > _KEPT:
                _rests.popitem(last=False)
    return known


def _key_of(stipple, shape):
    """Equal for equal bindings."""
    value = zlib.crc32(shape.triangles, zlib.crc32(shape.vertices))
    value = zlib.crc32(np.array(stipple.bind_matrix, np.float32), value)
    return f'{stipple.bind_reach}:{shape.topology}:{value:08x}'
