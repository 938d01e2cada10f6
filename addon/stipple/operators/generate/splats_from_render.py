# SPDX-License-Identifier: GPL-3.0-or-later
"""The selected objects are rendered, and the image becomes splats that stand where they do."""

import hashlib

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty

from ... import binding
from ...binding import structs
from ...binding.errors import invalid
from ...scene.generate import image_task, placing, selection_view
from ...scene.source import sources
from .generating import GenerateOperator

_ENGINES = (('CYCLES', "Cycles", "Rendered by Cycles"), ('EEVEE', "EEVEE", "Rendered by EEVEE"),
            ('WORKBENCH', "Workbench", "Flat colors and textures, quickly"))
_VIEWS = (('CAMERA', "Scene Camera", "As the scene's camera sees the selected objects"),
          ('FRONT', "Front", "From the front and a little above"))

_WIDTH_PX = 400


class STIPPLE_OT_splats_from_render(GenerateOperator, bpy.types.Operator):
    """Render the selected objects with a transparent film and make splats of the image, in their place. No mask is
    needed"""

    bl_idname = 'stipple.splats_from_render'
    bl_label = "Splats from Render of Selected"
    bl_options = {'REGISTER', 'UNDO', 'PRESET'}

    view: EnumProperty(name="View", description="Where the image is rendered from", items=_VIEWS, default='FRONT')
    engine: EnumProperty(name="Engine", description="What renders the image", items=_ENGINES)
    samples: IntProperty(name="Samples", description="Samples per pixel of the image", default=64, min=1,
                         soft_max=1024)
    hide_source: BoolProperty(name="Hide Source", description="Hide the selected objects in the viewport and in renders",
                              default=True)

    @classmethod
    def poll(cls, context):
        if context.mode != 'OBJECT':
            return False
        if context.view_layer.objects.selected:
            return True
        cls.poll_message_set('No object is selected')
        return False

    def invoke(self, context, _event):
        self._asked = True
        return context.window_manager.invoke_props_dialog(self, width=_WIDTH_PX)

    _asked = False

    def execute(self, context):
        if bpy.app.background or not self._asked:
            return super().execute(context)
        return self.run_in_window(context)

    def start(self, context):
        image_task.require_weights()
        self._objects = list(context.view_layer.objects.selected)
        camera = context.scene.camera if self.view == 'CAMERA' else None
        if self.view == 'CAMERA' and camera is None:
            raise invalid('The scene has no camera; add one, or choose the view Front.')
        seen = selection_view.render(context, self._objects, self.engine, int(self.canvas), self.samples, camera)
        self._bounds, self._viewer = seen.bounds, seen.viewer
        image = binding.image.Image.create(sources.context(), seen.linear, structs.Transfer.LINEAR)
        identity = hashlib.sha256(seen.linear.tobytes()).digest()
        settings = self._settings(placing.largest_side(seen.bounds))
        return image_task.ImageTask(image, None, identity, settings, self.seed_count, self.anchors, self.keep_best)

    def finish(self, context, job):
        super().finish(context, job)
        for obj in self._objects if self.hide_source else ():
            obj.hide_set(True)
            obj.hide_render = True

    def draw(self, context):
        self.layout.use_property_split = True
        for name in ('view', 'engine', 'samples', 'hide_source'):
            self.layout.prop(self, name)
        self._draw_settings(self.layout, context, _WIDTH_PX)

    def _name(self):
        return self._objects[0].name + ' Splats'

    def _matrix(self, index):
        return placing.in_bounds(self._bounds, self._viewer, index)


classes = (STIPPLE_OT_splats_from_render,)
