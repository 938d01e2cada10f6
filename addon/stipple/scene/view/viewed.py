# SPDX-License-Identifier: GPL-3.0-or-later
"""What a 3D view shows of splat objects: instances, and native clouds of their attributes."""

from dataclasses import dataclass

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ... import version
from .. import grades, handlers, shown as shown_by_layer
from ..source import sources, splat_data, sync

# Objects behind or before which splats can be, apart from splats themselves.
SOLID_TYPES = {'MESH', 'CURVE', 'SURFACE', 'META', 'FONT', 'CURVES', 'POINTCLOUD', 'VOLUME', 'GPENCIL', 'GREASEPENCIL'}

_state = {'version': 0}
# graphics: what is wrong with the graphics card, for panels; off: nothing can be drawn at all.
state = {'graphics': '', 'off': False}
_geometry_versions = {}
_clouds = {}
_edited = {}


@dataclass(frozen=True)
class ViewedSplats:
    """An instance of a splat object in the view layer, whether or not a certain view shows it."""

    key: tuple          # stays while it is the same instance
    owner: object       # the original object that is selected and hidden: instances belong to their instancer
    obj: object         # the original object whose data they are
    state: tuple        # changes with the splats
    count: int
    matrix: np.ndarray  # [4,4] object to world


@dataclass(frozen=True)
class Viewed:
    splats: tuple
    others: frozenset   # original objects that can stand before splats


class ViewedScene:
    """All splats of a view layer; gathered again only after something in the scene has changed."""

    def __init__(self):
        self._key = None
        self._viewed = Viewed((), frozenset())

    def update(self, depsgraph):
        key = (_state['version'], depsgraph.scene.original.as_pointer(), depsgraph.view_layer.name)
        if key != self._key:
            self._viewed = gather(depsgraph)
            self._key = key
        return self._viewed


def gather(depsgraph):
    """Everything that the view layer shows."""
    found, others, splats = [], set(), shown_by_layer.SplatObjects(depsgraph)
    for entry in depsgraph.object_instances:
        if not shown_by_layer.is_shown(entry):
            continue
        obj = splats.of(entry)
        original = (obj or entry.object).original
        owner = entry.parent.original if entry.is_instance else original
        if obj is None:
            if original.type in SOLID_TYPES:
                others.add(owner)
            continue
        count = splat_data.count(obj.data)
        if count:
            key = (owner.name_full, original.name_full, *(entry.persistent_id if entry.is_instance else ()))
            found.append(ViewedSplats(key, owner, original, _state_of(obj, original, count), count,
                                      version.copy_of_evaluated_matrix(entry.matrix_world)))
    shown = {cloud_key(entry.obj) for entry in found}
    for key in [key for key in _clouds if key not in shown]:
        del _clouds[key]
    return Viewed(tuple(found), frozenset(others))


def shown(viewed, space, depsgraph):
    """The splats that one view shows."""
    return [v for v in viewed.splats if shows(space, depsgraph, v.owner, v.obj)]


def shows(space, depsgraph, owner, obj):
    """Whether a view shows an object: local view, local collections, object types. owner: the original object itself,
    or the instancer that it belongs to."""
    # Before point clouds had an entry of their own in the popover, they always showed.
    of_type = space.show_object_viewport_mesh if obj.type == 'MESH' else getattr(
        space, 'show_object_viewport_pointcloud', True)
    return of_type and _is_in(space, depsgraph, owner)


def hides_splats(viewed, space, depsgraph):
    """Whether anything in the view can stand before splats."""
    return any(_is_in(space, depsgraph, obj) for obj in viewed.others)


def _is_in(space, depsgraph, original):
    # Only evaluated objects know whether they are in a local view.
    return original.evaluated_get(depsgraph).visible_in_viewport_get(space)


def clip_planes(region_data):
    """[n,4] in the world: what lies above 0 is hidden (Alt+B). Blender's own planes face the other way."""
    if not region_data.use_clip_planes:
        return np.zeros((0, 4))
    planes = -np.array([tuple(plane) for plane in region_data.clip_planes], np.float64)
    return planes[np.abs(planes[:, :3]).sum(axis=1) > 0]


def cloud_of(entry, depsgraph):
    """(native cloud, its info) of the splats as modifiers leave them; made again when they change.

    Errors: StippleError for attributes that are missing or out of range.
    """
    return _stored(entry.obj.evaluated_get(depsgraph), entry.obj, entry.state)


def stored_cloud(obj):
    """The cloud of an evaluated object's attributes, kept until they change. Errors: as cloud_of."""
    original = obj.original
    return _stored(obj, original, _state_of(obj, original, splat_data.count(obj.data)))[0]


def is_edited(data):
    """sync.is_edited, which reads all attributes, asked once for every change of a datablock."""
    state = _written_state(data)
    known = _edited.get(data.name_full)
    if known is None or known[0] != state:
        known = _edited[data.name_full] = (state, sync.is_edited(data))
    return known[1]


def _stored(obj, original, state):
    key = cloud_key(original)
    known = _clouds.get(key)
    if known is None or known[0] != state:
        cloud = sources.cloud_from_object(obj)
        known = _clouds[key] = (state, cloud, cloud.info())
    return known[1], known[2]


def cloud_key(original):
    """What the splats of an object are kept under."""
    return original.data.name_full, original.name_full if len(original.modifiers) else ''


def _state_of(obj, original, count):
    by_modifiers = _geometry_versions.get(original.name_full, 0) if len(obj.modifiers) else 0
    return count, by_modifiers, *_written_state(original.data)


def _written_state(data):
    return (data.get(sync.WRITTEN_KEY), data.get(sync.FINGERPRINT_KEY), data.get(grades.GRADE_KEY),
            _geometry_versions.get(data.name_full, 0))


def note_changes(depsgraph):
    """Notices which datablocks an evaluation has changed."""
    for update in depsgraph.updates:
        if update.is_updated_geometry and isinstance(update.id,
                                                     (bpy.types.Object, bpy.types.Mesh, bpy.types.PointCloud)):
            name = update.id.original.name_full
            _geometry_versions[name] = _geometry_versions.get(name, 0) + 1


def geometry_version(original):
    """A number that grows whenever the geometry of an object changes."""
    return _geometry_versions.get(original.name_full, 0)


@persistent
def _changed(_scene, depsgraph=None):
    _state['version'] += 1
    if depsgraph is not None:
        note_changes(depsgraph)


@persistent
def _forget(*_):
    """Another file, or another state of this one: nothing is known of it."""
    _state['version'] += 1
    _geometry_versions.clear()
    _clouds.clear()
    _edited.clear()


_HANDLERS = (('depsgraph_update_post', _changed), ('frame_change_post', _changed), ('load_post', _forget),
             ('undo_post', _forget), ('redo_post', _forget))


def register():
    handlers.add(_HANDLERS)


def unregister():
    handlers.remove(_HANDLERS)
    _forget()
