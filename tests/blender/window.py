# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs steps in a Blender with a window and takes pictures of its screen.

    blender --factory-startup --python window.py -- STEPS.py FOLDER SCREEN [arguments of the steps...]

STEPS.py defines `steps`: a list of functions of a Window, called one after the other with a pause for
Blender to draw. A step that returns False is called again: it waits for something. One that returns a
name gets its picture, FOLDER/name.xwd, a copy of SCREEN: the frame
buffer file of `Xvfb -fbdir`, since Blender's own screenshots are black there from 4.0 on. `done` is
written at the end, `failed` with the traceback where a step raises. What the steps have put into a dictionary `facts`,
if STEPS.py defines one, is in FOLDER/facts.json then.
"""

import json
import runpy
import shutil
import sys
import time
import traceback
from pathlib import Path

import bpy

# Between a step and its picture: software OpenGL on a busy machine needs seconds for a window.
STEP_SECONDS = 0.4
# Redraws that a picture waits for.
REDRAWS = 3


class Window:
    """The one 3D view of the window."""

    def __init__(self):
        self.window = bpy.context.window_manager.windows[0]
        self.redraws = 0
        bpy.types.SpaceView3D.draw_handler_add(self._count, (), 'WINDOW', 'POST_PIXEL')

    def _count(self):
        self.redraws += 1

    @property
    def area(self):
        return next(a for a in self.window.screen.areas if a.type == 'VIEW_3D')

    @property
    def space(self):
        return self.area.spaces.active

    @property
    def region(self):
        return next(r for r in self.area.regions if r.type == 'WINDOW')

    @property
    def region_data(self):
        return self.space.region_3d

    def context(self):
        """For operators that need the 3D view."""
        return bpy.context.temp_override(window=self.window, screen=self.window.screen, area=self.area,
                                         region=self.region)

    def redraw(self):
        for area in self.window.screen.areas:
            area.tag_redraw()


def main():
    steps_file, folder, screen = sys.argv[sys.argv.index('--') + 1:][:3]
    folder = Path(folder)
    bpy.context.preferences.view.show_splash = False
    bpy.ops.preferences.addon_enable(module='stipple')
    state = {'step': 0, 'shot': None, 'until': 0, 'facts': {}}

    def finish(name, text=''):
        (folder / name).write_text(text)
        bpy.ops.wm.quit_blender()

    def advance():
        try:
            if 'window' not in state:
                state['window'] = Window()
                defined = runpy.run_path(steps_file)
                state['steps'], state['facts'] = defined['steps'], defined.get('facts', {})
            window = state['window']
            if window.redraws < state['until']:
                window.redraw()
                return STEP_SECONDS
            if state['shot']:
                time.sleep(0.1)  # the driver's own threads finish the picture
                shutil.copy(screen, folder / f"{state['shot']}.xwd")
                state['shot'] = None
            if state['step'] == len(state['steps']):
                (folder / 'facts.json').write_text(json.dumps(state['facts']))
                finish('done')
                return None
            step = state['steps'][state['step']]
            shot = step(window)
            if shot is not False:
                state['step'] += 1
                state['shot'] = shot
            state['until'] = window.redraws + REDRAWS
            window.redraw()
        except Exception:
            finish('failed', traceback.format_exc())
            return None
        return STEP_SECONDS

    bpy.app.timers.register(advance, first_interval=1.0, persistent=True)


main()
