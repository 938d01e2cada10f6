# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders with the files of a series that the add-on makes: those of a file that holds splats at times, and others."""

import os
from dataclasses import dataclass

from ... import late
from ...binding.errors import StippleError
from ...binding.structs import Status
from . import numbered

shutil = late.module('shutil')


@dataclass
class Split:
    """A series that lay in one file. first_frame, frames_per_second and spacing: when the file shows its first frame,
    in a count of its own, and by how much the frames are apart in it."""

    path: str  # of the first file
    count: int
    first_frame: float
    spacing: float
    frames_per_second: float

    def timing(self, scene_rate):
        """(scene's frame that shows the first file, files for each frame of the scene)."""
        frames = self.frames_per_second / scene_rate  # of the file, in one of the scene
        return round(self.first_frame / frames), frames / self.spacing


def write(stem, fill):
    """Makes a folder of this name and returns its path; one that is there stays, as undo goes back to it, and the new
    one gets a number. fill(folder) writes the files, of which none is left where it fails. Errors: StippleError."""
    folder = f'{stem}.{os.getpid()}.new'
    try:
        os.makedirs(folder)
        fill(folder)
        return _rename(folder, stem)
    except OSError as error:
        raise StippleError(f"The folder '{folder}' cannot be written: {error.strerror}.", Status.ERROR_IO) from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def split(reader, stem, advance):
    """Writes a file for each time of a SeriesReader into a folder, as a Split. advance(part, stage): called before
    each; raises to stop. Errors: StippleError."""
    name, times = os.path.basename(stem), []

    def path(folder, i):
        return numbered.frame_path(os.path.join(folder, f'{name}.ply'), i + 1)

    def fill(folder):
        for i in range(reader.count):
            advance(i / reader.count, f'Frame {i + 1} of {reader.count}')
            cloud, time = reader.read(i)
            times.append(time)
            cloud.save(path(folder, i), frame=cloud.info().frame)
    folder = write(stem, fill)
    return Split(path(folder, 0), reader.count, times[0], (times[-1] - times[0]) / (reader.count - 1),
                 reader.frames_per_second)


def _rename(folder, wanted):
    target, number = wanted, 0
    while os.path.exists(target):
        number += 1
        target = f'{wanted}.{number:03d}'
    os.rename(folder, target)
    return target
