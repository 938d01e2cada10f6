# SPDX-License-Identifier: GPL-3.0-or-later
"""What all operators that select splats have: which splats, which operation, and for those that are drawn, where.

A drawn operator follows the mouse until the button is released and executes once then: one undo step. Scripts give the
same properties and execute at once, in background too.
"""

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, FloatVectorProperty, IntVectorProperty

from ... import binding
from ...binding.errors import StippleError, invalid
from ...jobs import JobOperator
from ...scene import selection_settings
from ...scene.source import edits, selecting
from ...scene.view import cameras, drawn_regions, picking
from ...viewport import selected_points, stroke_marks
from .stroke_preview import StrokePreview

_KEYS_OF_RADIUS = {'WHEELUPMOUSE': 1.1, 'WHEELDOWNMOUSE': 1 / 1.1, 'RIGHT_BRACKET': 1.1, 'LEFT_BRACKET': 1 / 1.1}


class SelectOperator(JobOperator):
    """Mix-in: changes the selections of the selected splat objects by regions_of(obj)."""

    @classmethod
    def poll(cls, context):
        return context.mode == 'OBJECT' and bool(edits.selected_splats(context))

    def start(self, context):
        targets = selecting.targets(context, edits.selected_splats(context))
        self._outcome = selecting.select(targets, self.regions_of)
        return None

    def finish(self, context, _job):
        redraw(context)
        self.report({'INFO'}, str(self._outcome))


class OperationOperator(SelectOperator):
    """The same with a choice of operations; the keys that are held when the mouse starts decide over the setting."""

    operation: EnumProperty(name="Operation", description="What becomes of the selection before",
                            items=selection_settings.OPERATIONS)

    def chosen_operation(self):
        return binding.regions.RegionOperation[self.operation]

    def take_operation(self, context, event):
        if self.properties.is_property_set('operation'):
            return
        if event.shift and event.ctrl:
            self.operation = 'INTERSECT'
        elif event.shift:
            self.operation = 'ADD'
        elif event.ctrl:
            self.operation = 'SUBTRACT'
        else:
            self.operation = selection_settings.of(context.scene).operation


class DrawnOperator(OperationOperator):
    """The same, drawn in a 3D view."""

    view_matrix: FloatVectorProperty(size=16, options={'HIDDEN', 'SKIP_SAVE'})
    projection_matrix: FloatVectorProperty(size=16, options={'HIDDEN', 'SKIP_SAVE'})
    region_size: IntVectorProperty(size=2, options={'HIDDEN', 'SKIP_SAVE'})

    shape = ''       # of StrokeMarks
    _marks = None
    _preview = None
    _is_drawing = False

    def invoke(self, context, event):
        view = picking.view_under(context, event)
        if view is None and event.type == 'LEFTMOUSE':
            return {'PASS_THROUGH'}
        self._region, self._region_data = (None, None) if view is None else view[:2]
        self.take_settings(context)
        self._marks = stroke_marks.StrokeMarks(self.shape, self.mark_radius(context))
        if event.type == 'LEFTMOUSE' and event.value in {'PRESS', 'CLICK_DRAG'}:
            if not self._press(context, event):
                self._leave(context)
                return {'CANCELLED'}
        elif view is not None:
            self._marks.move(self._region, *view[2:])
        context.window_manager.modal_handler_add(self)
        context.workspace.status_text_set(self.help_text())
        return {'RUNNING_MODAL'}

    def modal(self, context, event):
        if event.type in {'ESC', 'RIGHTMOUSE'}:
            self._leave(context)
            return {'CANCELLED'}
        factor = _KEYS_OF_RADIUS.get(event.type) if event.value == 'PRESS' else None
        if factor is not None and self.scale_radius(context, factor):
            self._marks.radius = self.mark_radius(context)
            self._marks.redraw()
            return {'RUNNING_MODAL'}
        if event.type in {'MOUSEMOVE', 'INBETWEEN_MOUSEMOVE'}:
            self._move(context, event)
            return {'RUNNING_MODAL'}
        if event.type == 'LEFTMOUSE' and event.value == 'PRESS' and not self._is_drawing:
            if picking.view_under(context, event) is None:
                return {'PASS_THROUGH'}
            if not self._press(context, event):
                self._leave(context)
                return {'CANCELLED'}
            return {'RUNNING_MODAL'}
        if event.type == 'LEFTMOUSE' and event.value == 'RELEASE' and self._is_drawing:
            self._move(context, event)
            is_done = self.release(context)
            self._leave(context)
            return self.execute(context) if is_done else {'CANCELLED'}
        # While nothing is drawn, the view can be rotated.
        return {'RUNNING_MODAL'} if self._is_drawing else {'PASS_THROUGH'}

    def cancel(self, context):
        """Blender itself ends the operator, for instance when the window closes."""
        if self._marks is not None:
            self._leave(context)
        super().cancel(context)

    # What the kinds of drawing fill in.

    def take_settings(self, context):
        """Settings of the scene, where the caller gives none."""

    def mark_radius(self, _context):
        return 0.0

    def scale_radius(self, _context, _factor):
        """Whether the radius was changed."""
        return False

    def press(self, context, place):
        """The button goes down at a place of the view, pixels. Errors: StippleError."""

    def drag(self, context, place):
        """The mouse is at another place."""

    def release(self, _context):
        """Whether there is something to execute."""
        return True

    def can_preview(self):
        """Whether it can be told while the mouse moves what would be selected."""
        return False

    def preview_regions(self, obj):
        """What regions_of(obj) would be if the mouse stopped here."""
        return self.regions_of(obj)

    def help_text(self):
        return f'{self.bl_label}: draw on the splats. Shift adds, Ctrl subtracts, both intersect, Esc cancels'

    def camera(self):
        """The camera of the view that was drawn in. Errors: StippleError."""
        return drawn_regions.camera_of(self.view_matrix, self.projection_matrix, self.region_size)

    def _press(self, context, event):
        view = picking.view_under(context, event)
        self._region, self._region_data = view[:2]
        space = next(area.spaces.active for area in context.screen.areas if self._region in tuple(area.regions))
        if cameras.shows_panorama(space, self._region_data, context.engine):
            self.report({'WARNING'}, 'This view shows a panorama, in which nothing can be drawn; leave the camera '
                        '(View > Cameras > Active Camera), or choose another shading.')
            return False
        if not any(self.properties.is_property_set(name) for name in ('view_matrix', 'projection_matrix')):
            self.view_matrix = [value for row in self._region_data.view_matrix for value in row]
            self.projection_matrix = [value for row in self._region_data.window_matrix for value in row]
            self.region_size = self._region.width, self._region.height
        self.take_operation(context, event)
        try:
            self.press(context, self._place(event))
        except StippleError as error:
            self.report({'WARNING'}, str(error))
            return False
        self._is_drawing = True
        self._marks.begin(self._region, self._place(event))
        self._preview = StrokePreview(context, selected_points.show_instead)
        return True

    def _move(self, context, event):
        if self._is_drawing:
            place = self._place(event)
            self.drag(context, place)
            self._marks.radius = self.mark_radius(context)
            self._marks.add(place)
            if event.type == 'MOUSEMOVE' and self.can_preview():
                self._preview.update(self.preview_regions)
            return
        view = picking.view_under(context, event)
        if view is None:
            self._marks.move(None, 0, 0)
        else:
            self._marks.move(view[0], *view[2:])

    def _place(self, event):
        """Of the mouse in the view, pixels from its bottom left corner."""
        return event.mouse_x - self._region.x + 0.5, event.mouse_y - self._region.y + 0.5

    def _leave(self, context):
        self._marks.close()
        self._marks = None
        if self._preview is not None:
            self._preview.close()
            self._preview = None
        context.workspace.status_text_set(None)


class PathOperator(DrawnOperator):
    """The same, along a path."""

    least_points = 1
    path: CollectionProperty(type=bpy.types.OperatorMousePath, options={'HIDDEN', 'SKIP_SAVE'})
    front_only: BoolProperty(name="Front Only", description="Select what is seen, and nothing that lies behind other "
                             "splats and meshes", default=False)
    through_meshes: BoolProperty(name="Through Meshes", description="With Front Only, select what meshes hide, too",
                                 default=False)

    def take_settings(self, context):
        for name in ('front_only', 'through_meshes'):
            if not self.properties.is_property_set(name):
                setattr(self, name, getattr(selection_settings.of(context.scene), name))

    def press(self, context, place):
        self._camera, self._front = self.camera(), None
        # It is drawn while the stroke is.
        self._front_task = self._start_front(context) if self.front_only else None
        self.path.clear()
        self._add(place)

    def drag(self, _context, place):
        self._add(place)

    def can_preview(self):
        if len(self.path) < self.least_points:
            return False
        if self.front_only and self._front is None:
            if self._front_task.is_running():
                return False
            self._front = self._front_task.front()
        return True

    def points(self):
        """[(x, y)] of the path. Errors: StippleError for none."""
        if not len(self.path):
            raise invalid('The stroke has no path; give it at least one place in pixels.')
        return [tuple(entry.loc) for entry in self.path]

    def start(self, context):
        self._camera = self.camera()
        self._front = self._start_front(context).front() if self.front_only else None
        return super().start(context)

    def _start_front(self, context):
        space = context.space_data if context.area is not None and context.area.type == 'VIEW_3D' else None
        return drawn_regions.start_front(context.evaluated_depsgraph_get(), self.camera(), space, self.through_meshes)

    def _add(self, place):
        if len(self.path) == 0 or tuple(self.path[-1].loc) != place:
            entry = self.path.add()
            entry.loc = place


def redraw(context):
    """What is selected is drawn in 3D views, and counted in panels."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {'VIEW_3D', 'PROPERTIES'}:
                area.tag_redraw()
