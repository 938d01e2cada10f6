# SPDX-License-Identifier: GPL-3.0-or-later
"""Sources of splats: the native context, and models read from asset files.

Models are kept in native memory, keyed by the file's identity. decoded.py makes clouds of them. Nothing here writes
Blender data.
"""

import filecmp
import os
import time
import zlib
from collections import OrderedDict
from dataclasses import replace

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

# What tells whether a file has changed: its size and this many samples, the first and the last byte among them.
_SAMPLE_BYTES = 1 << 16
_MAX_SAMPLES = 32

_contexts = {}
_stamps = {}
_models = OrderedDict()
_reading = {}  # jobs of models that were asked for, by the same keys
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
    _contexts[key].set_weights_folder(preferences.chosen_weights_folder())
    _contexts[key].set_shipped_weights_folder(preferences.shipped_weights_folder())
    return _contexts[key]


def forget():
    """Gives the memory of sources back; decoded.forget() gives all."""
    for job in _reading.values():
        job.close()
    _reading.clear()
    _whole.clear()
    _whole_ahead.clear()
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
    return _reader(path, '', None)(Job.wait)


def model_reader(data):
    """A function of wait(job) that gives model_of(data) and never touches Blender, so that a worker may call it. wait:
    called with the job that reads the file, where it has to be read. Errors: StippleError, by the function too."""
    hidden = masks.key(data)
    return _reader(source_paths.file_of(data), hidden, masks.read(data) if hidden else None)


def _reader(path, hidden, mask):
    """hidden: the key of the mask, '' for none."""
    file = _file_key(path)
    key = (*file, hidden) if hidden else file
    native = None if key in _models or file in _models else context()

    def read(wait):
        known = _models.get(key)
        if known is None:
            known = _models.get(file)
            if known is None:
                known = _of_file(path, file, native or context(), wait)
            if mask is not None:
                known = known.masked(mask)
        _keep_model(key, known)
        return known
    return read


def _of_file(path, key, native, wait):
    job = _reading.pop(key, None) or Model.load_start(native, path)
    wait(job)
    job.wait()
    known = Model.of_job(job)
    _keep_model(key, known)
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
    renamed = moved(old, new)
    for key in list(_models):
        if renamed(key) is not None:
            _models[renamed(key)] = _models.pop(key)


def moved(old, new):
    """A function from a key that begins with a file's identity to the one of the copied file; it gives None for keys of
    other files."""
    status = os.stat(new)
    return lambda key: (new, status.st_mtime_ns, status.st_size, *key[3:]) if key[0] == old else None


def _is_running(job):
    return job.poll()[0] == JobState.RUNNING


def remember_model(path, loaded):
    _keep_model(_file_key(path), loaded)


def _keep_model(key, loaded):
    _models.pop(key, None)
    _models[key] = loaded  # at the end
    while len(_models) > _MAX_MODELS:
        _models.popitem(last=False)


def model_of(data):
    """The model of a datablock's source, without what its mask hides; masked ones are kept like others."""
    return model_reader(data)(Job.wait)


def source_key(data):
    """What tells a datablock's source from others, and from itself with other splats hidden or erased; its path comes
    first. Errors: StippleError."""
    return _file_key(source_paths.file_of(data)) + (masks.key(data), erased.key(data))


def whole_cloud(data):
    """All splats of a datablock's source, masked ones too, and those that move where they are now; the last one is
    kept."""
    path, settings = source_paths.file_of(data), _whole_settings(data)
    key = (*_file_key(path), settings)
    if key not in _whole:
        ahead = _whole_ahead.pop(key, None)
        cloud = _whole_reader(path, settings)() if ahead is None else ahead.result()
        _whole.clear()
        _whole[key] = cloud
    return _whole[key]


def read_whole_ahead(data):
    """Begins to read what whole_cloud() gives, in a thread of its own. Returns whether that is at hand. Errors:
    StippleError."""
    path, settings = source_paths.file_of(data), _whole_settings(data)
    key = (*_file_key(path), settings)
    if key in _whole:
        return True
    if key not in _whole_ahead:
        _whole_ahead.clear()  # one at a time is kept
        _whole_ahead[key] = Ahead(_whole_reader(path, settings))
    if _whole_ahead[key].is_running():
        return False
    whole_cloud(data)
    return True


def _whole_settings(data):
    """DecodeSettings of all splats of a model, None of a file of splats."""
    stipple = data.stipple
    known = source_settings.of(stipple)
    if not known.counts_splats:
        return None
    return DecodeSettings(stipple.source_count, time=seconds(stipple) if known.has_time else 0.0)


def _whole_reader(path, settings):
    """A function that reads all splats of a source and never touches Blender."""
    if settings is not None:
        source = model(path)
        return lambda: source.decode(settings)
    native = context()
    return lambda: Cloud.load(native, path)


def count_of(data, budget):
    """Splats of a datablock at the budget 'RENDER' or 'FULL', without decoding."""
    stipple = data.stipple
    if source_settings.of(stipple).has_budget and not stipple.edited:
        return decode_settings(stipple, budget).most_splats
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
        budget = max(_tree_budget(stipple, mode), min(known.least_budget, visible_count(stipple)))
    else:
        budget = detailed((mode == 'RENDER' and stipple.anchors_render) or stipple.anchors, stipple)
        budget = min(budget, known.most_budget or budget)
    return DecodeSettings(budget, gaussians_per_anchor(stipple),
                          AnchorOrder[stipple.order] if known.has_order else AnchorOrder.SYSTEMATIC,
                          stipple.seed if known.has_seed else 0, seconds(stipple, scene) if known.has_time else 0.0,
                          known.has_smooth and stipple.smooth_budget and mode != 'FULL')


def detailed(budget, stipple):
    """A budget of a datablock with its Detail, which doubles it for each 1."""
    return budget if stipple.detail == 0 else max(1, round(budget * 2.0 ** stipple.detail))


def gaussians_per_anchor(stipple):
    """Splats that each anchor becomes: what is chosen, where there is a choice."""
    known = source_settings.of(stipple)
    return stipple.gaussians_per_anchor if known.min_gaussians < known.max_gaussians else known.default_gaussians


def seconds(stipple, scene=None):
    """The time of splats that move, of their own clip: its begin at frame_start, the other settings as in a series of
    files."""
    scene, known = bpy.context.scene if scene is None else scene, source_settings.of(stipple)
    frame = scene.render.fps_base / scene.render.fps
    frames = (scene.frame_current + scene.frame_subframe - stipple.frame_start) * stipple.frame_speed
    passed, length = (frames + stipple.frame_offset) * frame, known.time_end - known.time_begin
    if length > 0 and stipple.time_mode == 'REPEAT':
        passed %= length + frame  # the last moment lasts a frame, like all others
    elif length > 0 and stipple.time_mode == 'PING_PONG':
        passed %= 2 * length
        passed = min(passed, 2 * length - passed)
    return known.time_begin + passed


def at_most(settings, most, least=1):
    """The settings for that many splats at most, but not for a budget below `least`; most: None for as they are."""
    if most is None:
        return settings
    each = replace(settings, anchors=1).most_splats
    return replace(settings, anchors=min(settings.anchors, max(least, most // each)))


def _tree_budget(stipple, mode):
    """Splats of a tree in a mode: 'VIEWPORT', 'RENDER' or 'FULL'; never more than there are."""
    total = visible_count(stipple)
    if mode == 'FULL':
        return total
    if stipple.budget_by == 'RATIO':
        share = 2.0 ** stipple.detail * (stipple.ratio_render if mode == 'RENDER' else stipple.ratio)
        return min(total, max(1, round(total * share)))
    count = stipple.anchors_render if mode == 'RENDER' and stipple.anchors_render != 0 else stipple.anchors
    return min(detailed(count, stipple), total)


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
    budget = known.default_budget
    if known.counts_splats:
        budget = max(min(budget, FIRST_COUNT), known.least_budget)
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
    stipple.source_bake = (stipple.bake_size, stipple.bake_samples)
    stipple.source_bake_views = stipple.bake_views
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
