# SPDX-License-Identifier: GPL-3.0-or-later
"""The context: threads and memory that native work may use."""

from ctypes import byref, c_uint64

from .errors import invalid
from .handle import Handle, new_handle, path_bytes
from .structs import StippleContextOptions


class Context(Handle):
    free_function = 'stipple_context_free'

    def __init__(self, library, threads=0, memory_limit_bytes=0):
        """threads 0: as many as the machine has. memory_limit_bytes 0: 60 % of its memory."""
        if not 0 <= threads <= 1024:
            raise invalid(f'Threads is {threads}; allowed are 0 (automatic) to 1024.')
        options = StippleContextOptions()
        library.stipple_context_options_init(byref(options))
        options.thread_count = threads
        options.memory_limit_bytes = memory_limit_bytes
        super().__init__(library, new_handle(library, 'stipple_context_create', byref(options)))
        self._weights_folder, self._shipped_folder = '', ''

    def set_weights_folder(self, folder):
        """Says where models that name a file of weights find it; '' for where the environment says."""
        if folder != self._weights_folder:
            self._check(self.library.stipple_context_set_weights_folder(self.pointer,
                                                                        path_bytes(folder) if folder else None))
            self._weights_folder = folder

    def set_shipped_weights_folder(self, folder):
        """Says where networks lie that came with the program, '' for none: what models name is looked for there, too."""
        if folder != self._shipped_folder:
            self._check(self.library.stipple_context_set_shipped_weights_folder(self.pointer,
                                                                                path_bytes(folder) if folder else None))
            self._shipped_folder = folder

    def memory_limit(self):
        """Bytes that native work may take."""
        size = c_uint64()
        self._check(self.library.stipple_context_memory_limit(self.pointer, byref(size)))
        return size.value

    def version(self):
        return self.library.stipple_version_string().decode()
