# SPDX-License-Identifier: GPL-3.0-or-later
"""What is collected, asset by asset: files of a folder, or objects of a collection.

An asset is brought into a scene that is made for it, and all that came into the open file with it goes again.
"""

import contextlib
import os
from dataclasses import dataclass

import bpy

from ... import version
from ...binding.errors import invalid
from .. import adapting, meshes
from . import imported

EXTENSIONS = ('.blend', *version.MESH_IMPORTERS)
# They may lie about in a scene, or be in its way.
_UNSEEN = {'LIGHT', 'CAMERA', 'LIGHT_PROBE', 'SPEAKER', 'ARMATURE', 'LATTICE'}


class LeftOutError(Exception):
    """An asset that cannot be collected; the text goes on after 'left out: '."""


@dataclass(frozen=True)
class FileAsset:
    name: str  # of its folder
    path: str

    def stamp(self):
        """What changes where the asset does."""
        try:
            facts = os.stat(self.path)
        except OSError as error:
            raise LeftOutError(f'it cannot be read: {error.strerror}') from None
        return f'{os.path.basename(self.path)} {facts.st_size} {facts.st_mtime_ns}'

    @contextlib.contextmanager
    def within(self, scene):
        """Links its objects to a scene while this lasts. Errors: LeftOutError."""
        self.stamp()  # a file that is not there
        before = _known()
        added = set()
        try:
            try:
                if self.path.lower().endswith('.blend'):
                    _append(self.path, scene)
                else:
                    _import(self.path, scene)
            finally:
                added = _known() - before
            for obj in _found(added):
                if obj.rna_type.identifier == 'Object' and obj.type == 'LIGHT':
                    obj.hide_render = True  # in instances, too
            yield
        finally:
            _remove(added)


@dataclass(frozen=True)
class ObjectAsset:
    name: str
    objects: tuple  # an object of the open file, and what hangs on it

    def stamp(self):
        return meshes.fingerprint(self.objects)

    @contextlib.contextmanager
    def within(self, scene):
        """Links its objects to a scene while this lasts."""
        current = bpy.context.scene
        _take_time(scene, current)
        _link(self.objects, scene)
        try:
            yield
        finally:
            for obj in list(scene.collection.objects):
                if obj in self.objects:
                    scene.collection.objects.unlink(obj)


def of_folder(folder, left_out=''):
    """The assets of a folder and of those in it, by name. left_out: a folder that is not looked into. Errors:
    StippleError for a folder that is not there, or has none."""
    if not os.path.isdir(folder):
        raise invalid(f"'{folder}' is no folder; one with meshes is needed ({', '.join(EXTENSIONS)}).")
    passed_over = os.path.realpath(left_out) if left_out else None
    paths = []
    for place, folders, files in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith('.')
                            and os.path.realpath(os.path.join(place, name)) != passed_over)
        paths += [os.path.relpath(os.path.join(place, name), folder) for name in files
                  if os.path.splitext(name)[1].lower() in EXTENSIONS and not name.startswith('.')]
    if not paths:
        raise invalid(f"'{folder}' has no meshes; files of the types {', '.join(EXTENSIONS)} are read.")
    paths.sort()
    names = _names([os.path.splitext(path) for path in paths])
    return sorted((FileAsset(name, os.path.join(folder, path)) for name, path in zip(names, paths)),
                  key=lambda asset: asset.name)


def of_collection(collection):
    """The assets of a collection, by name: each object that hangs on no other of it, with what hangs on it. Errors:
    StippleError where it has none that can be rendered, or one in Edit Mode."""
    members, shown = set(collection.all_objects), _shown_of(collection)
    tops = {}
    for obj in shown:
        tops.setdefault(_top(obj, members), []).append(obj)
    groups = [(top.name, tuple(group)) for top, group in tops.items() if any(map(adapting.can_render, group))]
    if not groups:
        raise invalid(f"Collection '{collection.name}' has nothing that can be rendered; meshes that are shown in "
                      'renders are needed.')
    for obj in shown:
        if obj.mode == 'EDIT':
            raise invalid(f"'{obj.name}' is in Edit Mode; go to Object Mode first, so that its new shape is seen.")
    names = _names([(name, '') for name, _ in groups])
    return sorted((ObjectAsset(name, group) for name, (_, group) in zip(names, groups)), key=lambda asset: asset.name)


def _names(parts):
    """A name for a folder of each (path, extension), none of them twice, not even where case does not count."""
    plain = ['_'.join(map(_clean, path.replace(os.sep, '/').split('/'))) for path, _ in parts]
    counts = {}
    for name in plain:
        counts[name.casefold()] = counts.get(name.casefold(), 0) + 1
    names, taken = [], set()
    for name, (_, extension) in zip(plain, parts):
        if counts[name.casefold()] > 1 and extension:
            name = f'{name}_{extension[1:]}'
        unique, number = name, 2
        while unique.casefold() in taken:
            unique, number = f'{name}_{number}', number + 1
        taken.add(unique.casefold())
        names.append(unique)
    return names


def _clean(name):
    return bpy.path.clean_name(name).strip('.') or '_'


def _shown_of(collection):
    """Objects of a collection and of those in it that renders show, each once."""
    found = dict.fromkeys(obj for obj in collection.objects if not obj.hide_render)
    for child in collection.children:
        if not child.hide_render:
            found.update(dict.fromkeys(_shown_of(child)))
    return list(found)


def _shown_in(layer_collection):
    """The same of a view layer's collection, without what the layer leaves out."""
    collection = layer_collection.collection
    if layer_collection.exclude or collection.hide_render:
        return []
    found = dict.fromkeys(obj for obj in collection.objects if not obj.hide_render)
    for child in layer_collection.children:
        found.update(dict.fromkeys(_shown_in(child)))
    return list(found)


def _top(obj, among):
    """The object that moves this one, as far as it is among these."""
    top, above = obj, obj.parent
    while above is not None:
        if above in among:
            top = above
        above = above.parent
    return top


def _link(objects, scene):
    for obj in objects:
        if obj.type not in _UNSEEN and not obj.hide_render and obj.name not in scene.collection.objects:
            scene.collection.objects.link(obj)


def _take_time(scene, other):
    """What is animated is as it is in another scene now."""
    scene.frame_start, scene.frame_end = other.frame_start, other.frame_end
    scene.frame_current, scene.frame_subframe = other.frame_current, other.frame_subframe
    scene.render.fps, scene.render.fps_base = other.render.fps, other.render.fps_base


def _append(path, scene):
    try:
        with bpy.data.libraries.load(path, link=False) as (there, wanted):
            wanted.scenes = there.scenes[:1]
            wanted.objects = [] if there.scenes else there.objects
    except Exception as error:  # Blender names no kinds of errors here
        raise LeftOutError(f'it cannot be read: {_said(error)}') from None
    for appended in wanted.scenes:
        _take_time(scene, appended)
        _link(_shown_in(appended.view_layers[0].layer_collection), scene)
    if not wanted.scenes:
        _link([obj for obj in wanted.objects if obj is not None], scene)


def _import(path, scene):
    full_name = version.MESH_IMPORTERS[os.path.splitext(path)[1].lower()]
    category, name = full_name.split('.')
    operator = getattr(getattr(bpy.ops, category), name)
    try:
        operator.get_rna_type()
    except (KeyError, AttributeError):
        raise LeftOutError(f"Blender's importer {full_name} is not enabled") from None
    window = bpy.context.window
    shown = None if window is None else window.scene
    layer = scene.view_layers[0]
    try:
        if window is not None:
            # The active object is that of the window's scene, whatever is overridden: glTF's importer asks for it.
            window.scene = scene
        with version.importing(), bpy.context.temp_override(scene=scene, view_layer=layer, collection=scene.collection,
                                                            layer_collection=layer.layer_collection):
            result = operator(filepath=path)
    except Exception as error:  # importers are anyone's
        raise LeftOutError(f'it cannot be read: {_said(error)}') from None
    finally:
        if window is not None:
            window.scene = shown
    if 'FINISHED' not in result:
        raise LeftOutError("it cannot be read; Blender's messages are in the console")
    imported.show_colours(scene.objects)


def _said(error):
    """The line of an error that says what is wrong: of what Python has raised, the one after the places."""
    lines = [line.rstrip() for line in str(error).splitlines() if line.strip()]
    traced = next((i + 1 for i, line in enumerate(lines) if 'Traceback (most recent call last)' in line), 0)
    line = next((line for line in lines[traced:] if not line.startswith(' ')), type(error).__name__)
    return line.removeprefix('Error: ').rstrip('.')


def _collections():
    for prop in bpy.data.bl_rna.properties:
        if prop.type == 'COLLECTION':
            yield prop.identifier, getattr(bpy.data, prop.identifier)


def _known():
    """What tells all data of the open file apart."""
    return {(kind, data.name, data.library and data.library.filepath) for kind, all_data in _collections()
            for data in all_data}


def _found(keys):
    return [data for kind, all_data in _collections() for data in all_data
            if (kind, data.name, data.library and data.library.filepath) in keys]


def _remove(keys):
    found = _found(keys)
    if found:
        bpy.data.batch_remove(found)
