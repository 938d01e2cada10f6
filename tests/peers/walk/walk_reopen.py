# SPDX-License-Identifier: GPL-3.0-or-later
"""Second Blender of walk.py: the file that was saved elsewhere, after the first folder is gone."""

import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
import walk_parts as parts  # noqa: E402


def open_file(_window):
    bpy.ops.wm.open_mainfile(filepath=str(parts.WAY / 'second' / 'scene.blend'), load_ui=False)


def look(_window):
    parts.note(states=parts.states())
    return 'opened'


facts = parts.facts
steps = [open_file, look, parts.render_all]
