# SPDX-License-Identifier: GPL-3.0-or-later
"""The file browser of an operator that asks for a file, in a Blender with a window."""

import bpy


def find():
    """(window, area), or None."""
    return next(((window, area) for window in bpy.context.window_manager.windows for area in window.screen.areas
                 if area.type == 'FILE_BROWSER'), None)


def point_at(path):
    """Enters a file (Path). False where no browser is open yet."""
    found = find()
    params = None if found is None else found[1].spaces.active.params
    if params is None:
        return False
    params.directory, params.filename = str(path.parent).encode(), path.name
    return True


def accept():
    window, area = find()
    region = next(region for region in area.regions if region.type == 'WINDOW')
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.file.execute()
