# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that no image tells of: each seed gives another one."""

from dataclasses import replace

import bpy

from ...scene.generate import image_task
from .generating import GenerateAtCursor


class STIPPLE_OT_random_splats(GenerateAtCursor, bpy.types.Operator):
    """Make splats of an object of the kind that the networks have learned, another one for each seed"""

    bl_idname = 'stipple.random_splats'
    bl_label = "Random Splats from Model"
    bl_options = {'REGISTER', 'UNDO', 'PRESET'}

    has_image = False
    shown_settings = 'steps', 'tokens', 'seed', 'seed_count', 'anchors', 'show_previews'

    def invoke(self, context, _event):
        self._asked = True
        return context.window_manager.invoke_props_dialog(self, width=420)

    def _settings(self, wanted_size):
        return replace(super()._settings(wanted_size), guidance=1.0)  # There is nothing to follow.

    def start(self, context):
        self._location = tuple(context.scene.cursor.location)
        return image_task.ImageTask(None, None, b'random', self._settings(self.size), self.seed_count, self.anchors)

    def draw(self, context):
        self.layout.use_property_split = True
        self.layout.prop(self, 'size')
        self._draw_settings(self.layout, context, width_px=420)

    def _name(self):
        return 'Random Splats'


classes = (STIPPLE_OT_random_splats,)
