# SPDX-License-Identifier: GPL-3.0-or-later
"""What an operator draws over the 3D views until it ends."""

import bpy


class Marks:
    """Base of all such marks: _draw() is called for each 3D view, in pixels, until close()."""

    def __init__(self):
        self._handle = bpy.types.SpaceView3D.draw_handler_add(self._draw, (), 'WINDOW', 'POST_PIXEL')

    @staticmethod
    def redraw():
        for window in bpy.context.window_manager.windows:
            for area in window.screen.areas:
                if area.type == 'VIEW_3D':
                    area.tag_redraw()

    def close(self):
        if self._handle is not None:
            bpy.types.SpaceView3D.draw_handler_remove(self._handle, 'WINDOW')
            self._handle = None
            self.redraw()

    def _draw(self):
        raise NotImplementedError
