# SPDX-License-Identifier: GPL-3.0-or-later
"""Third Blender of walk.py: everything of the saved file goes into another one, which is saved and rendered."""

import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
import walk_parts as parts  # noqa: E402


def append(window):
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    path = parts.WAY / 'second' / 'scene.blend'
    with bpy.data.libraries.load(str(path)) as (there, _):
        names = list(there.objects)
    with window.context():
        bpy.ops.wm.append(directory=f'{path}/Object/', files=[{'name': name} for name in names])
    bpy.context.scene.camera = next(obj for obj in bpy.data.objects if obj.type == 'CAMERA')
    bpy.data.objects['Box'].hide_set(True)


def save(_window):
    (parts.WAY / 'third').mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(parts.WAY / 'third' / 'other.blend'))
    parts.note(states=parts.states())
    return 'appended'


facts = parts.facts
steps = [append, save, parts.render_all]
