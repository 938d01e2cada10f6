# SPDX-License-Identifier: GPL-3.0-or-later
"""Prepares the first stroke while a tool that selects splats is active and the view rests.

Sources are read in a thread, and with Front Only the depths of the view are drawn by a job, so that the first stroke
answers like any other.
"""

import time

import bpy
from bpy.app.handlers import persistent

from .. import selection_tools
from ..binding.errors import StippleError
from ..scene import selection_settings
from ..scene.source import edits, selecting, sync
from ..scene.view import drawn_regions, picking

REST_SECONDS = 0.1
POLL_SECONDS = 0.05
# Tools whose strokes may be limited to the front.
_FRONT_TOOLS = {'stipple.select_brush', 'stipple.select_lasso'}

_state = {'handler': None, 'view': None, 'seen': None, 'since': 0.0, 'done': None}


def prepare(context, region, region_data, space, front):
    """Begins what strokes over the selected splat objects need in a view. front: _front_of(). Returns whether all is at
    hand. Errors: StippleError."""
    objects = edits.selected_splats(context)
    is_ready = selecting.prepare(objects)
    front_only, through_meshes = front
    if front_only and objects:
        camera = drawn_regions.camera_of(region_data.view_matrix, region_data.window_matrix,
                                         (region.width, region.height))
        task = drawn_regions.start_front(context.evaluated_depsgraph_get(), camera, space, through_meshes)
        is_ready = not task.is_running() and is_ready
    return is_ready


def _front_of(context, tool):
    """(whether strokes are limited to the front, whether meshes hide nothing of it)"""
    settings = selection_settings.of(context.scene)
    return settings.front_only and tool in _FRONT_TOOLS, settings.through_meshes


def _draw():
    """Called by Blender for every redraw of every 3D view: notes what it shows, and does nothing else."""
    context = bpy.context
    if context.mode != 'OBJECT' or context.workspace is None or context.region_data is None:
        return
    tool = context.workspace.tools.from_space_view3d_mode('OBJECT', create=False)
    if tool is None or tool.idname not in dict(selection_tools.NAMES):
        return
    names = tuple((obj.data.name_full, obj.data.get(sync.WRITTEN_KEY)) for obj in edits.selected_splats(context))
    seen = (context.region.as_pointer(), context.region.width, context.region.height, _front_of(context, tool.idname), names,
            tuple(value for row in context.region_data.perspective_matrix for value in row))
    if seen == _state['seen'] or not names:
        return
    _state.update(seen=seen, since=time.monotonic(), view=(context.window, context.area, context.region))
    if not bpy.app.timers.is_registered(_tend):
        bpy.app.timers.register(_tend, first_interval=REST_SECONDS)


def _tend():
    """Prepares when the view has rested. A timer's function: it returns when to be called again."""
    if _state['seen'] is None or _state['done'] == _state['seen']:
        return None
    left = REST_SECONDS - (time.monotonic() - _state['since'])
    if left > 0:
        return left
    try:
        window, area, region = _state['view']
        with bpy.context.temp_override(window=window, area=area, region=region):
            space = area.spaces.active
            if not prepare(bpy.context, region, picking.data_of(region, space), space, _state['seen'][3]):
                return POLL_SECONDS  # a file is being read
    except (StippleError, ReferenceError, TypeError, AttributeError):
        pass  # the stroke itself says what is wrong; the area may be gone
    _state['done'] = _state['seen']
    return None


@persistent
def _forget(*_):
    """Another file: its areas are others."""
    _state.update(view=None, seen=None, done=None)


def register():
    if bpy.app.background:
        return
    bpy.app.handlers.load_pre.append(_forget)
    _state['handler'] = bpy.types.SpaceView3D.draw_handler_add(_draw, (), 'WINDOW', 'POST_VIEW')


def unregister():
    if _state['handler'] is None:
        return
    bpy.types.SpaceView3D.draw_handler_remove(_state['handler'], 'WINDOW')
    _state['handler'] = None
    bpy.app.handlers.load_pre.remove(_forget)
    if bpy.app.timers.is_registered(_tend):
        bpy.app.timers.unregister(_tend)
    _forget()
