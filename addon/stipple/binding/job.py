# SPDX-License-Identifier: GPL-3.0-or-later
"""Long native work that is polled: no callback ever enters Python.

What a finished job has made is asked of its own class, as Model.of_job(job) does.
"""

from ctypes import byref

from .handle import Handle
from .structs import JobState, StippleJobProgress


class Job(Handle):
    free_function = 'stipple_job_free'

    def __init__(self, library, pointer, keep=()):
        """keep: what must stay alive while the job runs (buffers it fills)."""
        super().__init__(library, pointer)
        self._keep = keep

    def poll(self):
        """(state, fraction 0..1, stage). Never waits."""
        progress = self._progress()
        return JobState(progress.state), progress.fraction, progress.stage.decode('utf-8', 'replace')

    def seconds(self):
        """That it has taken so far, or until its end."""
        return self._progress().seconds

    def cancel(self):
        """Asks the work to stop soon. Does not wait."""
        self._check(self.library.stipple_job_cancel(self.pointer))

    def wait(self):
        """Waits for the end; raises what went wrong, CancelledError after a cancel."""
        self._check(self.library.stipple_job_wait(self.pointer))

    def _progress(self):
        progress = StippleJobProgress()
        self._check(self.library.stipple_job_poll(self.pointer, byref(progress)))
        return progress
