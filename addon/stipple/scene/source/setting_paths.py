# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths among a scene's settings go with the .blend as those of sources do (source_paths.py): an Image holds each.

Blender does not pack these: they name a folder of photographs, and files that a fit writes.
"""

import os

import bpy

from . import source_paths

_NAMES = ('dataset', 'report', 'checkpoint')  # of the settings of a fit

def file_name(name):
    """Name of the property with the Image of a path."""
    return name + '_file'


def noting(name):
    """Update function of a path: its Image follows the text."""
    return lambda settings, _context: _note(settings, name)


def absolute(settings, name):
    """A path as the system wants it, '' for none."""
    file = getattr(settings, file_name(name))
    path, owner = (getattr(settings, name), settings.id_data) if file is None else (file.filepath, file)
    return os.path.normpath(bpy.path.abspath(path, library=owner.library)) if path else ''


def follow():
    """The texts say what the Images hold; settings of earlier versions get their Images."""
    for settings, name in _all():
        path, file = getattr(settings, name), getattr(settings, file_name(name))
        if file is None:
            _note(settings, name)
        elif not source_paths.is_own(file):  # the scene was made local
            setattr(settings, name, source_paths.stored(absolute(settings, name)))
        elif path != file.filepath:
            setattr(settings, name, file.filepath)


def find(folders):
    """Looks from other folders for what is not there, where this .blend was when the paths were written."""
    for settings, name in _all():
        file = getattr(settings, file_name(name))
        if file is None or not source_paths.is_own(file) or not file.filepath.startswith('//'):
            continue
        here = absolute(settings, name)
        places = (os.path.normpath(bpy.path.abspath(file.filepath, start=folder)) for folder in folders)
        found = here if os.path.exists(here) else next(filter(os.path.exists, places), here)
        if found != here:
            file.filepath = source_paths.stored(found)


def _all():
    """(settings, name) of every path of this file."""
    for scene in bpy.data.scenes:
        if source_paths.is_own(scene):
            for name in _NAMES:
                yield scene.stipple.fit, name


def _note(settings, name):
    path, file = getattr(settings, name), getattr(settings, file_name(name))
    if not path:
        setattr(settings, file_name(name), None)
    elif file is None or file.filepath != path or not source_paths.is_own(file):
        setattr(settings, file_name(name), source_paths.image_of(path, source_paths.WHOLE))
