# SPDX-License-Identifier: GPL-3.0-or-later
"""Which splats go into a file, where, and how many."""

import os
import re

import bpy
import numpy as np

from ...binding import cloud_edit, structs
from ...binding.errors import StippleError, invalid
from .. import grades
from ..sequence import frames, sequences
from . import bound, decoded, formats, placement, source_settings, sources, splat_data, sync


BUDGETS = (('VIEWPORT', "Viewport", "The splats that are shown now"),
           ('RENDER', "Render", "The splats that renders show"),
           ('FULL', "Full", "All splats of the source that are not hidden"))


def any_splats(context):
    return any(splat_data.is_splat_object(obj) for obj in context.scene.objects)


def chosen(context, collection, selected_only):
    """The splat objects to write, the active one first. Errors: StippleError for none."""
    if collection:
        owner = bpy.data.collections.get(collection)
        if owner is None:
            raise invalid(f"There is no collection '{collection}'.")
        candidates = owner.all_objects
    elif selected_only:
        candidates = context.view_layer.objects.selected
    else:
        candidates = [obj for obj in context.view_layer.objects if obj.visible_get()]
    active = context.view_layer.objects.active
    found = sorted((obj for obj in candidates if splat_data.is_splat_object(obj)), key=lambda obj: obj != active)
    if not found:
        where = f"collection '{collection}'" if collection else 'selection' if selected_only else 'scene'
        raise invalid(f'There are no splats in the {where}; at least one splat object is needed.')
    return found


def placed_clouds(context, objects, budget, apply_transform, apply_grade=True):
    """([(cloud, 4x4 matrix)], frame that the matrices lead to): the world, or the first object's own space."""
    depsgraph = context.evaluated_depsgraph_get()
    evaluated = [obj.evaluated_get(depsgraph) for obj in objects]
    if apply_transform or len(objects) > 1:
        placed = [(cloud_at(obj, budget, apply_grade), placement.matrix_of(obj)) for obj in evaluated]
    else:
        placed = [(cloud_at(obj, budget, apply_grade), np.array(obj.matrix_world)) for obj in evaluated]
    return in_frame(placed, apply_transform)


def in_frame(placed, apply_transform):
    """placed_clouds() of [(cloud, object to world)]."""
    first, matrix = placed[0]
    if apply_transform:
        upright = frames.of_matrix(matrix) if len(placed) == 1 else None
        if upright is not None:
            # Only turned upright: naming the frame instead keeps every bit.
            return [(first, np.eye(4))], upright
        return placed, frames.WORLD
    inverse = np.linalg.inv(matrix) if len(placed) > 1 else None
    return [(first, np.eye(4))] + [(cloud, inverse @ other) for cloud, other in placed[1:]], first.info().frame


def make_folder(path):
    """The folder of a file whose name is fixed by its format, such as that of a_0001/meta.json."""
    folder = os.path.dirname(path)
    try:
        os.mkdir(folder)
    except FileExistsError:
        pass
    except OSError as error:
        raise StippleError(f"The folder '{folder}' cannot be made: {error.strerror}.",
                           structs.Status.ERROR_IO) from None


def joined(placed):
    """One cloud of placed_clouds()."""
    instances, frame = placed
    if len(instances) == 1 and np.array_equal(instances[0][1], np.eye(4)) and instances[0][0].info().frame == frame:
        return instances[0][0]
    return cloud_edit.merge(instances, frame)


def cloud_at(obj, budget, apply_grade=True):
    """The splats of an evaluated object at one of BUDGETS."""
    data = obj.original.data
    cloud = None
    if not (budget == 'VIEWPORT' or not source_settings.of(data.stipple).has_source or data.stipple.edited
            or sync.is_edited(data)):
        cloud = _decoded(obj, data, budget)
    if cloud is None:
        return sources.cloud_from_object(obj) if apply_grade else sources.ungraded_cloud(obj)
    return grades.apply(cloud, obj.data.stipple) if apply_grade else cloud


def _decoded(obj, data, budget):
    """The splats of a source at a budget, not graded; None for a series that shows nothing."""
    if data.stipple.is_sequence:
        return sequences.frame_of(data, obj.data.stipple, bpy.context.scene.frame_current, budget).cloud()
    if budget == 'FULL':
        return decoded.full_cloud(data)
    return decoded.decode_data(data, sources.decode_settings(data.stipple, 'RENDER'), carrier=bound.carrier(data))


def size_label(context, operator):
    """'About 250,000 splats, 59 MB' for the settings of an export."""
    try:
        objects = chosen(context, operator.collection, operator.use_selection)
    except StippleError as error:
        return str(error)
    form = formats.of_path(operator.filepath) or formats.of_path('a' + formats.USUAL_EXTENSION)
    total = size = 0
    written = set()  # datablocks that the file has once
    for obj in objects:
        count = _count(obj.data, operator.budget)
        total += count
        if form is not None and obj.data not in written:
            if form.holds_times and operator.keep_objects:
                written.add(obj.data)
            size += formats.estimated_bytes(form, count, splat_data.degree(obj.data), ascii=operator.ascii,
                                            half=operator.half, sh_degree_limit=operator.max_degree)
    return f'{total:,} splats, about {megabytes(size)}'


def megabytes(size):
    return f'{size / 1e6:,.1f} MB' if size < 1e7 else f'{size / 1e6:,.0f} MB'


def _count(data, budget):
    if budget == 'VIEWPORT' or data.stipple.edited or data.stipple.is_sequence:
        return splat_data.count(data)
    return sources.count_of(data, budget)


def default_name(context):
    obj = context.view_layer.objects.active
    return re.sub(r'[^\w.\- ]', '_', obj.name) if obj is not None else 'splats'
