# SPDX-License-Identifier: GPL-3.0-or-later
"""Failures of the native library as exceptions."""

from . import structs


class StippleError(Exception):
    """A call failed; the text is one sentence for the user."""

    def __init__(self, message, status=None):
        """status: STIPPLE_ERROR_INTERNAL where none is said."""
        super().__init__(message)
        self.status = structs.Status.ERROR_INTERNAL if status is None else structs.Status(status)


class CancelledError(StippleError):
    """The work was cancelled: nothing is wrong and nothing has changed."""

    def __init__(self, message='The work was cancelled.'):
        super().__init__(message, structs.Status.ERROR_CANCELLED)


class LibraryError(StippleError):
    """The native library is missing, is another library, or has the wrong version."""

    def __init__(self, message):
        super().__init__(message, structs.Status.ERROR_UNAVAILABLE)


def invalid(message):
    """An error of the caller's arguments, found before the library is called."""
    return StippleError(message, structs.Status.ERROR_INVALID_ARGUMENT)


def check(library, status):
    """Raises the error of the call that has just returned `status` on this thread."""
    if status == structs.Status.OK:
        return
    message = library.stipple_last_error_message().decode('utf-8', 'replace')
    if status == structs.Status.ERROR_CANCELLED:
        raise CancelledError(message or 'The work was cancelled.')
    raise StippleError(message, status)
