# SPDX-License-Identifier: GPL-3.0-or-later
"""Sources of splats: the native context, models read from asset files, clouds decoded from them.

Both caches are native memory, keyed by the file's identity and the settings. Nothing here writes
Blender data.
"""

import filecmp
import os
import time
import zlib
from collections import OrderedDict
from dataclasses import dataclass, replace

import bpy

from ... import preferences
from ...binding import cloud_edit, library
from ...binding.cloud import Cloud
from ...binding.context import Context
from ...binding.errors import StippleError
from ...binding.job import Job
from ...binding.model import DecodeSettings, Model
from ...binding.structs import AnchorOrder, JobState, Status
from .. import meshes
from .ahead import Ahead
from . import erased, masks, selections, source_paths, source_settings, splat_data
from .source_paths import MODEL_SUFFIX

_MAX_MODELS = 4
# Splats that the viewport shows at first of a tree.
FIRST_COUNT = 500_000
# Splats kept decoded over all cached clouds; 60 bytes each, so 1.2 GB at most.
_MAX_CACHED_SPLATS = 20_000_000

# What tells whether a file has changed: its size and this many samples, the first and the last byte among them.
_SAMPLE_BYTES = 1 << 16
_MAX_SAMPLES = 32

_contexts = {}
_stamps = {}
_models = OrderedDict()
_reading = {}  # jobs of models that were asked for, by the same keys
_clouds = OrderedDict()
_decoding = {}  # _Decoding of clouds that take long, by datablock
_whole = {}  # the cloud of whole_cloud() that was asked for last: one edit of a source comes after another
_whole_ahead = {}  # what is being read for it, by the same key


def library_problem():
    """Why the library cannot be used, '' where nothing is known to be wrong. Loads nothing."""
    return library.problem(_library_path())


def _library_path():
    chosen = preferences.get()
    return '' if chosen is None else chosen.library_path


def context():
    """The native context of the current preferences. Errors: LibraryError."""
    chosen = preferences.get()
    path, threads, limit = _library_path(), 0, 0
    if chosen is not None:
        threads, limit = chosen.threads, chosen.memory_limit << 20
    key = (str(library.find(path)), threads, limit)
    if key not in _contexts:
        _contexts.clear()
        _contexts[key] = Context(library.load(path), threads, limit)
    _contexts[key].set_weights_folder(preferences.weights_folder())
    return _contexts[key]


def forget():
    """Gives all native memory back."""
    for job in _reading.values():
        job.close()
    _reading.clear()
    for decoding in _decoding.values():
        decoding.job.close()
    _decoding.clear()
    _whole.clear()
    _whole_ahead.clear()
    _clouds.clear()
    _models.clear()
    _contexts.clear()


def state(data):
    """What is with the file that a datablock's splats come from: 'FINE', 'MISSING' or 'CHANGED' since it was read.
    Files of a series are read when they are shown: none of them is old, and one that is missing is a gap. Without their
    folder all are missing."""
    stipple = data.stipple
    if not source_settings.of(stipple).has_source or not stipple.source:
        return 'FINE'
    path = source_paths.file_of(data)
    if stipple.is_sequence:
        folder = os.path.dirname(path if source_paths.is_alone(path) else os.path.dirname(path))
        return 'FINE' if os.path.isdir(folder) else 'MISSING'
    found = stamp(path)
    if not found:
        return 'MISSING'
    return 'CHANGED' if stipple.source_stamp not in ('', found) else 'FINE'


def check_unchanged(data):
    """Errors: StippleError for a source that is not there or not the one that was read."""
    found = state(data)
    if found != 'FINE':
        what = 'is missing' if found == 'MISSING' else 'has changed since it was read'
        raise StippleError(f"The source '{source_paths.file_of(data)}' of '{data.name}' {what}; choose "
                           'Relink, or Use as New Source to keep the splats that are stored.', Status.ERROR_IO)


def stamp(path):
    """A short text that changes with a file's content, '' for a file that cannot be read. Of large files it looks at
    samples: a splat file that is written again differs everywhere."""
    try:
        key = _file_key(path)
        if key not in _stamps:
            _stamps[key] = _stamp_of(path, key[2])
        return _stamps[key]
    except (StippleError, OSError):
        return ''


def _stamp_of(path, size):
    value, count = 0, min(-(-size // _SAMPLE_BYTES), _MAX_SAMPLES)
    with open(path, 'rb') as file:
        for i in range(count):
            file.seek(i * (size - _SAMPLE_BYTES) // max(count - 1, 1) if size > _SAMPLE_BYTES else 0)
            value = zlib.crc32(file.read(_SAMPLE_BYTES), value)
    return f'{size}:{value:08x}'


def model(path):
    """The model of an asset file, read once. Errors: StippleError for a missing or broken file."""
    key = _file_key(path)
    known = _models.get(key)
    if known is None:
        job = _reading.pop(key, None)
        if job is None:
            known = Model.load(context(), path)
        else:
            job.wait()
            known = Model.of_job(job)
        remember_model(path, known)
    _models.move_to_end(key)
    return known


def is_at_hand(data, patience):
    """Whether decoding a datablock's source would not have to read its file first. Where it would, reading begins in
    the library's own thread, for the next call; patience: seconds that are waited for it."""
    stipple = data.stipple
    if not source_settings.of(stipple).has_budget or stipple.is_sequence:
        return True
    try:
        path = source_paths.file_of(data)
        key = _file_key(path)
        if key in _models:
            return True
        if key not in _reading:
            _reading[key] = Model.load_start(context(), path)
    except StippleError:
        return True  # decoding says what is wrong
    until = time.perf_counter() + patience
    while _is_running(_reading[key]):
        if time.perf_counter() >= until:
            return False
        time.sleep(0.001)
    return True


def is_reading():
    """Whether a file is being read that is_at_hand() has asked for."""
    return any(_is_running(job) for job in _reading.values())


def follow(old, new):
    """A file was copied: what is known of it holds for the copy."""
    status = os.stat(new)
    for cache in (_models, _clouds):
        for key in list(cache):
            file = key[0] if cache is _clouds else key
            if file[0] == old:
                moved = (new, status.st_mtime_ns, status.st_size, *file[3:])
                cache[(moved, key[1]) if cache is _clouds else moved] = cache.pop(key)


def _is_running(job):
    return job.poll()[0] == JobState.RUNNING


def remember_model(path, loaded):
    _keep_model(_file_key(path), loaded)


def _keep_model(key, loaded):
    _models[key] = loaded
    while len(_models) > _MAX_MODELS:
        _models.popitem(last=False)


def model_of(data):
    """The model of a datablock's source, without what its mask hides; masked ones are kept like others."""
    path, hidden = source_paths.file_of(data), masks.key(data)
    if not hidden:
        return model(path)
    key = (*_file_key(path), hidden)
    if key not in _models:
        _keep_model(key, model(path).masked(masks.read(data)))
    _models.move_to_end(key)
    return _models[key]


def decode(data, settings):
    """The cloud of a datablock's model at these settings; kept for the next image. Errors: StippleError, also for a
    source that has changed."""
    check_unchanged(data)
    key = _cloud_key(data, settings)
    cloud = _clouds.get(key)
    if cloud is None:
        cloud = _decoded(data, settings)
        _clouds[key] = cloud
        total = sum(k[1].anchors * k[1].gaussians_per_anchor for k in _clouds)
        while total > _MAX_CACHED_SPLATS and len(_clouds) > 1:
            (_, old), _dropped = _clouds.popitem(last=False)
            total -= old.anchors * old.gaussians_per_anchor
    _clouds.move_to_end(key)
    return cloud


def decode_data(data, settings):
    """The cloud that a datablock's source gives at these settings, without what was hidden or erased."""
    if source_settings.of(data.stipple).as_they_are:
        return masked(whole_cloud(data), data)
    return _decoded(data, settings)


def _decoded(data, settings):
    decoding = _decoding.get(data.name_full)
    if decoding is None or decoding.key != _cloud_key(data, settings):
        return erased.read(data).applied(model_of(data).decode(settings))
    del _decoding[data.name_full]
    decoding.job.wait()
    return erased.read(data).applied(Cloud.of_job(decoding.job))


def _cloud_key(data, settings):
    """What tells clouds apart."""
    return _file_key(source_paths.file_of(data)) + (masks.key(data), erased.key(data)), settings


@dataclass
class _Decoding:
    key: tuple
    job: Job
    ended: bool = False  # when is_decoding() asked last


def is_decoded(data, settings, patience):
    """Whether decode_data() will not take long. Where it would, decoding goes on in the library's own thread, for a
    later call; what was being decoded for the datablock at other settings is cancelled. patience: seconds that are
    waited for what begins now."""
    if not source_settings.of(data.stipple).counts_anchors or data.stipple.is_sequence:
        return True
    decoding = _decoding.get(data.name_full)
    try:
        key = _cloud_key(data, settings)
        if decoding is not None and decoding.key == key:
            return not _is_running(decoding.job)
        if decoding is not None:
            _decoding.pop(data.name_full).job.close()
        decoding = _decoding[data.name_full] = _Decoding(key, model_of(data).decode_start(settings))
    except StippleError:
        return True  # decoding says what is wrong
    until = time.perf_counter() + patience
    while _is_running(decoding.job):
        if time.perf_counter() >= until:
            return False
        time.sleep(0.001)
    return True


def is_decoding():
    """Whether clouds are being decoded that is_decoded() has been asked for. What nobody has taken since it was done is
    forgotten."""
    for name, decoding in list(_decoding.items()):
        if decoding.ended:
            del _decoding[name]
        decoding.ended = not _is_running(decoding.job)
    return bool(_decoding)


def decoding_share(data):
    """How much of a datablock's decoding is done, 0 to 1; None where none goes on."""
    decoding = _decoding.get(data.name_full)
    return None if decoding is None else decoding.job.poll()[1]


def whole_cloud(data):
    """All splats of a datablock's source, masked ones too; the last one is kept."""
    path = source_paths.file_of(data)
    key = _file_key(path)
    if key not in _whole:
        ahead = _whole_ahead.pop(key, None)
        cloud = _whole_reader(data, path)() if ahead is None else ahead.result()
        _whole.clear()
        _whole[key] = cloud
    return _whole[key]


def read_whole_ahead(data):
    """Begins to read what whole_cloud() gives, in a thread of its own. Returns whether that is at hand. Errors:
    StippleError."""
    path = source_paths.file_of(data)
    key = _file_key(path)
    if key in _whole:
        return True
    if key not in _whole_ahead:
        _whole_ahead.clear()  # one at a time is kept
        _whole_ahead[key] = Ahead(_whole_reader(data, path))
    if _whole_ahead[key].is_running():
        return False
    whole_cloud(data)
    return True


def _whole_reader(data, path):
    """A function that reads all splats of a source and never touches Blender."""
    if source_settings.of(data.stipple).counts_splats:
        tree, settings = model(path), DecodeSettings(data.stipple.source_count)
        return lambda: tree.decode(settings)
    native = context()
    return lambda: Cloud.load(native, path)


def full_cloud(data):
    """A datablock at full count: the whole source without what is hidden, splats of meshes at the render budget, and
    what is stored where there is no source. Not graded."""
    stipple = data.stipple
    settings = source_settings.of(stipple)
    if not settings.has_source or stipple.edited:
        return splat_data.ungraded_cloud(context(), data)
    return decode_data(data, decode_settings(stipple, 'FULL' if settings.counts_splats else 'RENDER'))


def count_of(data, budget):
    """Splats of a datablock at the budget 'RENDER' or 'FULL', without decoding."""
    stipple = data.stipple
    if source_settings.of(stipple).has_budget and not stipple.edited:
        settings = decode_settings(stipple, budget)
        return settings.anchors * settings.gaussians_per_anchor
    return splat_data.count(data)


def masked(cloud, data):
    """The splats of a source's whole cloud that stay. Errors: StippleError where the source has another count."""
    mask = masks.read(data)
    return cloud if mask is None else cloud_edit.keep(cloud, mask)


def decode_settings(stipple, mode='VIEWPORT', scene=None):
    """The settings of a datablock as the binding takes them; mode 'RENDER' takes the render budget. scene: whose frame
    tells the time, None for the present one. What the source does not have is as it is in new settings."""
    known = source_settings.of(stipple)
    if known.counts_splats:
        budget = _tree_budget(stipple, mode)
    else:
        budget = (mode == 'RENDER' and stipple.anchors_render) or stipple.anchors
    return DecodeSettings(budget, gaussians_per_anchor(stipple),
                          AnchorOrder[stipple.order] if known.has_order else AnchorOrder.SYSTEMATIC,
                          stipple.seed if known.has_seed else 0, seconds(stipple, scene) if known.has_time else 0.0)


def gaussians_per_anchor(stipple):
    """Splats that each anchor becomes: what is chosen, where there is a choice."""
    known = source_settings.of(stipple)
    return stipple.gaussians_per_anchor if known.min_gaussians < known.max_gaussians else known.default_gaussians


def seconds(stipple, scene=None):
    """The time of splats that move: 0 where their series starts, as frame_start and frame_speed have it."""
    scene = bpy.context.scene if scene is None else scene
    frames = scene.frame_current + scene.frame_subframe - stipple.frame_start
    return frames * stipple.frame_speed * scene.render.fps_base / scene.render.fps


def at_most(settings, most, least=1):
    """The settings for that many splats at most, but not for a budget below `least`; most: None for as they are."""
    if most is None:
        return settings
    return replace(settings, anchors=min(settings.anchors, max(least, most // settings.gaussians_per_anchor)))


def _tree_budget(stipple, mode):
    """Splats of a tree in a mode: 'VIEWPORT', 'RENDER' or 'FULL'; never more than there are."""
    total = visible_count(stipple)
    if mode == 'FULL':
        return total
    if stipple.budget_by == 'RATIO':
        return max(1, round(total * (stipple.ratio_render if mode == 'RENDER' else stipple.ratio)))
    count = stipple.anchors_render if mode == 'RENDER' and stipple.anchors_render != 0 else stipple.anchors
    return min(count, total)


def visible_count(stipple):
    """Splats of a tree that are not hidden."""
    counts = masks.counts(stipple.id_data)
    return stipple.source_count if counts is None else counts[1]


def cloud_from_object(obj):
    """The cloud of an object's attributes as they are, evaluated where the object is: graded."""
    return splat_data.cloud(context(), obj.data, obj.original.data)


def ungraded_cloud(obj):
    """The same without the grade of the attributes."""
    return splat_data.ungraded_cloud(context(), obj.data, obj.original.data)


def save_model(built, path, overwrite=False):
    """Writes a model and returns its path. Another file of that name stays: the new one gets a number,
    unless it is the same to the byte. Errors: StippleError for a folder that cannot be written."""
    return _save(built.save, path, MODEL_SUFFIX, overwrite)


def save_cloud(cloud, name):
    """Writes splats as a source of their own, beside the other sources; returns the path."""
    path = source_paths.place_for(name)[:-len(MODEL_SUFFIX)] + '.ply'
    # In its own frame: the source is what the object shows, number by number.
    return _save(lambda to: cloud.save(to, frame=cloud.info().frame), path, '.ply', False)


def attach_tree(data, path, count):
    """Notes a splat tree of this many splats as the source of a datablock; its mask stays."""
    _end_edits(data)
    stipple = data.stipple
    stipple.source = source_paths.stored(path)
    stipple.source_stamp = stamp(path)
    source_settings.note_tree(stipple)
    stipple.source_count = count
    stipple.is_sequence = False
    stipple.source_objects.clear()
    stipple.source_changed = stipple.edited = False


def attach_cloud(data, path):
    """Notes a splat file as the source of a datablock, all of it shown."""
    _end_edits(data)
    stipple = data.stipple
    stipple.source = source_paths.stored(path)
    stipple.source_stamp = stamp(path)
    source_settings.note_cloud(stipple)
    stipple.is_sequence = False
    stipple.source_objects.clear()
    stipple.source_changed = stipple.edited = False
    masks.clear(data)


def _end_edits(data):
    """A new source of splats holds what was left of the one before, and nothing of it is selected."""
    erased.clear(data)
    selections.clear(data)


def _save(write, path, suffix, overwrite):
    folder = os.path.dirname(path)
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError as error:
        raise StippleError(f"The folder '{folder}' cannot be made: {error.strerror}.", Status.ERROR_IO) from None
    if overwrite or not os.path.exists(path):
        write(path)
        return path
    stem = path[:-len(suffix)] if path.endswith(suffix) else os.path.splitext(path)[0]
    fresh = f'{stem}.{os.getpid()}.new{suffix}'
    write(fresh)
    try:
        for number in range(1, 1000):
            if not os.path.exists(path):
                os.rename(fresh, path)
                return path
            if filecmp.cmp(fresh, path, shallow=False):
                return path
            path = f'{stem}.{number:03d}{suffix}'
    finally:
        if os.path.exists(fresh):
            os.remove(fresh)
    raise StippleError(f"'{stem}' has 1,000 numbered sources already; remove some of them.", Status.ERROR_IO)


def first_settings(settings):
    """How an asset is shown at first. In: settings, StippleModelSettings."""
    known = source_settings.of_model(settings)
    budget = min(known.default_budget, FIRST_COUNT) if known.counts_splats else known.default_budget
    return DecodeSettings(budget, known.default_gaussians)


def attach_asset(data, path, settings):
    """Notes an asset file as the source of a new datablock, with the budget of first_settings(). In: settings,
    StippleModelSettings."""
    stipple, first = data.stipple, first_settings(settings)
    attach_model(data, path, [], settings)
    if source_settings.of(stipple).counts_splats:
        stipple.source_count = settings.maximum_budget
        stipple.ratio, stipple.ratio_render = first.anchors / settings.maximum_budget, 1.0
    else:
        stipple.anchors = first.anchors


def attach_model(data, path, objects, settings):
    """Notes a model as the source of a datablock, with the meshes and settings that it was made from. In: settings,
    StippleModelSettings."""
    stipple = data.stipple
    source_settings.note_model(stipple, source_settings.of_model(settings))
    stipple.source = source_paths.stored(path)
    stipple.source_stamp = stamp(path)
    stipple.source_detail_weight = stipple.detail_weight
    stipple.source_color_from = stipple.color_from
    stipple.is_sequence = False
    stipple.source_objects.clear()
    for obj in objects:
        stipple.source_objects.add().object = obj
    stipple.source_fingerprint = meshes.fingerprint(objects)
    stipple.source_changed = False
    stipple.edited = False


def _file_key(path):
    try:
        status = os.stat(path)
    except OSError as error:
        raise StippleError(f"The splats' source '{path}' cannot be read: {error.strerror}.", Status.ERROR_IO) from None
    return path, status.st_mtime_ns, status.st_size
