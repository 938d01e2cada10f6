# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the files of sources lie: every rule about their paths, and nothing else makes one.

Blender remaps the paths of its own datablocks when a file is saved elsewhere, saved as a copy, appended or linked, and
*File > External Data* packs, unpacks, reports and finds their files. Text properties get none of that. So a splat
datablock points at an Image that holds the path and is never read as an image. Its name starts with a dot, which keeps
it out of lists. (A Volume would not do: Blender makes objects of Volumes that are appended.) `stipple.source` is the
same path as text, for scripts and for files without such an Image.
"""

import os
import re

import bpy

from ... import late, log, preferences, version
from . import source_settings

shutil = late.module('shutil')

MODEL_SUFFIX = '.stipple.safetensors'
FOLDER = 'stipple'  # beside the .blend
_MARK = 'stipple_source'  # a property of Images that hold a path
_LONGEST_NAME = 60
# What Blender takes an Image for. It remaps the paths of both; a movie it does not pack.
FILE, WHOLE = 'FILE', 'MOVIE'

_unpacked = {}  # what tells a packed file from others → where it lies as a file


def absolute(path, owner=None):
    """A path as the system wants it. owner: the datablock that has it as a text, where that may be of a library."""
    return os.path.normpath(bpy.path.abspath(path, library=_library_of(owner, path)))


def of(data):
    """The path of a datablock's source as it is stored, '' for none."""
    file = data.stipple.source_file
    return data.stipple.source if file is None else file.filepath


def identity(stipple):
    """A text that is equal for equal sources, wherever they lie."""
    return stipple.source_stamp or stipple.source


def file_of(data):
    """Where the source of a datablock lies now; a packed one that is not there is unpacked for this session."""
    data = data.original
    file = data.stipple.source_file
    if file is None:
        return absolute(data.stipple.source, data)
    owner = file.override_library.reference if file.override_library is not None else file
    path = os.path.normpath(bpy.path.abspath(file.filepath, library=owner.library))
    if file.packed_file is None or not is_alone(path) or os.path.exists(path):
        return path
    return _unpack(packed_files(data), path)


def packed_files(data):
    """The packed Images of a datablock's source, the first file's first: all those of a packed series."""
    first = data.stipple.source_file
    others = [entry.file for entry in data.stipple.series_files] if data.stipple.is_sequence else []
    return [file for file in dict.fromkeys([first, *others]) if file is not None and file.packed_file is not None]


def packed_images():
    """{absolute path: packed Image of this file that holds one of our files}."""
    return {os.path.normpath(bpy.path.abspath(file.filepath)): file for file in bpy.data.images
            if is_own(file) and file.get(_MARK) and file.packed_file is not None}


def is_alone(path):
    """Whether a source is one file; others name more files beside them."""
    return not path.lower().endswith('.json')


def stored(path):
    """A path as it is stored: relative to the .blend where that is saved, on the same root, and wanted."""
    if not bpy.data.filepath or not bpy.context.preferences.filepaths.use_relative_paths:
        return path
    try:
        return bpy.path.relpath(path)
    except ValueError:  # another drive
        return path


def note(stipple, _context=None):
    """Update function of `source`: the Image follows the text."""
    file = stipple.source_file
    kind = WHOLE if stipple.is_sequence else FILE
    if not stipple.source:
        stipple.source_file = None
    elif (file is None or file.filepath != stipple.source or is_own(stipple.id_data) and not is_own(file)
          or is_own(file) and file.source != kind and file.packed_file is None):
        if file is None or not is_own(file) or file.users > 1 or file.packed_file is not None:
            file = image_of(stipple.source, kind)
        file.source, file.filepath = kind, stipple.source
        stipple.source_file = file


def is_own(datablock):
    """Whether a datablock is of this file alone, so that its path may be written."""
    return datablock.library is None and datablock.override_library is None


def place_for(name, given=''):
    """Where the source of a new splat object goes: the given path, beside the saved file, else the cache folder."""
    if given:
        return absolute(given)
    folder = folder_beside(bpy.data.filepath) if bpy.data.filepath else cache_folder()
    return os.path.join(folder, re.sub(r'[^\w.\- ]', '_', name) + MODEL_SUFFIX)


def folder_beside(blend):
    """Where sources of a .blend go."""
    return os.path.join(os.path.dirname(blend), FOLDER)


def cache_folder():
    """Where sources go until their .blend is saved."""
    chosen = preferences.get()
    if chosen is not None and chosen.cache_folder:
        return bpy.path.abspath(chosen.cache_folder)
    return version.user_folder()


def is_under(path, folder):
    """Whether a path lies somewhere in a folder."""
    path, folder = os.path.realpath(path), os.path.realpath(folder)
    return path.startswith(os.path.join(folder, ''))


def splat_datablocks():
    """All splat datablocks that have a source, linked ones too."""
    for collection in (bpy.data.meshes, bpy.data.pointclouds):
        for data in collection:
            if data.stipple.source and source_settings.of(data.stipple).has_source:
                yield data


def image_of(path, kind):
    """An Image of this file for a path: the one that others with the same path have, else a new one. kind: FILE or
    WHOLE."""
    for file in bpy.data.images:
        if (is_own(file) and file.get(_MARK) and file.filepath == path and file.source == kind
                and file.packed_file is None):
            return file
    return new_image(path, kind)


def new_image(path, kind):
    """An Image that holds a path and is never read as an image."""
    name = bpy.path.basename(path.rstrip('/\\')) or 'folder'
    file = bpy.data.images.new('.' + name[:_LONGEST_NAME], 1, 1)
    file.source = kind
    file.filepath = path
    file[_MARK] = True
    return file


def forget():
    """Files that were unpacked belong to the .blend before."""
    _unpacked.clear()


def _library_of(owner, path):
    """The library whose folder a text path of a datablock starts from, or None."""
    if owner is None:
        return None
    override = owner.override_library
    if override is not None and override.reference.stipple.source == path:
        return override.reference.library  # a path that the override has not changed is still the library's
    return owner.library


def _unpack(files, path):
    """Packed files in a folder of this session: the path of the first there; where that cannot be written, the path
    that it is missing from."""
    key = tuple((file.name_full, file.filepath, file.packed_file.size) for file in files)
    known = _unpacked.get(key)
    if known is None or not os.path.exists(known):
        folder = os.path.join(bpy.app.tempdir, FOLDER, str(len(_unpacked)))
        known = os.path.join(folder, os.path.basename(path))
        try:
            os.makedirs(folder, exist_ok=True)
            for file in files:
                with open(os.path.join(folder, bpy.path.basename(file.filepath)), 'wb') as unpacked:
                    unpacked.write(file.packed_file.data)
        except OSError as error:
            log.error("The packed source '%s' cannot be unpacked into '%s': %s", files[0].name, folder, error.strerror)
            shutil.rmtree(folder, ignore_errors=True)
            known = path
        _unpacked[key] = known
    return known
