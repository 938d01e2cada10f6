# SPDX-License-Identifier: GPL-3.0-or-later
"""Points over the centres of selected splats, all of the source and not just those that the budget shows; while a stroke
is being drawn, over what it would select."""

import bpy
import gpu
from bpy.app.handlers import persistent
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from .. import late, log, version
from ..binding.errors import StippleError
from ..scene.source import selecting, selections
from ..scene.view import drawn_regions, viewed

# Points that are drawn of one object; more would only hide each other.
MAX_POINTS = 200_000
POINT_SIZE_PX = 3.0

_state = {'handler': None, 'drawing': None, 'off': False}
_instead = {}  # {name of the data: (number, centres)} that are drawn in place of a selection


class _Drawing:
    """The points of objects, kept on the graphics card until their selections change."""

    def __init__(self):
        self._scene = viewed.ViewedScene()
        self._batches = {}  # by the name of the data

    def draw(self, context, space):
        depsgraph = context.evaluated_depsgraph_get()
        entries = [entry for entry in viewed.shown(self._scene.update(depsgraph), space, depsgraph)
                   if not selections.is_empty(entry.obj.data) or entry.obj.data.name_full in _instead]
        used = {entry.obj.data.name_full for entry in entries}
        self._batches = {name: known for name, known in self._batches.items() if name in used}
        shader = gpu.shader.from_builtin(version.UNIFORM_COLOR_SHADER)
        shader.bind()
        shader.uniform_float('color', (*context.preferences.themes[0].view_3d.vertex_select, 1.0))
        gpu.state.depth_test_set('NONE')
        gpu.state.point_size_set(POINT_SIZE_PX * context.preferences.system.ui_scale)
        for entry in entries:
            batch = self._batch_of(entry.obj, shader)
            if batch is not None:
                with gpu.matrix.push_pop():
                    gpu.matrix.multiply_matrix(Matrix(entry.matrix))
                    batch.draw(shader)
        gpu.state.point_size_set(1.0)

    def _batch_of(self, obj, shader):
        known, instead = self._batches.get(obj.data.name_full), _instead.get(obj.data.name_full)
        now = selecting.state(obj.data) if instead is None else instead[0]
        if known is None or known[0] != now:
            places = _positions(obj) if instead is None else instead[1]
            batch = batch_for_shader(shader, 'POINTS', {'pos': places}) if len(places) else None
            known = self._batches[obj.data.name_full] = (now, batch)
        return known[1]


def show_instead(found):
    """Draws {name of the data: centres [n,3] in the object's space} in place of what is selected; {} for that again."""
    _state['number'] = number = _state.get('number', 0) + 1
    _instead.clear()
    _instead.update({name: (('instead', number), places) for name, places in found.items()})


def _positions(obj):
    try:
        return selecting.positions(obj, MAX_POINTS)
    except StippleError:
        return ()  # the source is gone, which the panel says


def _draw():
    """Called by Blender for every redraw of every 3D view: raises nothing."""
    context = bpy.context
    space = context.space_data
    if _state['off'] or space is None or not space.overlay.show_overlays or not (
            _instead or _is_any_selected()):
        return
    try:
        if _state['drawing'] is None:
            _state['drawing'] = _Drawing()
        _state['drawing'].draw(context, space)
    except Exception:  # graphics fail in many ways: one message, then nothing is drawn
        log.exception('Selected splats cannot be drawn in the 3D view')
        _state['off'] = True


def _is_any_selected():
    return any(not selections.is_empty(data) for collection in (bpy.data.meshes, bpy.data.pointclouds)
               for data in collection)


@persistent
def _forget(*_):
    """Another file: what is known of this one goes."""
    _state.update(drawing=None, off=False)
    _instead.clear()
    for module in (selecting, drawn_regions):
        if late.is_loaded(module):
            module.forget()


def register():
    bpy.app.handlers.load_pre.append(_forget)
    if not bpy.app.background:
        _state['handler'] = bpy.types.SpaceView3D.draw_handler_add(_draw, (), 'WINDOW', 'POST_VIEW')


def unregister():
    bpy.app.handlers.load_pre.remove(_forget)
    if _state['handler'] is not None:
        bpy.types.SpaceView3D.draw_handler_remove(_state['handler'], 'WINDOW')
        _state['handler'] = None
    _forget()
