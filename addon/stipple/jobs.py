# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators around native jobs.

Called from a script or in background mode a job runs to its end at once. Called from the interface a
timer polls it: Blender stays usable, the status bar shows the progress, Escape cancels, and the
operator ends with one undo step.
"""

import threading
import time

from .binding import structs
from .binding.errors import CancelledError, StippleError
from .scene.source import sources

POLL_SECONDS = 0.05


class Task:
    """Several native calls in a thread of their own, polled like a native job. Never touches Blender."""

    def __init__(self, work):
        """work(task) → result; it calls task.advance and task.run between its steps."""
        self.result = None
        self._error = None
        self._progress = (0.0, '')
        self._cancelled = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(work,), daemon=True)
        self._thread.start()

    def poll(self):
        """(state, fraction 0..1, stage). Never waits."""
        if self._thread.is_alive():
            return (structs.JobState.RUNNING, *self._progress)
        if self._error is None:
            return structs.JobState.DONE, 1.0, self._progress[1]
        cancelled = isinstance(self._error, CancelledError)
        return (structs.JobState.CANCELLED if cancelled else structs.JobState.FAILED, *self._progress)

    def cancel(self):
        self._cancelled.set()

    def wait(self):
        self._thread.join()
        if self._error is not None:
            raise self._error

    def close(self):
        """Cancels what still runs and waits for its end."""
        self.cancel()
        self._thread.join()

    def advance(self, fraction, stage):
        """For the work: says how far it is. Raises CancelledError after a cancel."""
        self._progress = (fraction, stage)
        if self._cancelled.is_set():
            raise CancelledError()

    def run(self, job, start=0.0, end=1.0, said=None):
        """For the work: a native job as the part of it between two fractions; returns the job when it is done. said:
        the stage that is shown, None for the job's own."""
        while True:
            state, fraction, stage = job.poll()
            if state != structs.JobState.RUNNING:
                job.wait()
                return job
            if self._cancelled.is_set():
                job.cancel()
            self._progress = (start + (end - start) * fraction, said or stage)
            time.sleep(POLL_SECONDS / 10)

    def _run(self, work):
        try:
            self.result = work(self)
        except StippleError as error:
            self._error = error
        except Exception as error:  # the thread's end is wait(), which must hear of it
            self._error = error


class ViewsFirst:
    """Mix-in before JobOperator, of an operator whose job is a ViewTask: while it renders views of the scene, nothing may
    change in Blender, and Esc leaves everything as it was."""

    @property
    def escape_text(self):
        return 'Esc cancels' if self._job.holds_scene else super().escape_text

    def modal(self, context, event):
        result = super().modal(context, event)
        return {'RUNNING_MODAL'} if self._job is not None and self._job.holds_scene else result


class JobOperator:
    """Mix-in. The operator gives start(context) → job (or None: nothing to wait for), then finish(context, job)."""

    _timer = None
    _job = None
    _is_shown = False
    _has_begun = False
    escape_text = 'Esc cancels'  # what the status bar says

    def __init_subclass__(cls, **options):
        """Without the library none of these operators can do anything: their menu entries are grey and say why."""
        super().__init_subclass__(**options)
        asked = cls.__dict__.get('poll')
        if asked is None and any('poll' in base.__dict__ for base in cls.__mro__[1:] if issubclass(base, JobOperator)):
            return  # that of a mix-in, which is asked already

        def poll(cls, context):
            problem = sources.library_problem()
            if problem:
                cls.poll_message_set(problem)
                return False
            return asked is None or asked.__get__(None, cls)(context)
        cls.poll = classmethod(poll)

    def execute(self, context):
        try:
            job = self.start(context)
            if job is not None:
                job.wait()
            self.finish(context, job)
        except StippleError as error:
            return self._failed(error)
        return {'FINISHED'}

    def run_in_window(self, context):
        """What invoke() calls instead of execute()."""
        if self._has_begun:
            # Blender repeats an operator of its list of what was done. It would put one that ends later into the list
            # once more, and crash: this one holds the window until it is over.
            return JobOperator.execute(self, context)
        self._has_begun = True
        try:
            self._job = self.start(context)
        except StippleError as error:
            return self._failed(error)
        if self._job is None:
            return self._finish_in_window(context)
        manager = context.window_manager
        self._timer = manager.event_timer_add(POLL_SECONDS, window=context.window)
        manager.modal_handler_add(self)
        manager.progress_begin(0, 100)
        # A first step may take seconds: Blender draws this before it.
        self._is_shown = False
        self._say(context, 0.0, 'Preparing')
        return {'RUNNING_MODAL'}

    def modal(self, context, event):
        if event.type == 'ESC':
            self._job.cancel()
            return {'RUNNING_MODAL'}
        if event.type != 'TIMER':
            return {'PASS_THROUGH'}
        if not self._is_shown:
            self._is_shown = True
            return {'PASS_THROUGH'}
        state, fraction, stage = self._job.poll()
        if state == structs.JobState.RUNNING:
            self._say(context, fraction, stage)
            return {'PASS_THROUGH'}
        self._leave_window(context)
        return self._finish_in_window(context)

    def cancel(self, context):
        """Blender itself ends the operator, for instance when the window closes."""
        if self._job is not None:
            self._job.close()
            self._leave_window(context)

    def _finish_in_window(self, context):
        job, self._job = self._job, None
        try:
            if job is not None:
                job.wait()
            self.finish(context, job)
        except StippleError as error:
            return self._failed(error)
        return {'FINISHED'}

    def _say(self, context, fraction, stage):
        context.window_manager.progress_update(int(100 * fraction))
        context.workspace.status_text_set(f'{self.bl_label}: {stage} {fraction:.0%} ({self.escape_text})')

    def _leave_window(self, context):
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
        self._timer = None

    def _failed(self, error):
        self.report({'INFO' if isinstance(error, CancelledError) else 'ERROR'}, str(error))
        return {'CANCELLED'}
