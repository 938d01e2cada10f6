# SPDX-License-Identifier: GPL-3.0-or-later
"""Shows how far the decoding of splats is that nobody waits for, or that a render by another engine waits for, and
lets Esc cancel it. Blender's own thread shows it; a render waits in a thread of its own."""

import threading
import time

import bpy

from . import decoded

POLL_SECONDS = 0.05

# shown: what panels have said last. wait: of the render, _Wait. watched: windows in which Esc is listened to.
_state = {'shown': None, 'wait': None, 'watched': set()}


class _Wait:
    """A decode that a render by another engine needs."""

    def __init__(self):
        self.fraction = 0.0
        self.is_shown = False
        self.is_cancelled = False


def show(is_busy):
    """Has panels drawn again where they have something else to say, and listens to Esc while something is decoded."""
    shown = {name: round(100 * decoded.share_of(name)) for name in decoded.names()} if is_busy else None
    if shown != _state['shown']:
        _state['shown'] = shown
        for area in _areas('PROPERTIES'):
            area.tag_redraw()
    if shown:
        watch()


def watch():
    """Listens to Esc in every window, until nothing is decoded any more."""
    for window in bpy.context.window_manager.windows:
        pointer = window.as_pointer()
        if pointer in _state['watched']:
            continue
        with bpy.context.temp_override(window=window):
            if bpy.ops.stipple.decoding_watch('INVOKE_DEFAULT') == {'RUNNING_MODAL'}:
                _state['watched'].add(pointer)


def ignore(window):
    """Esc is not listened to in this window any more."""
    _state['watched'].discard(window.as_pointer())


def forget():
    """Another file is opened, with windows of its own."""
    _state['watched'].clear()
    _state['shown'] = None


def is_watching():
    """Whether there is something that Esc would cancel."""
    return bool(decoded.names()) or _state['wait'] is not None


def escape():
    """Esc was pressed, which ends a render, too. Returns the names of the datablocks whose decoding is cancelled."""
    if _state['wait'] is not None:
        _state['wait'].is_cancelled = True
    return decoded.decline()


def wait_in_render(job):
    """Until a decode that a render by another engine needs has ended: the progress shows beside the mouse, and Esc
    cancels it. Errors: CancelledError."""
    if bpy.app.background:
        job.wait()
        return
    wait = _state['wait'] = _Wait()
    # In a thread of a render nothing may be shown: Blender's own does that.
    is_here = threading.current_thread() is threading.main_thread()
    if is_here:
        bpy.context.window_manager.progress_begin(0, 100)
    else:
        bpy.app.timers.register(_follow, first_interval=0.0)
    try:
        while decoded.is_running(job):
            wait.fraction = job.poll()[1]
            if wait.is_cancelled:
                job.cancel()
            if is_here:
                bpy.context.window_manager.progress_update(100 * wait.fraction)
            time.sleep(POLL_SECONDS)
        job.wait()
    finally:
        _state['wait'] = None
        if is_here:
            bpy.context.window_manager.progress_end()


def _follow():
    """A timer's function: shows what the thread of a render waits for."""
    wait, manager = _state['wait'], bpy.context.window_manager
    if wait is None:
        manager.progress_end()
        return None
    if not wait.is_shown:
        wait.is_shown = True
        manager.progress_begin(0, 100)
    watch()
    manager.progress_update(100 * wait.fraction)
    return POLL_SECONDS


def _areas(kind):
    return [area for window in bpy.context.window_manager.windows for area in window.screen.areas if area.type == kind]
