# SPDX-License-Identifier: GPL-3.0-or-later
"""Work that is begun before somebody asks for its result."""

import threading


class Ahead:
    """A call in a thread of its own. What it calls never touches Blender."""

    def __init__(self, call):
        self._call, self._result, self._error = call, None, None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def is_running(self):
        return self._thread.is_alive()

    def result(self):
        """Waits. Errors: what the call has raised."""
        self._thread.join()
        if self._error is not None:
            raise self._error
        return self._result

    def _run(self):
        try:
            self._result = self._call()
        except Exception as error:  # the thread's end is result(), which must hear of it
            self._error = error
