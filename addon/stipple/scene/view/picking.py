# SPDX-License-Identifier: GPL-3.0-or-later
"""Points on splats, clicked in a 3D view."""

import numpy as np

from ... import binding
from ...binding.errors import StippleError, invalid
from .. import instances
from ..source import sources
from . import cameras


_SOLID = 0.5  # opacity from which on something is there


class PointOperator:
    """Mix-in for operators with `points` (flat coordinates), `point_count` and `use_points`: a click for each point.

    marks_of(picked) gives what shows the clicked points (viewport/picked_points.py). Called from a script, the points
    are given and nothing is clicked.
    """

    _picked = None
    _marks = None

    def invoke(self, context, _event):
        if not self.use_points or self.properties.is_property_set('points'):
            return self.execute(context)
        self._picked = []
        self._marks = self.marks_of(self._picked)
        context.window_manager.modal_handler_add(self)
        context.window.cursor_modal_set('CROSSHAIR')
        self._say(context)
        return {'RUNNING_MODAL'}

    def modal(self, context, event):
        if event.type in {'ESC', 'RIGHTMOUSE'}:
            return self._leave(context, {'CANCELLED'})
        if event.type != 'LEFTMOUSE' or event.value != 'PRESS':
            return {'PASS_THROUGH'}
        view = view_under(context, event)
        if view is None:
            return {'PASS_THROUGH'}
        try:
            self._picked.extend(point_at(context.evaluated_depsgraph_get(), *view))
        except StippleError as error:
            self.report({'WARNING'}, str(error))
            return {'RUNNING_MODAL'}
        self._marks.redraw()
        if len(self._picked) < 3 * self.point_count:
            self._say(context)
            return {'RUNNING_MODAL'}
        self.points = self._picked
        self._leave(context, None)
        return self.execute(context)

    def _say(self, context):
        number = len(self._picked) // 3 + 1
        context.workspace.status_text_set(f'{self.bl_label}: click point {number} of {self.point_count} on the splats '
                                          '(Esc cancels)')

    def cancel(self, context):
        """Blender itself ends the operator, for instance when the window closes."""
        if self._picked is not None:
            self._leave(context, None)
        super().cancel(context)

    def _leave(self, context, result):
        self._marks.close()
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)
        return result


def view_under(context, event):
    """(region, region data, x, y) of the 3D view under the mouse, pixels from its bottom left, or None."""
    for area in context.screen.areas:
        if area.type != 'VIEW_3D':
            continue
        for region in area.regions:
            x, y = event.mouse_x - region.x, event.mouse_y - region.y
            if region.type == 'WINDOW' and 0 <= x < region.width and 0 <= y < region.height:
                return region, data_of(region, area.spaces.active), x, y
    return None


def data_of(region, space):
    """What a region of a 3D view sees by: in Quad View each has its own."""
    return region.data if len(space.region_quadviews) else space.region_3d


def point_at(depsgraph, region, region_data, x, y):
    """The point [3] of the world where the splats under a pixel become more than half opaque.

    Errors: StippleError where there are none.
    """
    camera = cameras.from_view(region_data, region.width, region.height)
    return point_of_pixel(instances.gather(depsgraph, 'VIEWPORT'), camera, x + 0.5, region.height - y - 0.5)


def point_of_pixel(placed, camera, x, y):
    """The same for instances of instances.gather and a place in a camera's image, pixels from its top left."""
    _see_pixel(camera, x, y)
    renderer = binding.renderer.Renderer(sources.context())
    task = renderer.start(placed, camera, renderer.options(), median_depth=True)
    task.job.wait()
    depth = float(task.depth[0, 0])
    if depth >= binding.renderer.EMPTY_DEPTH:
        raise _nothing_there()
    scale = depth if camera.model == 0 else 1.0
    seen = np.array([(0.5 - camera.cx) / camera.fx * scale, (0.5 - camera.cy) / camera.fy * scale, depth, 1.0])
    return (np.linalg.inv(np.array(camera.world_to_camera).reshape(4, 4)) @ seen)[:3].tolist()


def colour_of_pixel(placed, camera, x, y):
    """The linear colour [3] of instances at such a place, of their harmonics of degree 0 alone. Errors: StippleError
    where nothing solid is."""
    _see_pixel(camera, x, y)
    renderer = binding.renderer.Renderer(sources.context())
    options = renderer.options()
    options.sh_degree_limit = 0
    task = renderer.start(placed, camera, options, with_depth=False)
    task.job.wait()
    pixel = task.colour[0, 0].astype(np.float64)
    if pixel[3] < _SOLID:
        raise _nothing_there()
    return (pixel[:3] / pixel[3]).tolist()


def _see_pixel(camera, x, y):
    """The camera sees the pixel around a place of its image alone."""
    camera.cx, camera.cy, camera.width, camera.height = camera.cx - x + 0.5, camera.cy - y + 0.5, 1, 1


def _nothing_there():
    return invalid('There are no solid splats under the mouse; click where the surface is.')
