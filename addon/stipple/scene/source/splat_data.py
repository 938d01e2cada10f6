# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats as Blender data.

5.2 and later: a point cloud with the attributes of Blender's own splats. Before: a mesh of vertices
with the same names. `rotation` is w,x,y,z; `radiance:base` holds the DC harmonics and the opacity;
`radiance:sh_<i>` the other coefficients, one colour each. Under a grade these are what is shown, and
`ungraded:base` and `ungraded:sh_<i>` keep the colours and opacities as they were. `seen:score`,
`seen:age` and `seen:contribution` are what density control saw of the splats that it made.
"""

import base64
import zlib

import bmesh
import bpy
import numpy as np

from ... import binding, version
from ...binding import structs
from ...binding.errors import StippleError

LAYOUT_KEY = 'stipple_layout'
LAYOUT = 1
COLOUR_SPACE_KEY = 'stipple_colour_space'
ANTIALIAS_KEY = 'stipple_antialias'
FRAME_KEY = 'stipple_frame'
# By names of the enumerations in binding/structs.py.
_COLOUR_SPACES = {'DISPLAY': 'srgb_rec709_display', 'LINEAR': 'lin_rec709_display'}
_ANTIALIAS = {'CLASSIC': 'classic', 'MIP': 'mip'}
# Attributes of what density control saw, a SplatQuantity each.
_SEEN_NAMES = {'SCORE': 'seen:score', 'AGE': 'seen:age', 'CONTRIBUTION': 'seen:contribution'}
SEEN_SOURCE_KEY = 'stipple_seen_source'
# Smallest scale that is stored, metres: viewers take logarithms, of which zero has none.
MIN_SCALE = 1e-9


def new_data(name, like=None):
    """An empty splat datablock of the kind that this Blender holds splats in. like: of the kind of this datablock,
    which an object of it can take; one of an older Blender's file is a mesh."""
    is_mesh = isinstance(like, bpy.types.Mesh) if like is not None else not version.HAS_SIZED_POINT_CLOUDS
    data = bpy.data.meshes.new(name) if is_mesh else bpy.data.pointclouds.new(name)
    data[LAYOUT_KEY] = LAYOUT
    return data


def new_object(name, data):
    """An object of splat data that the add-on draws; Blender draws its box."""
    obj = bpy.data.objects.new(name, data)
    if not bpy.app.background:
        show_as_box(obj)
    return obj


def show_as_box(obj, box=True):
    """Vertices are drawn as black dots and points as balls: a box leaves room for the splats themselves.

    Objects that the user gave another display type keep it.
    """
    if not version.HAS_NATIVE_SPLATS and obj.display_type == ('TEXTURED' if box else 'BOUNDS'):
        obj.display_type = 'BOUNDS' if box else 'TEXTURED'


def is_splats(data):
    """True for data that Stipple made; also for evaluated copies."""
    return data is not None and isinstance(data, (bpy.types.Mesh, bpy.types.PointCloud)) and (
        data.get(LAYOUT_KEY) is not None)


def is_splat_object(obj):
    # Modifiers may drop custom properties from the evaluated data: the original has them.
    return obj is not None and obj.type in {'MESH', 'POINTCLOUD'} and is_splats(obj.original.data)


def count(data):
    return len(data.vertices) if isinstance(data, bpy.types.Mesh) else len(data.points)


def bytes_each(data):
    """Bytes that each splat of a datablock takes."""
    return 4 * (3 + 3 + 4 + 4 + 3 * ((degree(data) + 1) ** 2 - 1))


def degree(data):
    """The degree of the harmonics that a datablock stores."""
    return binding.cloud.sh_degree_of(1 + sum(a.name.startswith('radiance:sh_') for a in data.attributes))


def write(data, splats, ungraded=None):
    """Replaces the splats of a datablock (SplatArrays or CloudColumns). ungraded: the same splats before their grade,
    to be kept beside them."""
    if isinstance(data, bpy.types.Mesh) and data.is_editmode:
        raise StippleError(f"'{data.name}' is in Edit Mode; leave it before its splats are written.",
                           structs.Status.ERROR_INVALID_ARGUMENT)
    if isinstance(data, bpy.types.Mesh) and not _is_editable(data):
        _write_linked(data, splats, ungraded)
        return
    _resize(data, splats.count)
    if isinstance(data, bpy.types.Mesh):
        data.vertices.foreach_set('co', _flat(splats.column('positions')))
    else:
        _set(data, 'position', 'FLOAT_VECTOR', splats.column('positions'))
    _set(data, 'scale', 'FLOAT_VECTOR', np.maximum(splats.column('scales'), np.float32(MIN_SCALE)))
    _set(data, 'rotation', version.ROTATION_TYPE, splats.column('rotations'))
    _write_colours(data, 'radiance', splats)
    _write_colours(data, 'ungraded', ungraded)
    _write_seen(data, (splats if ungraded is None else ungraded).seen)
    _mark(data, splats)


def _write_colours(data, prefix, splats):
    """Colours and opacities under names with this prefix; None removes them."""
    rest = -1
    if splats is not None:
        _set(data, f'{prefix}:base', version.BASE_TYPE, splats.column('base'))
        rest = (splats.sh_degree + 1) ** 2 - 1
        for i in range(rest):
            _set(data, f'{prefix}:sh_{i}', 'FLOAT_VECTOR', splats.column(i))
    elif f'{prefix}:base' in data.attributes:
        data.attributes.remove(data.attributes[f'{prefix}:base'])
    for name in [a.name for a in data.attributes if a.name.startswith(f'{prefix}:sh_')]:
        if int(name.rpartition('_')[2]) >= rest:
            data.attributes.remove(data.attributes[name])


def _seen_names():
    return [(structs.SplatQuantity[kind], name) for kind, name in _SEEN_NAMES.items()]


def _write_seen(data, seen):
    for kind, name in _seen_names():
        if kind in seen:
            _set(data, name, 'FLOAT', seen[kind])
        elif name in data.attributes:
            data.attributes.remove(data.attributes[name])


def read_seen(data, kind):
    """[N] what density control saw of the splats of a datablock (SplatQuantity), None where it is not known."""
    attribute = data.attributes.get(_SEEN_NAMES[kind.name])
    if attribute is None or attribute.data_type != 'FLOAT' or attribute.domain != 'POINT':
        return None
    return np.array(version.attribute_values(attribute.data, 'value', count(data), 1), np.float32)


def keep_seen(data, source, seen):
    """Keeps what was seen of all splats of a source, for when its whole budget is shown again. As text: from Blender 4
    on, bytes end at the first zero."""
    for kind, name in _seen_names():
        if kind in seen:
            values = np.ascontiguousarray(seen[kind], np.float32).tobytes()
            data[f'stipple_{name}'] = base64.b64encode(zlib.compress(values, 1)).decode()
        else:
            data.pop(f'stipple_{name}', None)
    data[SEEN_SOURCE_KEY] = source


def kept_seen(data, source, count):
    """What keep_seen() kept of a source of `count` splats."""
    found = {}
    if data.get(SEEN_SOURCE_KEY) == source:
        for kind, name in _seen_names():
            packed = data.get(f'stipple_{name}')
            if packed is None:
                continue
            values = np.frombuffer(zlib.decompress(base64.b64decode(packed)), np.float32)
            if len(values) == count:
                found[kind] = values
    return found


def _is_editable(data):
    """False for linked and overridden data: foreach_set passes them over in silence."""
    return data.library is None and data.override_library is None


def _write_linked(mesh, splats, ungraded):
    """BMesh writes data that foreach_set does not."""
    own = bpy.data.meshes.new(mesh.name)
    try:
        write(own, splats, ungraded)
        carrier = bmesh.new()
        carrier.from_mesh(own)
        carrier.to_mesh(mesh)
        carrier.free()
    finally:
        bpy.data.meshes.remove(own)
    _mark(mesh, splats)


def _mark(data, splats):
    data[LAYOUT_KEY] = LAYOUT
    data[COLOUR_SPACE_KEY] = _COLOUR_SPACES[structs.ColourSpace(splats.colour_space).name]
    data[ANTIALIAS_KEY] = _ANTIALIAS[structs.Antialias(splats.antialias).name]
    data[FRAME_KEY] = structs.Frame(splats.frame).name
    if isinstance(data, bpy.types.Mesh):
        data.update()
    data.update_tag()


def read(data, original=None):
    """The splats of a datablock as they are shown. original: the datablock that tells the colour space, where data is
    evaluated.

    Errors: StippleError for attributes that are missing.
    """
    return _read(data, original, 'radiance')


def read_ungraded(data, original=None):
    """The same before the grade that the attributes carry."""
    return _read(data, original, _ungraded(data))


def cloud(native, data, original=None):
    """A native cloud of read(), made without arrays between it and the attributes."""
    return _cloud(native, data, original, 'radiance')


def ungraded_cloud(native, data, original=None):
    """A native cloud of read_ungraded()."""
    return _cloud(native, data, original, _ungraded(data))


def _ungraded(data):
    return 'ungraded' if data.attributes.get('ungraded:base') is not None else 'radiance'


def _read(data, original, prefix):
    n, columns, rest = _columns(data, prefix)
    sh = np.empty((n, len(rest) + 1, 3), np.float32)
    base = columns['base'].reshape(n, 4)
    sh[:, 0] = base[:, :3]
    for i, values in enumerate(rest):
        sh[:, i + 1] = values.reshape(n, 3)
    return binding.cloud.SplatArrays(
        columns['positions'].reshape(n, 3).copy(), columns['rotations'].reshape(n, 4).copy(),
        columns['scales'].reshape(n, 3).copy(), base[:, 3].copy(), sh,
        *_marks(data if original is None else original), _seen(data))


def _seen(data):
    found = {kind: read_seen(data, kind) for kind, _ in _seen_names()}
    return {kind: values for kind, values in found.items() if values is not None}


def _cloud(native, data, original, prefix):
    _, columns, rest = _columns(data, prefix)
    return binding.cloud.Cloud.from_columns(native, columns, rest, *_marks(data if original is None else original))


def _columns(data, prefix):
    """(number of splats, values by COLUMN_WIDTHS' names, those of the harmonics above degree 0), flat, to be used
    before anything is written."""
    n, rest = count(data), 0
    while data.attributes.get(f'{prefix}:sh_{rest}') is not None:
        rest += 1
    binding.cloud.sh_degree_of(rest + 1)
    columns = {'positions': _positions(data, n), 'rotations': _get(data, 'rotation', n, 4),
               'scales': _get(data, 'scale', n, 3), 'base': _get(data, f'{prefix}:base', n, 4)}
    return n, columns, [_get(data, f'{prefix}:sh_{i}', n, 3) for i in range(rest)]


def _marks(data):
    """What SplatArrays has beside its arrays."""
    return (structs.ColourSpace[_key_of(_COLOUR_SPACES, data.get(COLOUR_SPACE_KEY), 'DISPLAY')],
            structs.Antialias[_key_of(_ANTIALIAS, data.get(ANTIALIAS_KEY), 'CLASSIC')],
            structs.Frame.__members__.get(data.get(FRAME_KEY), structs.Frame.UNKNOWN))


def read_points(data, step=1):
    """Positions [n,3] and DC harmonics [n,3] of every step-th splat. Errors: StippleError for missing attributes."""
    n = count(data)
    positions, base = _positions(data, n).reshape(n, 3), _get(data, 'radiance:base', n, 4).reshape(n, 4)
    return positions[::step].copy(), base[::step, :3].copy()


def fingerprint(data):
    """A short text that changes with positions, shapes or colours."""
    n = count(data)
    value = zlib.crc32(str(n).encode())
    if isinstance(data, bpy.types.Mesh):
        value = zlib.crc32(_positions(data, n), value)
    for attribute in data.attributes:
        field = version.ATTRIBUTE_FIELDS.get(attribute.data_type)
        if attribute.domain != 'POINT' or field is None or not (
                attribute.name in {'position', 'scale', 'rotation'} or attribute.name.startswith('radiance:')):
            continue
        if attribute.name == 'position' and isinstance(data, bpy.types.Mesh):
            continue
        width = {'FLOAT': 1, 'FLOAT_VECTOR': 3}.get(attribute.data_type, 4)
        value = zlib.crc32(version.attribute_values(attribute.data, field, n, width), value)
    return f'{value:08x}'


def _resize(data, n):
    if count(data) == n:
        return
    if isinstance(data, bpy.types.Mesh):
        # Not clear_geometry(): that also frees the datablock's animation and drivers.
        empty = bmesh.new()
        empty.to_mesh(data)
        empty.free()
        data.vertices.add(n)
    else:
        data.resize(n)


def _set(data, name, kind, values):
    attribute = data.attributes.get(name)
    if attribute is not None and (attribute.data_type != kind or attribute.domain != 'POINT'):
        data.attributes.remove(attribute)
        attribute = None
    if attribute is None:
        data.attributes.new(name, kind, 'POINT')
    # Looked up again: references may be stale after new().
    elements, field = data.attributes[name].data, version.ATTRIBUTE_FIELDS[kind]
    if _is_editable(data):
        elements.foreach_set(field, _flat(values))
        return
    # Point clouds have no BMesh. Some 3 µs for each value.
    for element, value in zip(elements, np.asarray(values).reshape(len(elements), -1).tolist()):
        setattr(element, field, value)


def _positions(data, n):
    if isinstance(data, bpy.types.Mesh):
        return version.attribute_values(data.vertices, 'co', n, 3)
    return _get(data, 'position', n, 3)


def _get(data, name, n, width):
    attribute = data.attributes.get(name)
    if attribute is None:
        raise StippleError(f"'{data.name}' has no attribute '{name}'; a splat object needs position, scale, rotation "
                           'and radiance:base.', structs.Status.ERROR_INVALID_ARGUMENT)
    return version.attribute_values(attribute.data, version.ATTRIBUTE_FIELDS[attribute.data_type], n, width)


def _flat(values):
    # foreach_set copies at once only from a flat, contiguous buffer of the plain format 'f'.
    return np.ascontiguousarray(values, np.float32).reshape(-1).view(np.float32)


def _key_of(table, text, default):
    return next((key for key, value in table.items() if value == text), default)
