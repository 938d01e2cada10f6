# SPDX-License-Identifier: GPL-3.0-or-later
"""Sources follow their .blend: saved, saved elsewhere, opened, appended, linked, undone.

Most of it Blender does by itself (source_paths.py). Left are: sources in the cache folder, which are copied beside the
.blend when it is saved; files of versions that kept the path as text alone; undo, which brings back paths from before
the file was saved elsewhere; and saying which sources are missing.
"""

import os

import bpy
from bpy.app.handlers import persistent

from ... import late, log
from ...binding.errors import StippleError
from .. import handlers
from . import decoded, setting_paths, source_files, source_packing, source_paths, sources, splat_data, sync

# told: whether this Blender tells the path before it saves. before: the path until then.
# homes: folders where this file was in this session. changed: [(Image, its path before the save)].
_state = {'told': False, 'before': '', 'homes': [], 'changed': [], 'again': False, 'known': (0, 0)}
_said = set()  # what is missing, by datablock and path


def collectable(outside):
    """[(Image, path, is_sequence)] of this file's sources that lie where outside(path) is true, each once."""
    found = {}
    for data in source_paths.splat_datablocks():
        file = data.stipple.source_file
        if file is not None and source_paths.is_own(file) and file.name not in found:
            path = source_paths.file_of(data)
            if outside(path):
                found[file.name] = (file, path, data.stipple.is_sequence)
    return list(found.values())


def point_at(file, path):
    """An Image holds the path of a copy of its file from now on."""
    old = os.path.normpath(bpy.path.abspath(file.filepath))
    file.filepath = source_paths.stored(path)
    if os.path.exists(old):
        decoded.follow(old, path)


def follow_texts():
    """The texts say what the Images hold; splats of earlier versions get an Image."""
    setting_paths.follow()
    for data in source_paths.splat_datablocks():
        stipple = data.stipple
        if not source_paths.is_own(data):
            continue
        file = stipple.source_file
        if file is None:
            _adopt(data)
        elif not source_paths.is_own(file):  # the splats were made local
            stipple.source = source_paths.stored(source_paths.file_of(data))
        elif stipple.source != file.filepath:
            stipple.source = file.filepath
        else:
            source_paths.note(stipple)  # a series of a version that had it packed in part


def say_missing():
    """Says each missing source once."""
    found = list(source_paths.splat_datablocks())
    if not found or sources.library_problem():
        return  # the panels say what is wrong with the library, and more is missing than files
    for data in found:
        path = source_paths.file_of(data)
        if (data.name_full, path) not in _said and sources.state(data) == 'MISSING':
            _said.add((data.name_full, path))
            log.warning("The source '%s' of '%s' is missing; choose Relink in its data, or File > External Data > Find "
                        'Missing Files.', path, data.name_full)


def _adopt(data):
    """A datablock of a version that kept the path as text. Appended, the text still starts from its library's folder,
    which is looked for."""
    stipple, before = data.stipple, data.stipple.source
    source_paths.note(stipple)
    libraries = [os.path.dirname(bpy.path.abspath(library.filepath)) for library in bpy.data.libraries]
    _find(data, _state['homes'] + libraries)
    written = data.get(sync.WRITTEN_KEY, '')
    if written.startswith(before + '|'):
        data[sync.WRITTEN_KEY] = source_paths.identity(stipple) + written[len(before):]
    if data.get(splat_data.SEEN_SOURCE_KEY) == before:
        data[splat_data.SEEN_SOURCE_KEY] = source_paths.identity(stipple)


def _find(data, folders):
    """Looks for a source that is not there, or is another one there, from other folders."""
    file = data.stipple.source_file
    if not source_paths.is_own(file) or not file.filepath.startswith('//') or _fits(data, source_paths.file_of(data)):
        return
    for folder in folders:
        path = os.path.normpath(bpy.path.abspath(file.filepath, start=folder))
        if _fits(data, path):
            file.filepath = source_paths.stored(path)
            return


def _fits(data, path):
    stipple = data.stipple
    if stipple.is_sequence or not stipple.source_stamp:
        return os.path.exists(path)
    return sources.stamp(path) == stipple.source_stamp


def _bring_home(folder):
    """Copies sources from the cache folder to a .blend's; returns [(Image, its path before)]. What cannot be copied
    stays where it is, with one message."""
    changed = []
    cache = source_paths.cache_folder()

    def is_cached(path):
        return (source_paths.is_under(path, cache) and os.path.exists(path)
                and not source_paths.is_under(path, os.path.dirname(folder)))

    for file, path, is_sequence in collectable(is_cached):
        try:
            copy = source_files.copy(source_files.of(path, is_sequence), folder)
        except StippleError as error:
            log.error('%s The source stays where it is.', error)
            continue
        changed.append((file.name, file.filepath))
        point_at(file, copy)
    return changed


@persistent
def _save_pre(*arguments):
    if _state['again']:
        return
    path = next((argument for argument in arguments if isinstance(argument, str)), '')
    _state['told'], _state['before'] = bool(path), bpy.data.filepath
    if bpy.data.filepath:
        home = os.path.dirname(bpy.data.filepath)
        _state['homes'] = [home] + [other for other in _state['homes'] if other != home]
    _state['changed'] = _bring_home(source_paths.folder_beside(path)) if path else []
    follow_texts()
    source_packing.complete()


@persistent
def _save_post(*arguments):
    if _state['again']:
        return
    changed, _state['changed'] = _state['changed'], []
    if _state['told']:
        path = next((argument for argument in arguments if isinstance(argument, str)), bpy.data.filepath)
        if path != bpy.data.filepath:  # a copy: this file keeps its own
            for name, before in changed:
                bpy.data.images[name, None].filepath = before
    elif bpy.data.filepath != _state['before']:
        # Blender 3.4 tells save_pre nothing, so that what is beside the file is known only now. To write a path beside
        # an unknown place before would spare the second writing, and lose data: Save Copy and Save Startup File
        # look the same to save_pre, and of a save that fails nobody hears at all (there is no save_post_fail). Their
        # files, or the one that is open, would name sources that are not there.
        if _bring_home(source_paths.folder_beside(bpy.data.filepath)):
            _save_again()
    follow_texts()


def _save_again():
    """Writes the file once more as it was written, without making a backup of the first."""
    preferences = bpy.context.preferences
    kept, was_dirty = preferences.filepaths.save_version, preferences.is_dirty
    with open(bpy.data.filepath, 'rb') as file:
        is_compressed = not file.read(7).startswith(b'BLENDER')
    _state['again'] = True
    preferences.filepaths.save_version = 0
    try:
        bpy.ops.wm.save_mainfile(compress=is_compressed)
    except RuntimeError as error:
        log.error('Sources were copied beside the file, but it could not be saved again: %s', str(error).strip())
    finally:
        preferences.filepaths.save_version = kept
        preferences.is_dirty = was_dirty
        _state['again'] = False


@persistent
def _save_post_fail(*_):
    """Nothing was saved: the sources stay where they were."""
    changed, _state['changed'] = _state['changed'], []
    for name, before in changed:
        bpy.data.images[name, None].filepath = before
    follow_texts()


@persistent
def _loaded(*_):
    source_paths.forget()
    if late.is_loaded(source_packing):
        source_packing.forget()
    _said.clear()
    _state['homes'] = []
    _imported()


@persistent
def _undone(*_):
    """Blender does not know that the file has moved since: paths that start from its folder did so before."""
    for data in source_paths.splat_datablocks():
        if data.stipple.source_file is not None:
            _find(data, _state['homes'])
    setting_paths.find(_state['homes'])
    follow_texts()


@persistent
def _imported(*_):
    _state['known'] = _counts()
    follow_texts()
    say_missing()


@persistent
def _depsgraph_update_post(_scene, depsgraph):
    """Earlier Blenders do not tell that something was appended or linked."""
    if depsgraph.mode == 'VIEWPORT' and _counts() != _state['known']:
        _imported()


def _counts():
    return len(bpy.data.meshes), len(bpy.data.pointclouds)


def _table():
    table = (('save_pre', _save_pre), ('save_post', _save_post), ('save_post_fail', _save_post_fail),
             ('load_post', _loaded), ('undo_post', _undone), ('redo_post', _undone), ('blend_import_post', _imported),
             ('depsgraph_update_post', _depsgraph_update_post))
    return tuple(entry for entry in table if hasattr(bpy.app.handlers, entry[0]))


def register():
    handlers.add(_table())


def unregister():
    handlers.remove(_table())
    source_paths.forget()
    _said.clear()
