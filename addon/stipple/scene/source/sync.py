# SPDX-License-Identifier: GPL-3.0-or-later
"""Keeps the stored splats equal to (source, settings).

One function writes: sync(). It is called when a property changes, and by the handlers below: a
property's update function is not called when the property is animated, undone or loaded.
"""

import sys
import time

import bpy
from bpy.app.handlers import persistent

from ... import late, log
from ...binding.errors import CancelledError, StippleError
from .. import grades, handlers, limits, meshes
from ..sequence import sequences
from . import (bound, decode_progress, decoded, erased, masks, selections, source_paths, source_settings, sources,
               splat_data)

WRITTEN_KEY = 'stipple_written'
FINGERPRINT_KEY = 'stipple_fingerprint'

ENGINE = 'STIPPLE'
CYCLES_ENGINE = 'STIPPLE_CYCLES'
MOVE_SECONDS = 0.05  # that one move of a slider may take
REST_SECONDS = 0.25  # after which a slider rests
POLL_SECONDS = 0.1   # between two looks at what is decoded beside Blender
FEW = 1000           # fewer splats say nothing about the time that each takes

# What is wrong with a datablock, by name, for the panel; empty while all is well.
problems = {}
# limited: whether Max Splats counted when the viewport was evaluated last.
# seconds_per_splat: how long decoding and writing took last, of what takes time in proportion to its splats; the first
# value is a slow machine's.
_state = {'paused': 0, 'rendering': False, 'seconds_per_splat': 1e-6, 'limited': False}


class paused:
    """While it lasts, changing settings does not decode (an operator sets several, then syncs once)."""

    def __enter__(self):
        _state['paused'] += 1

    def __exit__(self, *_):
        _state['paused'] -= 1


def sync(obj, depsgraph, mode, most=None, share=None, beside=False, wait=None):
    """Writes the attributes that an object's data should have now. Returns True where it wrote.

    depsgraph: evaluated settings (animation, drivers) are read through it; None: the settings as they are.
    mode: 'VIEWPORT' or 'RENDER'. most: splats that are written at most while a slider is dragged, None for all.
    share: of Max Splats, None to look it up. beside: decoding that takes long goes on beside Blender, and a later call
    writes (decoded.is_decoding); else wait(job) is called with what takes long, where it is given. Errors:
    StippleError, with the splats as they were.
    """
    data = obj.data
    stipple = data.stipple
    grade = grades.settings_of(_evaluated(data, depsgraph))
    if not source_settings.of(stipple).has_source or not stipple.source or stipple.edited:
        return regrade(data, grade)
    if mode == 'RENDER' and bpy.app.background:
        # Nobody sees a panel that says what is wrong, so old splats must not pass for the source's.
        sources.check_unchanged(data)
    limit = (limits.share(depsgraph, mode) if share is None else share).most(data)
    key, decode, is_ready = _wanted(data, depsgraph, mode, most, limit, wait)
    if data.get(WRITTEN_KEY) == key:
        if beside:
            decoded.settle(data)
        return regrade(data, grade)
    if is_edited(data):
        stipple.edited = True
        raise StippleError(f"The splats of '{data.name}' were edited by hand; use them as a new source, or revert to "
                           'the source, to change their settings.')
    begin = time.perf_counter()
    if beside and not is_ready():
        return False
    splats = decode()
    write(data, splats, key, grade)
    if splats.count >= FEW and not source_settings.of(stipple).is_learned:
        _state['seconds_per_splat'] = (time.perf_counter() - begin) / splats.count
    return True


def _wanted(data, depsgraph, mode, most, limit, wait):
    """(key of the splats that a datablock should have now, function that makes them, function that says whether that
    takes no time). most: while a slider is dragged. limit: of Max Splats."""
    stipple = _evaluated(data, depsgraph)
    scene = bpy.context.scene if depsgraph is None else depsgraph.scene
    if stipple.is_sequence:
        least = min((number for number in (most, limit) if number is not None), default=None)
        frame = sequences.frame_of(data, stipple, scene.frame_current, mode, least)
        return frame.key, frame.splats, lambda: True
    known = source_settings.of(stipple)
    settings = sources.at_most(sources.decode_settings(stipple, mode, scene), limit, known.least_budget)
    # What networks make of few anchors is another picture: there is none before one that takes long, and no smaller
    # one than they have learned.
    if most is not None and (not known.is_learned or decoded.is_quick(data, settings)):
        settings = sources.at_most(settings, most, max(known.least_budget, known.least_learned))
    carrier = bound.carrier(data, depsgraph)
    return (written_key(data, settings, carrier), lambda: _decoded(data, settings, wait, carrier),
            lambda: decoded.is_decoded(data, settings))


def _decoded(data, settings, wait, carrier):
    settings.check()
    sources.check_unchanged(data)
    made = decoded.decode_data(data, settings, wait, carrier).columns()
    if not masks.key(data) and not erased.any_of(data):
        made.seen = splat_data.kept_seen(data, source_paths.identity(data.stipple), made.count)
    return made


def regrade(data, grade):
    """Gives the stored splats another grade, edited ones too. Returns True where it wrote. Errors: StippleError."""
    if grades.is_shown(data, grade):
        return False
    edited = is_edited(data)
    grades.write_again(data, grade)
    if not edited and FINGERPRINT_KEY in data:
        data[FINGERPRINT_KEY] = splat_data.fingerprint(data)
    return True


def write(data, splats, key, grade=None):
    """Stores splats (SplatArrays or CloudColumns), which are not graded, together with what they were made from. grade:
    None for the present one."""
    grades.write(data, splats, grades.settings_of(data.stipple) if grade is None else grade)
    data[FINGERPRINT_KEY] = splat_data.fingerprint(data)
    data[WRITTEN_KEY] = key


def write_decoded(data, splats):
    """Stores splats that were decoded with the present settings; their mesh carries them from there."""
    splat_data.keep_seen(data, source_paths.identity(data.stipple), splats.seen)
    write(data, splats, written_key(data, sources.decode_settings(data.stipple)))
    users = [obj for obj in bpy.data.objects if obj.data == data]
    if users and bound.follows(data):
        try_sync(users[0], None, 'VIEWPORT')


def write_shown(data):
    """Stores what a series shows at the present frame of the scene. Errors: StippleError for its file."""
    frame = sequences.frame_of(data, data.stipple, bpy.context.scene.frame_current, 'VIEWPORT')
    write(data, frame.splats(), frame.key)


def written_key(data, settings, carrier=None):
    """A text that is equal for equal splats. carrier: of the mesh that carries them."""
    known = source_settings.of(data.stipple)
    if known.as_they_are:
        return masks.key(data) if carrier is None else f'{masks.key(data)}|{carrier.key}'
    parts = [source_paths.identity(data.stipple), settings.anchors]
    if known.counts_anchors:
        parts += [settings.gaussians_per_anchor, int(settings.order), settings.seed]
    if known.takes_mask:
        parts.append(masks.key(data))
    if known.has_time:
        parts.append(f'{settings.time!r} s')
    if settings.smooth:
        parts.append('smooth')
    if erased.any_of(data):
        parts.append(erased.key(data))
    if carrier is not None:
        parts.append(carrier.key)
    return '|'.join(map(str, parts))


def copy_settings(old, new):
    """All settings of one splat datablock to another, animation included."""
    for name in old.stipple.bl_rna.properties.keys():
        if name not in {'rna_type', 'name', 'source_objects'}:
            setattr(new.stipple, name, getattr(old.stipple, name))
    for entry in old.stipple.source_objects:
        new.stipple.source_objects.add().object = entry.object
    for part in (masks, erased, selections):
        part.copy(old, new)
    if old.animation_data is not None and old.animation_data.action is not None:
        new.animation_data_create().action = old.animation_data.action


def is_stored(data, settings, carrier=None):
    """Whether the attributes are the splats of these settings."""
    return data.get(WRITTEN_KEY) == written_key(data, settings, carrier) and not is_edited(data)


def is_edited(data):
    """True where the attributes are not the ones that were written last."""
    known = data.get(FINGERPRINT_KEY)
    return known is not None and known != splat_data.fingerprint(data)


def on_property_change(stipple, _context):
    """Update function of the settings: decodes at once."""
    if _state['paused'] or _state['rendering']:
        return
    data = stipple.id_data
    decoded.allow(data)
    users = [obj for obj in bpy.data.objects if obj.data == data]
    if users and bpy.app.background:
        if limits.limit(bpy.context.scene, 'VIEWPORT') is None:
            try_sync(users[0], None, 'VIEWPORT')
        else:
            sync_all()  # what one object shows, others cannot
    elif users:
        follow(users[0])


def on_limit_change(_scene, _context):
    """Update function of Max Splats."""
    if _state['paused'] or _state['rendering']:
        return
    if bpy.app.background:
        sync_all()
    else:
        follow_later()


def follow(obj):
    """Follows a slider: what cannot be written within MOVE_SECONDS is left out until the slider rests."""
    most = int(MOVE_SECONDS / _state['seconds_per_splat'])
    # The first move after a file is opened does not wait for a tree of gigabytes either.
    if sources.is_at_hand(obj.data, MOVE_SECONDS):
        try_sync(obj, None, 'VIEWPORT', most, beside=True)
    follow_later()


def follow_later():
    """What is shown follows its settings when no more of them change, without anybody waiting for it."""
    if bpy.app.timers.is_registered(complete):
        bpy.app.timers.unregister(complete)
    bpy.app.timers.register(complete, first_interval=REST_SECONDS)


def complete():
    """The slider rests: all splats of the budget. A timer's function: it returns when to be called again, None to
    end."""
    if sources.is_reading():
        return REST_SECONDS
    if _state['rendering']:
        return None  # its end calls again
    alive = {obj.data.name_full for obj in splat_objects()}
    for name in decoded.names():
        if name not in alive:
            decoded.stop(name)
    if decoded.has_ended():
        sync_all(beside=True)
    is_busy = decoded.is_decoding()
    decode_progress.show(is_busy)
    if sources.is_reading():
        return REST_SECONDS
    return POLL_SECONDS if is_busy else None


def _has_views():
    """Whether somebody looks on while splats are decoded."""
    return not bpy.app.background


def _follow_all(depsgraph=None):
    """Everything follows its settings: at once what is quick, and all in background mode; else what takes long is
    decoded beside Blender."""
    beside = _has_views()
    sync_all(depsgraph, beside=beside)
    if beside and (decoded.is_decoding() or sources.is_reading()) and not bpy.app.timers.is_registered(complete):
        bpy.app.timers.register(complete, first_interval=POLL_SECONDS)


def try_sync(obj, depsgraph, mode, most=None, share=None, beside=False, wait=None):
    """sync() for callers that cannot fail: what goes wrong is kept for the panel and logged once.

    In background a render has no panel, and an engine of Blender's own draws what is stored: there the process ends
    with one line and status 1 instead, before a wrong image is written.
    """
    name = obj.data.name
    try:
        sync(obj, depsgraph, mode, most, share, beside, wait)
        problems.pop(name, None)
    except CancelledError:
        problems.pop(name, None)  # the splats are as they were, by somebody's wish
    except StippleError as error:
        if mode == 'RENDER' and bpy.app.background:
            sys.exit(f'Error: {name}: {error}')
        if problems.get(name) != str(error):
            log.error('%s: %s', name, error)
        problems[name] = str(error)


def splat_objects():
    """One object for every splat datablock that has users in this file."""
    found = {}
    for obj in bpy.data.objects:
        if splat_data.is_splat_object(obj):
            found.setdefault(obj.data.name_full, obj)
    return found.values()


def sync_all(depsgraph=None, mode='VIEWPORT', beside=False, wait=None):
    if _state['paused']:
        return
    objects = list(splat_objects())
    share = limits.share(depsgraph, mode) if objects else None
    for obj in objects:
        try_sync(obj, depsgraph, mode, share=share, beside=beside, wait=wait)


def _evaluated(data, depsgraph):
    """The settings as animation and drivers have them."""
    return data.stipple if depsgraph is None else data.evaluated_get(depsgraph).stipple


@persistent
def _frame_change_post(scene, depsgraph):
    """Blender evaluates once more after this where data was tagged, so writing here is in time for the frame.

    A render brings its own depsgraph, in stills too; after it the viewport's comes again.
    """
    if depsgraph.mode == 'VIEWPORT':
        _follow_limit(scene, depsgraph)
        _follow_all(depsgraph)
    elif scene.render.engine not in {ENGINE, CYCLES_ENGINE}:
        # Our engines decode and grade for themselves; every other one draws the stored attributes.
        sync_all(depsgraph, 'RENDER', wait=decode_progress.wait_in_render)
    else:
        _regrade_modified(depsgraph)


def _regrade_modified(depsgraph):
    """Modifiers see attributes under every engine."""
    for obj in list(splat_objects()):
        if len(obj.modifiers) and not _state['paused']:
            regrade(obj.data, grades.settings_of(_evaluated(obj.data, depsgraph)))


@persistent
def _render_init(_scene, _=None):
    _state['rendering'] = True


@persistent
def _render_end(_scene, _=None):
    """Gives the viewport its budget back: a still that was rendered in a window changes no frame."""
    _state['rendering'] = False
    _follow_all()


@persistent
def _restored(*_):
    """After undo, redo and loading: splats that do not fit their settings are decoded again."""
    problems.clear()
    if late.is_loaded(limits):
        limits.forget()
    _state['rendering'] = False
    _show_boxes(True)
    _follow_all()


@persistent
def _load_pre(*_):
    if late.is_loaded(decoded):
        decoded.abandon()
    if late.is_loaded(decode_progress):
        decode_progress.forget()


@persistent
def _save_pre(*_):
    """A file that is opened without the add-on shows the splats' centres."""
    _show_boxes(False)


@persistent
def _save_post(*_):
    _show_boxes(True)


def _show_boxes(box):
    if not bpy.app.background:
        for obj in bpy.data.objects:
            if splat_data.is_splat_object(obj):
                splat_data.show_as_box(obj, box)


def _follow_limit(scene, depsgraph):
    """Notes what Max Splats is shared between. Returns whether it has to be shared anew."""
    was_limited = _state['limited']
    _state['limited'] = limits.limit(scene, 'VIEWPORT') is not None
    if _state['limited']:
        limits.note(depsgraph)
    return _state['limited'] or was_limited


@persistent
def _depsgraph_update_post(scene, depsgraph):
    """Notices when the mesh that splats were made from changes, and when others show under Max Splats."""
    if _state['rendering'] or depsgraph.mode != 'VIEWPORT':
        return
    if _follow_limit(scene, depsgraph) and not bpy.app.timers.is_registered(complete):
        _follow_all(depsgraph)
    if not any(update.is_updated_geometry for update in depsgraph.updates):
        return
    changed = {update.id.original for update in depsgraph.updates
               if update.is_updated_geometry and isinstance(update.id, bpy.types.Object)}
    for obj in splat_objects():
        stipple = obj.data.stipple
        if bound.follows(obj.data) and stipple.bind_object in changed:
            # By a handler of changed frames where that made it: then this finds nothing to do.
            try_sync(obj, depsgraph, 'VIEWPORT', beside=_has_views())
        if stipple.source_changed or obj.data.library is not None:
            continue
        objects = [entry.object for entry in stipple.source_objects if entry.object is not None]
        if changed.intersection(objects) and meshes.fingerprint(objects) != stipple.source_fingerprint:
            stipple.source_changed = True


_HANDLERS = (('frame_change_post', _frame_change_post), ('render_init', _render_init),
             ('render_complete', _render_end), ('render_cancel', _render_end), ('undo_post', _restored),
             ('redo_post', _restored), ('load_pre', _load_pre), ('load_post', _restored), ('save_pre', _save_pre),
             ('save_post', _save_post), ('depsgraph_update_post', _depsgraph_update_post))


def register():
    handlers.add(_HANDLERS)


def unregister():
    handlers.remove(_HANDLERS)
    if bpy.app.timers.is_registered(complete):
        bpy.app.timers.unregister(complete)
    problems.clear()
    for module in (sequences, decoded, bound, sources):
        if late.is_loaded(module):
            module.forget()
