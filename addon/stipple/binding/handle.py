# SPDX-License-Identifier: GPL-3.0-or-later
"""Owners of native handles, and numpy arrays as C pointers."""

import os
from ctypes import POINTER, byref, c_double, c_float, c_uint32, c_uint64, c_uint8, c_void_p

import numpy as np

from .errors import check

_POINTERS = {np.dtype(np.float32): POINTER(c_float), np.dtype(np.float64): POINTER(c_double),
             np.dtype(np.uint8): POINTER(c_uint8), np.dtype(np.uint32): POINTER(c_uint32),
             np.dtype(np.uint64): POINTER(c_uint64)}


class Handle:
    """One reference to a native thing; freed with the object, or earlier by close()."""

    free_function = ''
    job_function = ''  # gives the thing that a finished job has made, where jobs make it

    @classmethod
    def of_job(cls, job):
        """What a finished job has made. Errors: StippleError for a job that made another thing."""
        return cls(job.library, new_handle(job.library, cls.job_function, job.pointer))

    def __init__(self, library, pointer):
        self.library = library
        self.pointer = pointer

    def close(self):
        """Gives the native thing back. May be called twice."""
        pointer, self.pointer = self.pointer, None
        if pointer:
            getattr(self.library, self.free_function)(pointer)

    def __del__(self):
        # Absent when the constructor failed.
        if getattr(self, 'pointer', None):
            self.close()

    def _check(self, status):
        check(self.library, status)


def new_handle(library, function, *arguments):
    """Calls a function whose last parameter is a handle to fill, and returns that handle."""
    pointer = c_void_p()
    check(library, getattr(library, function)(*arguments, byref(pointer)))
    return pointer.value


def contiguous(array, dtype=np.float32):
    """The array, C-contiguous with the given type; a copy only where it has to be."""
    return np.ascontiguousarray(array, dtype)


def pointer_to(array):
    """A typed C pointer to an array's data, or NULL for None. The array must outlive its use."""
    if array is None:
        return None
    assert array.flags.c_contiguous
    return array.ctypes.data_as(_POINTERS[array.dtype])


def path_bytes(path):
    """A path as the header wants it: UTF-8."""
    return os.fsencode(os.fspath(path))


def matrix16(matrix):
    """A 4x4 matrix as 16 doubles, row-major."""
    values = np.ascontiguousarray(np.asarray(matrix, np.float64).reshape(16))
    return (c_double * 16)(*values)
