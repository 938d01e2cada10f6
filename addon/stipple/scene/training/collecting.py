# SPDX-License-Identifier: GPL-3.0-or-later
"""Collects assets, one after the other: what is there already stays, and what cannot be collected is left out."""

import os
import time
import zlib
from dataclasses import asdict, dataclass, field

from ... import log
from ...binding.errors import CancelledError, StippleError, invalid
from ...binding.structs import JobState, Status
from ..source import sources
from . import sphere
from .asset_folder import AssetFolder
from .assets import LeftOutError
from .point_colours import PointColours
from .studio import Studio


@dataclass(frozen=True)
class CollectSettings:
    view_count: int = 24
    size: int = 128           # pixels of both sides of an image
    samples: int = 16         # per pixel
    point_count: int = 16384
    seed: int = 0


@dataclass
class Collected:
    done: list = field(default_factory=list)      # names
    kept: list = field(default_factory=list)      # names of what was there before
    left_out: list = field(default_factory=list)  # (name, reason)

    def summary(self):
        """A sentence without a full stop."""
        counts = ((self.done, 'collected'), (self.kept, 'already there'), (self.left_out, 'left out'))
        return ', '.join(f'{len(names)} {said}' for names, said in counts if names or said == 'collected')


class CollectTask:
    """Polled like a native job, from Blender's main thread. Result: Collected.

    After a cancel the assets that are whole stay, and so do the images of the one that it was at.
    """

    holds_scene = True  # nothing may change in Blender while data of an asset are in the open file

    def __init__(self, assets, folder, settings, say=lambda line: None):
        """say: gets a line for each asset. Errors: StippleError for a folder that cannot be written to."""
        sources.context()  # a library that is missing is no asset's fault
        try:
            os.makedirs(folder, exist_ok=True)
        except OSError as error:
            raise StippleError(f"The folder '{folder}' cannot be made: {error.strerror}.", Status.ERROR_IO) from None
        if not os.access(folder, os.W_OK):
            raise StippleError(f"The folder '{folder}' cannot be written to.", Status.ERROR_IO)
        self.result = Collected()
        self._assets, self._folder, self._settings, self._say = assets, folder, settings, say
        self._fraction, self._stage = 0.0, 'Preparing'
        self._cancelled, self._error = False, None
        self._steps = self._work()

    def poll(self):
        """(state, fraction 0..1, stage). Takes one step: an asset is read, or rendered once."""
        if self._steps is not None:
            try:
                self._fraction, self._stage = next(self._steps)
                return JobState.RUNNING, self._fraction, self._stage
            except StopIteration:
                pass
            except StippleError as error:
                self._error = error
            self._steps = None
        if self._error is None:
            return JobState.DONE, 1.0, self._stage
        ended = JobState.CANCELLED if isinstance(self._error, CancelledError) else JobState.FAILED
        return ended, self._fraction, self._stage

    def cancel(self):
        self._cancelled = True

    def wait(self):
        """Until the end; raises what went wrong."""
        while self.poll()[0] == JobState.RUNNING:
            pass
        if self._error is not None:
            raise self._error

    def close(self):
        """Ends at once."""
        if self._steps is not None:
            self._steps.close()  # the open file is as it was
            self._steps = None

    def _work(self):
        count = len(self._assets)
        for i, asset in enumerate(self._assets):
            began = time.perf_counter()
            folder = AssetFolder(os.path.join(self._folder, asset.name))
            view_count = folder.view_count()
            if view_count:
                self.result.kept.append(asset.name)
                self._say(f'{asset.name}: already there, {view_count} views')
                continue
            try:
                for share, stage in self._collect(asset, folder):
                    yield (i + share) / count, f'{asset.name} ({i + 1} of {count}), {stage}'
                    if self._cancelled:
                        raise CancelledError()
            except LeftOutError as reason:
                folder.abandon()
                self.result.left_out.append((asset.name, str(reason)))
                self._say(f'{asset.name}: left out: {reason}')
                continue
            self.result.done.append(asset.name)
            self._say(f'{asset.name}: done, {self._settings.view_count} views, {time.perf_counter() - began:.1f} s')

    def _collect(self, asset, folder):
        try:
            yield from self._steps_of(asset, folder)
        except (CancelledError, LeftOutError):
            raise
        except StippleError as error:
            raise LeftOutError(str(error).rstrip('.')) from None
        except OSError as error:
            raise LeftOutError(f'it cannot be written: {error.strerror or error}') from None
        except Exception as error:  # one odd file of thousands must not end the work of a night
            log.exception("'%s' could not be collected", asset.name)
            raise LeftOutError(f'{type(error).__name__}: {error}') from None

    def _steps_of(self, asset, folder):
        settings = self._settings
        seed = zlib.crc32(f'{settings.seed} {asset.name}'.encode())
        yield 0.0, 'reading'
        with Studio(settings.size, settings.samples) as studio, asset.within(studio.scene):
            surface = studio.surface()
            folder.begin({**asdict(settings), 'asset': asset.stamp()})
            poses = sphere.poses(settings.view_count, seed)
            places, normals, triangles = surface.points(settings.point_count, seed)
            colours = PointColours(places, triangles, surface.faces[triangles], surface.mesh())
            brightest = opaquest = 0.0
            for view, pose in enumerate(poses):
                yield view / settings.view_count, f'view {view + 1} of {settings.view_count}'
                image = folder.image(view)
                if image is None or len(image) != settings.size:
                    folder.add_image(view, lambda path: studio.render(path, pose, surface))
                    image = folder.image(view)
                if image is None:
                    raise LeftOutError(f'its view {view} was rendered and cannot be read')
                opaquest = max(opaquest, float(image[..., 3].max()))
                brightest = max(brightest, float((image[..., :3] * image[..., 3:]).max()))
                colours.add(image, pose)
            if opaquest == 0 or brightest == 0:
                raise LeftOutError(f'its images are {"empty" if opaquest == 0 else "black"}')
            shown = colours.result()
            if shown is None:
                raise LeftOutError('no image shows its surface')
            normals[shown[1]] *= -1
            folder.finish(settings.size, poses, (places, normals, shown[0]), surface)


def chosen(assets, index, count):
    """Every count-th asset from an index on. Errors: StippleError for an index that is not below the count."""
    if not 0 <= index < count:
        raise invalid(f'The index is {index}; allowed is 0 to {count - 1}, for {count} parts.')
    return assets[index::count]
