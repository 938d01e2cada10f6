# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawing in the 3D view, the door to it.

Under Solid, Material Preview and the Rendered shading of other engines splats are drawn over Blender's
image as sorted ellipses; in Wireframe, and above a number of splats that the user sets, as coloured
points. From Blender 5.3 on splats are data that Blender draws by itself. The engine Stipple shows a
ViewImage instead.
"""

import bpy
from bpy.app.handlers import persistent

from .. import log, preferences, version
from ..binding.errors import StippleError
from ..scene import overlays
from ..scene.source import sources, sync
from ..scene.view import viewed

POLL_SECONDS = 0.01
# 3D views that keep their order of splats; more than a screen usually has.
MAX_VIEWS = 8

_state = {'handler': None, 'legend_handler': None, 'drawing': None}


class _Drawing:
    """What the graphics card holds for all 3D views."""

    def __init__(self):
        # Imported here: background Blender may have no graphics at all.
        from . import splat_points, view_ellipses
        self._ellipses = view_ellipses
        self._points = splat_points.SplatPoints()
        self._scene = viewed.ViewedScene()
        self._shaders = None
        self._shaders_failed = False
        self._views = {}  # by RegionView3D, the one that was drawn last at the end
        self._overlays = {}  # by RegionView3D, of those that show one

    def draw(self, context, space, region_data):
        depsgraph = context.evaluated_depsgraph_get()
        scene = self._scene.update(depsgraph)
        shown = viewed.shown(scene, space, depsgraph)
        overlay = self._overlay(context, space, region_data, shown, depsgraph)
        if not shown:
            return
        ellipses, points = split(shown, _points_above())
        if space.shading.type == 'WIREFRAME' or self._shaders_failed:
            ellipses, points = [], shown
        if points:
            self._points.draw(points, depsgraph, overlay)
        if ellipses:
            hidden = bool(points) or viewed.hides_splats(scene, space, depsgraph)
            try:
                self._draw_ellipses(context, depsgraph, ellipses, hidden, overlay)
                note_problem('')
            except StippleError as error:
                self._shaders_failed = isinstance(error, self._ellipses.ShaderError)
                note_problem(str(error))
                self._points.draw(ellipses, depsgraph, overlay)

    def _overlay(self, context, space, region_data, shown, depsgraph):
        """What colours the splats of a view, None where they have their own colours."""
        key = region_data.as_pointer()
        if not shown or not overlays.is_on(context.scene, space):
            self._overlays.pop(key, None)
            return None
        while len(self._overlays) >= MAX_VIEWS and key not in self._overlays:
            self._overlays.pop(next(iter(self._overlays)))
        overlay = self._overlays.setdefault(key, overlays.Overlay())
        overlay.update(shown, depsgraph, context.scene)
        return overlay

    def draw_legend(self, context, region, region_data):
        overlay = self._overlays.get(region_data.as_pointer())
        if overlay is not None:
            from . import view_legend
            system = context.preferences.system
            view_legend.draw(overlay.scale, overlays.settings_of(context.scene).kind, region.width, system.ui_scale)

    def _draw_ellipses(self, context, depsgraph, entries, with_depth, overlay):
        if self._shaders is None:
            self._shaders = self._ellipses.Shaders()
        key = context.region_data.as_pointer()
        view = self._views.pop(key, None)
        if view is None:
            view = self._ellipses.ViewEllipses(sources.context())
        self._views[key] = view
        while len(self._views) > MAX_VIEWS:
            self._views.pop(next(iter(self._views))).close()
        if view.draw(self._shaders, context, depsgraph, entries, with_depth, overlay):
            _poll_later()

    def is_sorting(self):
        return any(view.is_sorting() for view in self._views.values())

    def has_new_order(self):
        return any(view.has_new_order() for view in self._views.values())

    def close(self):
        for view in self._views.values():
            view.close()
        self._views.clear()


def split(entries, most):
    """(those drawn as ellipses, those drawn as points): the largest become points until the rest is `most` at most."""
    total = sum(entry.count for entry in entries)
    points = set()
    for entry in sorted(entries, key=lambda e: -e.count):
        if total <= most:
            break
        points.add(entry.key)
        total -= entry.count
    return [e for e in entries if e.key not in points], [e for e in entries if e.key in points]


def note_problem(message):
    """Keeps what is wrong with the graphics for panels, and logs it once; '' for nothing."""
    if message and viewed.state['graphics'] != message:
        log.error('%s', message)
    viewed.state['graphics'] = message


def _points_above():
    chosen = preferences.get()
    return chosen.points_above if chosen is not None else preferences.POINTS_ABOVE


def _draw():
    """Called by Blender for every redraw of every 3D view: raises nothing."""
    context = bpy.context
    space, region_data = context.space_data, context.region_data
    if space is None or region_data is None or viewed.state['off']:
        return
    if space.shading.type == 'RENDERED' and context.engine == sync.ENGINE:
        return
    try:
        if _state['drawing'] is None:
            _state['drawing'] = _Drawing()
        _state['drawing'].draw(context, space, region_data)
    except Exception as error:  # graphics fail in many ways: one message, then nothing is drawn
        log.exception('Splats cannot be drawn in the 3D view')
        note_problem(f'Splats cannot be drawn in the 3D view: {error}.')
        viewed.state['off'] = True


def _draw_legend():
    """The same, after the splats, in pixels."""
    context = bpy.context
    drawing, region_data = _state['drawing'], context.region_data
    if drawing is None or region_data is None or viewed.state['off']:
        return
    if context.space_data.shading.type == 'RENDERED' and context.engine == sync.ENGINE:
        return
    try:
        drawing.draw_legend(context, context.region, region_data)
    except Exception as error:
        log.exception('The legend of the overlay cannot be drawn')
        note_problem(f'The legend of the overlay cannot be drawn: {error}.')
        viewed.state['off'] = True


def _poll_later():
    if not bpy.app.timers.is_registered(_poll):
        bpy.app.timers.register(_poll, first_interval=POLL_SECONDS)


def _poll():
    """Redraws when a view's new order is there. A timer's function: it returns when to be called again."""
    drawing = _state['drawing']
    if drawing is None:
        return None
    if drawing.has_new_order():
        for window in bpy.context.window_manager.windows:
            for area in window.screen.areas:
                if area.type == 'VIEW_3D':
                    area.tag_redraw()
    return POLL_SECONDS if drawing.is_sorting() else None


@persistent
def _forget(*_):
    """Another file: its views have other splats, and graphics that failed may work again."""
    if _state['drawing'] is not None:
        _state['drawing'].close()
        _state['drawing'] = None
    viewed.state.update(graphics='', off=False)


def register():
    viewed.register()
    if bpy.app.background or version.HAS_NATIVE_SPLATS:
        return
    _state['handler'] = bpy.types.SpaceView3D.draw_handler_add(_draw, (), 'WINDOW', 'POST_VIEW')
    _state['legend_handler'] = bpy.types.SpaceView3D.draw_handler_add(_draw_legend, (), 'WINDOW', 'POST_PIXEL')
    bpy.app.handlers.load_pre.append(_forget)


def unregister():
    viewed.unregister()
    if _state['handler'] is not None:
        for name in ('handler', 'legend_handler'):
            bpy.types.SpaceView3D.draw_handler_remove(_state[name], 'WINDOW')
            _state[name] = None
        bpy.app.handlers.load_pre.remove(_forget)
    if bpy.app.timers.is_registered(_poll):
        bpy.app.timers.unregister(_poll)
    _forget()
