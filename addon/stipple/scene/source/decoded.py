# SPDX-License-Identifier: GPL-3.0-or-later
"""Clouds decoded from sources: those that are kept, and those that are being made beside Blender.

A decode is waited for where it is expected to be short, by how long decodes of this source have taken. Others go on in
the library's own thread, for a later call. Nothing here writes Blender data.
"""

import time
from dataclasses import dataclass

from ... import preferences
from ...binding.cloud import Cloud
from ...binding.errors import StippleError
from ...binding.job import Job
from ...binding.structs import JobState
from . import bound, erased, source_settings, sources, splat_data
from .cloud_cache import CloudCache
from .decode_times import DecodeTimes

# Seconds: a decode that is expected to take less is waited for when a setting changes.
LIVE_SECONDS = 0.3
# That are waited at most for what was expected to be shorter.
_MOST_PATIENCE = 2 * LIVE_SECONDS
# What took less is made again rather than kept, unless an image is made of it.
KEEP_SECONDS = 0.05
# Of the memory that native work may take, the part for decoded clouds where the preferences say nothing.
_CACHE_SHARE = 4

times = DecodeTimes()
_kept = CloudCache()
_beside = {}    # _Beside by the datablock's name
_declined = {}  # what somebody has cancelled, by the datablock's name
_ending = []    # cancelled jobs that have not ended


@dataclass
class _Beside:
    """A decode that goes on in the library's thread."""

    key: tuple
    job: Job
    ended: bool = False  # when is_decoding() asked last


class Decoder:
    """A datablock's source at any settings, without what was erased. Once it is made it never touches Blender: workers
    may use it."""

    def __init__(self, data):
        """Errors: StippleError."""
        self._source = sources.source_key(data)
        self._model = sources.model_reader(data)
        self._erased = erased.read(data)
        self._limit = cache_limit()

    def key(self, settings):
        """What tells clouds apart."""
        return self._source, settings

    def is_kept(self, settings):
        return self.key(settings) in _kept

    def model(self, wait=Job.wait):
        """wait(job): called with the job that reads the file, where it has to be read. Errors: StippleError."""
        return self._model(wait)

    def cloud(self, settings, wait=None, is_image=True):
        """The cloud of these settings. wait(job): called with what takes long, to wait for it. is_image: it is for an
        image or one of many, and kept in any case, else only where it took long. Errors: StippleError."""
        cloud = _kept.get(self.key(settings))
        if cloud is None:
            began = time.perf_counter()
            if wait is None:
                made = self.model().decode(settings)
                seconds = time.perf_counter() - began
            else:
                job = self.start(settings, wait)
                wait(job)
                made, seconds = Cloud.of_job(job), job.seconds()
            cloud = self._keep(settings, made, seconds, is_image)
        return cloud

    def start(self, settings, wait=Job.wait):
        """The job that decodes. Errors: StippleError."""
        return self.model(wait).decode_start(settings)

    def finish(self, settings, job, is_image=False):
        """cloud() of a job of start(), waited for. Errors: StippleError."""
        job.wait()
        return self._keep(settings, Cloud.of_job(job), job.seconds(), is_image)

    def _keep(self, settings, made, seconds, is_image):
        times.note(self._source[0], settings.most_splats, seconds)
        cloud = self._erased.applied(made)
        if is_image or seconds >= KEEP_SECONDS:
            _kept.put(self.key(settings), cloud, self._limit)
        return cloud


def cache_limit():
    """Bytes of decoded clouds that are kept at most."""
    allowed, chosen = sources.context().memory_limit(), preferences.get()
    if chosen is None or chosen.budget_cache == 0:
        return allowed // _CACHE_SHARE
    return min(chosen.budget_cache << 20, allowed)


def cached(data=None):
    """(number, bytes) of the clouds that are kept, over all sources or of a datablock's."""
    if data is None:
        return _kept.measure(lambda key: True)
    try:
        source = sources.source_key(data)
    except StippleError:
        return 0, 0
    return _kept.measure(lambda key: key[0] == source)


class Pending:
    """A datablock's cloud at these settings that is yet to be decoded, unless it is kept. Once it is made it never
    touches Blender."""

    def __init__(self, data, settings, wait=None):
        """wait(job): called with the job that reads the source, where it has to be read. Errors: StippleError."""
        self._decoder, self._settings = Decoder(data), settings
        self._begun = _take(data, settings)
        if self._begun is None and not self._decoder.is_kept(settings):
            self._decoder.model(wait or Job.wait)

    def cloud(self, wait=None, is_image=True):
        """wait, is_image: as Decoder.cloud() has them. Errors: StippleError."""
        begun, self._begun = self._begun, None
        if begun is None:
            return self._decoder.cloud(self._settings, wait, is_image)
        if wait is not None:
            wait(begun)
        return self._decoder.finish(self._settings, begun, is_image)


class Carried:
    """A datablock's cloud at these settings and at one shape of the mesh that it follows. Once it is made it never
    touches Blender."""

    def __init__(self, data, settings, carrier, wait=None):
        """carrier: bound.Carrier. wait: as Pending has it. Errors: StippleError."""
        self._carrier, self._key = carrier, _key_of(data, settings)
        held = carrier.held(self._key)
        if held is not None:
            self._make = lambda wait, is_image: held[0]
        elif source_settings.of(data.stipple).as_they_are:
            whole = sources.masked(sources.whole_cloud(data), data)
            self._make = lambda wait, is_image: whole
        else:
            self._make = Pending(data, settings, wait).cloud

    def cloud(self, wait=None, is_image=True):
        """wait, is_image: as Decoder.cloud() has them. Errors: StippleError."""
        return self._carrier.carried(self._key, lambda: self._make(wait, is_image), wait or Job.wait)

    def read_anew(self, _native):
        """cloud() for one of many frames."""
        return self.cloud(is_image=False)


def _key_of(data, settings):
    """What tells the clouds of datablocks apart before a mesh carries them. Errors: StippleError."""
    return sources.source_key(data), None if source_settings.of(data.stipple).as_they_are else settings


def begin(data, settings, wait=None, carrier=None):
    """What gives a datablock's cloud for an image, by cloud(). carrier: of the mesh that it follows. Errors:
    StippleError, also for a source that has changed."""
    sources.check_unchanged(data)
    return Pending(data, settings, wait) if carrier is None else Carried(data, settings, carrier, wait)


def decode_data(data, settings, wait=None, carrier=None):
    """The cloud that a datablock's source gives at these settings, without what was hidden or erased; as a mesh carries
    it where a carrier is given. wait(job): called with what takes long, to wait for it; None for without a word.
    Errors: StippleError."""
    if carrier is not None:
        return Carried(data, settings, carrier, wait).cloud(wait, is_image=False)
    if source_settings.of(data.stipple).as_they_are:
        return sources.masked(sources.whole_cloud(data), data)
    return Pending(data, settings, wait).cloud(wait, is_image=False)


def full_cloud(data, depsgraph=None):
    """A datablock at full count: the whole source without what is hidden, splats of meshes at the render budget, and
    what is stored where there is no source; as its mesh has it at the time of a depsgraph, None for the window's. Not
    graded."""
    stipple = data.stipple
    settings = source_settings.of(stipple)
    if not settings.has_source or stipple.edited:
        return splat_data.ungraded_cloud(sources.context(), data)
    wanted = sources.decode_settings(stipple, 'FULL' if settings.counts_splats else 'RENDER')
    return decode_data(data, wanted, carrier=bound.carrier(data, depsgraph))


def is_quick(data, settings):
    """Whether decode_data() is known to be short: it is kept, or decodes of this source are. Errors: StippleError."""
    if not source_settings.of(data.stipple).counts_anchors:
        return True
    if is_kept(data, settings):
        return True
    expected = _expected(data, settings)
    return expected is not None and expected < LIVE_SECONDS


def is_decoded(data, settings, patience=None):
    """Whether decode_data() will not take long. Where it would, decoding goes on in the library's own thread, for a
    later call; what was being decoded for the datablock at other settings is cancelled. patience: seconds that are
    waited for what begins now; None for none where it is expected to take LIVE_SECONDS or longer."""
    if not source_settings.of(data.stipple).counts_anchors or data.stipple.is_sequence:
        return True
    name = data.name_full
    try:
        decoder = Decoder(data)
        key, begun = decoder.key(settings), _beside.get(name)
        if begun is not None and begun.key == key:
            return not is_running(begun.job)
        stop(name)
        if decoder.is_kept(settings) or bound.is_held(data, key):
            return True
        if _declined.get(name) == key:
            return False
        _declined.pop(name, None)
        if patience is None:
            patience = _patience(data, settings)
        # One after the other: what was cancelled takes a moment to end.
        if is_ending() or not sources.is_at_hand(data, patience):
            return False
        begun = _beside[name] = _Beside(key, decoder.start(settings))
    except StippleError:
        return True  # decoding says what is wrong
    return ends_within(begun.job, patience)


def stop(name):
    """Cancels what is being decoded for a datablock of this name. It does not wait."""
    begun = _beside.pop(name, None)
    if begun is not None:
        begun.job.cancel()
        _ending.append(begun.job)


def settle(data):
    """A datablock shows what it should: nothing else is wanted."""
    stop(data.name_full)
    _declined.pop(data.name_full, None)


def decline():
    """Cancels all that is being decoded beside Blender, by somebody's wish: it does not begin again by itself. Returns
    the names of the datablocks."""
    names = list(_beside)
    for name in names:
        _declined[name] = _beside[name].key
        stop(name)
    return names


def is_declined(data):
    return data.name_full in _declined


def allow(data):
    """Takes back what decline() said of a datablock."""
    _declined.pop(data.name_full, None)


def is_decoding():
    """Whether clouds are being decoded, or are about to be, that is_decoded() has been asked for. What nobody has taken
    since it was done is forgotten."""
    for name, begun in list(_beside.items()):
        if begun.ended:
            del _beside[name]
        begun.ended = not is_running(begun.job)
    return bool(_beside) or is_ending()


def has_ended():
    """Whether something of that can be taken, or can begin."""
    if is_ending():
        return False
    return not _beside or any(not is_running(begun.job) for begun in _beside.values())


def decoding_share(data):
    """How much of a datablock's decoding is done, 0 to 1; None where none goes on."""
    return share_of(data.name_full)


def share_of(name):
    """The same by the datablock's name."""
    begun = _beside.get(name)
    return None if begun is None else begun.job.poll()[1]


def names():
    """Of the datablocks that something is being decoded for."""
    return tuple(_beside)


def is_kept(data, settings):
    """Whether decode_data() takes no decoding. Errors: StippleError."""
    return Decoder(data).is_kept(settings) or bound.is_held(data, _key_of(data, settings))


def is_ending():
    """Whether something that was cancelled still works."""
    _ending[:] = [job for job in _ending if is_running(job)]
    return bool(_ending)


def is_running(job):
    return job.poll()[0] == JobState.RUNNING


def ends_within(job, seconds):
    """Waits for a job for so long at most."""
    until = time.perf_counter() + seconds
    while is_running(job):
        if time.perf_counter() >= until:
            return False
        time.sleep(0.001)
    return True


def follow(old, new):
    """A file was copied: what is known of it holds for the copy."""
    sources.follow(old, new)
    moved = sources.moved(old, new)

    def renamed(key):
        source = moved(key[0])
        return None if source is None else (source, key[1])
    _kept.rename(renamed)


def abandon():
    """Another file is opened: nothing that is being decoded is wanted. It does not wait."""
    for name in list(_beside):
        stop(name)
    _declined.clear()


def forget():
    """Gives all native memory back."""
    for begun in _beside.values():
        begun.job.close()
    for job in _ending:
        job.close()
    _beside.clear()
    _ending.clear()
    _declined.clear()
    _kept.clear()
    times.forget()
    bound.forget()
    sources.forget()


def _take(data, settings):
    """The job that decodes this already, if there is one."""
    begun = _beside.get(data.name_full)
    if begun is None or begun.key != Decoder(data).key(settings):
        return None
    del _beside[data.name_full]
    return begun.job


def _patience(data, settings):
    expected = _expected(data, settings)
    if expected is None:
        return LIVE_SECONDS
    return _MOST_PATIENCE if expected < LIVE_SECONDS else 0.0


def _expected(data, settings):
    return times.estimate(sources.source_key(data)[0], settings.most_splats)
