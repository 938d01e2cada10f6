# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of networks' weights, which users download themselves."""

from ctypes import byref, c_char_p
from dataclasses import dataclass

from .errors import check
from .handle import Handle, new_handle, path_bytes
from .job import Job
from .structs import StippleWeightsFile, StippleWeightsInfo, WeightsRole, WeightsState


@dataclass(frozen=True)
class WeightsFile:
    """What is known of the file of a role."""

    role: WeightsRole
    state: WeightsState
    label: str
    path: str              # '' where it is missing
    size: int              # bytes
    published_size: int
    modified: int          # nanoseconds since 1970
    published_path: str    # in the published model
    published_sha256: str
    sha256: str            # '' until the file was read
    licence: str


def save_half_sized(library, weights_path, out_path):
    """Writes trained weights with 16 bits for each number. Errors: StippleError."""
    check(library, library.stipple_weights_save_half_sized(path_bytes(weights_path), path_bytes(out_path)))


class Weights(Handle):
    """What a folder has of the published files, as it was when it was looked through."""

    free_function = 'stipple_weights_free'
    job_function = 'stipple_job_weights'

    @classmethod
    def find(cls, context, folder):
        """Errors: StippleError for a folder that cannot be read, or has too much in it to be one of weights."""
        return cls(context.library,
                   new_handle(context.library, 'stipple_weights_find', context.pointer, path_bytes(folder)))

    def check_start(self):
        """A job that makes Weights whose files' hashes are known. About 4 GB are read."""
        return Job(self.library, new_handle(self.library, 'stipple_weights_check_start', self.pointer))

    def source(self):
        """Where users get the files."""
        return self._info().source_utf8.decode()

    def files(self):
        """WeightsFile of every role, missing ones too."""
        return [self._file(role) for role in range(self._info().file_count)]

    def notes(self):
        """Sentences about files that cannot be read, or of which there are several."""
        text, found = c_char_p(), []
        for index in range(self._info().note_count):
            self._check(self.library.stipple_weights_note(self.pointer, index, byref(text)))
            found.append(text.value.decode('utf-8', 'replace'))
        return found

    def _info(self):
        info = StippleWeightsInfo()
        self._check(self.library.stipple_weights_info(self.pointer, byref(info)))
        return info

    def _file(self, role):
        file = StippleWeightsFile()
        self._check(self.library.stipple_weights_file(self.pointer, role, byref(file)))
        texts = (text.decode('utf-8', 'surrogateescape')
                 for text in (file.label_utf8, file.path_utf8, file.published_path_utf8, file.published_sha256_utf8,
                              file.sha256_utf8, file.licence_utf8))
        label, path, published_path, published_sha256, sha256, licence = texts
        return WeightsFile(WeightsRole(file.role), WeightsState(file.state), label, path, file.bytes,
                           file.published_bytes, file.modified_ns, published_path, published_sha256, sha256, licence)
