# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's own panels of meshes that mean nothing for splats are not shown for them.

Before Blender has point clouds for it, splats are a mesh of vertices alone: nine panels about faces, UV maps and shape
keys would stand between the budget and what else splats have.
"""

import bpy

from ..scene.source import splat_data

_NAMES = ('DATA_PT_vertex_groups', 'DATA_PT_shape_keys', 'DATA_PT_uv_texture', 'DATA_PT_vertex_colors',
          'DATA_PT_face_maps', 'DATA_PT_normals', 'DATA_PT_texture_space', 'DATA_PT_remesh', 'DATA_PT_customdata')
_polls = {}  # name of a panel: the poll that it has itself, None where it inherits one


def _hide_for_splats(panel):
    asked = panel.poll

    def poll(_cls, context):
        return not splat_data.is_splat_object(context.object) and asked(context)
    panel.poll = classmethod(poll)


def register():
    for name in _NAMES:
        panel = getattr(bpy.types, name, None)
        if panel is not None and hasattr(panel, 'poll'):
            _polls[name] = panel.__dict__.get('poll')
            _hide_for_splats(panel)


def unregister():
    for name, own in _polls.items():
        panel = getattr(bpy.types, name, None)
        if panel is None:
            continue
        if own is None:
            del panel.poll
        else:
            panel.poll = own
    _polls.clear()


classes = ()
