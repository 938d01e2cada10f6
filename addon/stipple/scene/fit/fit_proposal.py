# SPDX-License-Identifier: GPL-3.0-or-later
"""The object that a fit makes, until it is accepted: what it was fitted to comes back when it is discarded.

Only visibility in the viewport changes by the way. Renders show the source until the proposal is accepted.
"""

import bpy

# Names of the objects that the splats were fitted to and that were visible then, one a line.
SOURCES_KEY = 'stipple_fit_sources'
PROPOSED_KEY = 'stipple_fit_proposed'
# Frames of the scene at which the key frames of a long shot stand, until it is accepted.
KEY_FRAMES_KEY = 'stipple_fit_key_frames'


def new_object(context, obj, names, matrix):
    """Links the object of a fit. In: names of what it is fitted to; matrix, to the world."""
    obj.matrix_world = matrix
    obj[SOURCES_KEY] = '\n'.join(names)
    context.collection.objects.link(obj)
    show(context, obj, context.scene.stipple.fit.shown)


def visible_names(objects):
    return [obj.name for obj in objects if not obj.hide_get()]


def propose(obj):
    """Lets a fit's object wait for a decision."""
    obj[PROPOSED_KEY] = 1 + max((_made_at(other) for other in bpy.data.objects if PROPOSED_KEY in other), default=0)


def remember_key_frames(obj, frames):
    """Of a long shot: they become markers of the timeline when it is accepted."""
    if frames:
        obj[KEY_FRAMES_KEY] = list(frames)


def find(context):
    """The object that waits for a decision, or None. No fit starts while one waits; where a file has several, as after
    an append, the active one is meant, else the last that was made."""
    waiting = [obj for obj in context.view_layer.objects if obj is not None and PROPOSED_KEY in obj]
    active = context.view_layer.objects.active
    return active if active in waiting else max(waiting, key=_made_at, default=None)


def comparable(context):
    """The object of a fit, running or waiting, whose source can be shown in its place, or None."""
    shown = find(context)
    if shown is not None and shown.get(SOURCES_KEY):
        return shown
    return next((obj for obj in context.view_layer.objects if obj is not None and obj.get(SOURCES_KEY)), None)


def on_shown_change(settings, context):
    """Update function of the choice what is shown."""
    obj = comparable(context)
    if obj is not None:
        show(context, obj, settings.shown)


def show(context, obj, which):
    """which: 'SPLATS', 'SOURCE' or 'BOTH'. What came from photographs has no source to show."""
    found = _sources(context, obj)
    obj.hide_set(which == 'SOURCE' and bool(found))
    for source in found:
        source.hide_set(which == 'SPLATS')


def accept(context, obj, hide_source):
    for source in _sources(context, obj):
        source.hide_set(hide_source)
        if hide_source:
            source.select_set(False)
            source.hide_render = True
    obj.hide_set(False)
    for number, frame in enumerate(obj.get(KEY_FRAMES_KEY, ()), 1):
        context.scene.timeline_markers.new(f'{obj.name} {number}', frame=round(frame))
    for key in (PROPOSED_KEY, SOURCES_KEY, KEY_FRAMES_KEY):
        if key in obj:
            del obj[key]
    obj.select_set(True)
    context.view_layer.objects.active = obj


def discard(context, obj):
    for source in _sources(context, obj):
        source.hide_set(False)
    data = obj.data
    (bpy.data.pointclouds if isinstance(data, bpy.types.PointCloud) else bpy.data.meshes).remove(data)


def _made_at(obj):
    """Which of the waiting objects it is, in the order in which they were made; files of older versions have True."""
    return int(obj[PROPOSED_KEY])


def _sources(context, obj):
    objects = context.view_layer.objects
    return [objects[name] for name in obj.get(SOURCES_KEY, '').split('\n') if name and name in objects]
