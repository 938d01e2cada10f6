# SPDX-License-Identifier: GPL-3.0-or-later
"""Colour grades of splat datablocks.

Attributes hold what is shown, so every engine shows the grade. While there is one, the colours without
it stay beside them (splat_data.read_ungraded), whatever happens to the points.
"""

import numpy as np

from ..binding.cloud import Cloud
from ..binding.errors import StippleError
from ..binding.grade import GradeSettings, graded
from ..binding.structs import Status
from .source import sources, splat_data

GRADE_KEY = 'stipple_grade'  # of the attributes as they are; none: not graded


def settings_of(stipple):
    """The grade of settings, evaluated or not."""
    return GradeSettings(stipple.exposure, tuple(stipple.tint), stipple.saturation, stipple.grade_opacity)


def apply(cloud, stipple):
    """A cloud as its settings grade it. Errors: StippleError for settings outside their range."""
    return graded(cloud, settings_of(stipple))


def is_shown(data, settings):
    """Whether the attributes of a datablock carry this grade."""
    return data.get(GRADE_KEY, '') == _text(settings)


def write(data, splats, settings):
    """Stores splats that are not graded, graded. Errors: StippleError, with the splats as they were."""
    shown = splats
    if not settings.is_neutral:
        shown = graded(splats.to_cloud(sources.context()), settings).columns()
    splat_data.write(data, shown, None if settings.is_neutral else splats)
    if settings.is_neutral:
        data.pop(GRADE_KEY, None)
    else:
        data[GRADE_KEY] = _text(settings)


def write_again(data, settings):
    """Grades the stored splats anew. Errors: StippleError where colours were painted over the present grade."""
    if colours_are_edited(data):
        raise StippleError(f"The colors of '{data.name}' were edited by hand under a grade; choose Use as New Source "
                           f"to "
                           'keep them, or Revert to Source, before the grade is changed.',
                           Status.ERROR_INVALID_ARGUMENT)
    write(data, splat_data.read_ungraded(data), settings)


def colours_are_edited(data):
    """Whether the shown colours are not the stored ones under the stored grade."""
    text = data.get(GRADE_KEY, '')
    if not text:
        return False
    shown, stored = splat_data.read(data), splat_data.read_ungraded(data)
    expected = graded(Cloud.create(sources.context(), stored), _settings(text)).read()
    return not (np.array_equal(shown.sh, expected.sh) and np.array_equal(shown.opacities, expected.opacities))


def cloud_of(obj):
    """The native cloud of an evaluated object's attributes, under its evaluated grade."""
    original, settings = obj.original.data, settings_of(obj.data.stipple)
    if is_shown(original, settings):
        return sources.cloud_from_object(obj)
    return graded(sources.ungraded_cloud(obj), settings)


def clear(stipple):
    """Sets the neutral grade: what was graded is in the splats now."""
    neutral = GradeSettings()
    stipple.exposure, stipple.tint = neutral.exposure, neutral.tint
    stipple.saturation, stipple.grade_opacity = neutral.saturation, neutral.opacity


def _text(settings):
    if settings.is_neutral:
        return ''
    values = (settings.exposure, *settings.tint, settings.saturation, settings.opacity)
    return ' '.join(repr(float(value)) for value in values)


def _settings(text):
    values = [float(value) for value in text.split()]
    return GradeSettings(values[0], tuple(values[1:4]), values[4], values[5])
