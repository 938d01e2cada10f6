# SPDX-License-Identifier: GPL-3.0-or-later
"""How exact images are to be: settings of a scene's viewport and render column as StippleAccuracy."""

import struct

from ...binding import accuracy as native, structs

LEVELS = (('DRAFT', "Draft", "Draw a quarter of the splats with plain colors, for finding a view"),
          ('PREVIEW', "Preview", "Draw half of the splats, for experiments"),
          ('FINAL', "Final", "Draw all splats, as they are trained"),
          ('REFERENCE', "Reference", "Draw exactly along every ray, without any limit. Other levels are compared with"
                                     " this one, which is many times as slow"))
ORDERS = (('CENTRE', "By Center", "Splats are ordered as wholes, by the depth of their centers"),
          ('PIXEL', "By Pixel", "Splats are ordered at each pixel: right where splats cross, and nothing pops when "
                                "the camera rotates"))
PROJECTIONS = (('AFFINE', "Ellipses", "Splats are drawn as ellipses, as they are trained"),
               ('RAY', "Along Rays", "Splats are drawn along the rays of the pixels: right at wide angles and close "
                                     "to the camera"))
SAMPLINGS = (('AS_TRAINED', "As Trained", "The low-pass that the splats were trained with"),
             ('MIP', "Every Zoom", "Splats smaller than pixels keep their light"),
             ('SAMPLES', "Samples", "Several samples for each pixel"))
PRECISIONS = (('FLOAT', "Single", "Single precision, as splats are trained"),
              ('DOUBLE', "Double", "Double precision"))
# Knobs that are enumerations, and what these are called in binding/structs.py.
_ENUMS = {'order': 'SplatOrder', 'projection': 'Projection', 'antialiasing': 'Sampling', 'precision': 'Precision'}
_NUMBERS = ('samples_per_side', 'sh_degree_limit', 'min_alpha', 'budget_share')
KNOBS = tuple(_ENUMS) + _NUMBERS
# Knobs that .blend files keep under another name.
_PROPERTIES = {'min_alpha': 'least_alpha'}
_knobs = {}
COLUMNS = (('VIEWPORT', "Viewport", "Rendered shading of the engine Stipple"), ('RENDER', "Render", "Final renders"))
# What can be compared.
SIDES = COLUMNS + (('REFERENCE', "Reference", "The level that others are compared with; it may take minutes"),)


def column(scene, name):
    """The settings of 'VIEWPORT' or 'RENDER'."""
    return scene.stipple.quality_viewport if name == 'VIEWPORT' else scene.stipple.quality_render


def property_of(knob):
    """The property of a column of settings that keeps a knob of StippleAccuracy."""
    return _PROPERTIES.get(knob, knob)


def _enum(knob):
    return getattr(structs, _ENUMS[knob])


def accuracy_of(library, settings, rows=None, needs_rays=False):
    """StippleAccuracy of a column of settings. Errors: StippleError.

    rows: of an effects plan, which may ask for more. needs_rays: the camera sees along rays whatever the level is.
    """
    level = structs.AccuracyLevel[settings.level]
    made = native.accuracy(library, level)
    knobs = {name: int(_enum(name)[getattr(settings, name)]) for name in _ENUMS}
    for name in _NUMBERS:
        # What rounds to the stored number is meant: Blender keeps single precision.
        value, exact = getattr(settings, property_of(name)), getattr(made, name)
        knobs[name] = exact if value == _single(exact) else value
    if rows is not None and level != structs.AccuracyLevel.REFERENCE:
        knobs.update(_for_effects(knobs, rows, level))
    if needs_rays:
        knobs['projection'] = int(structs.Projection.RAY)
    return native.accuracy(library, level, **knobs)


def _for_effects(knobs, rows, level):
    """Knobs as the plan has them. What costs much is left to levels that ask for it, or to who chooses it."""
    asked = {'sh_degree_limit': min(knobs['sh_degree_limit'], rows[structs.Effect.VIEW_COLOUR].sh_degree)}
    if rows[structs.Effect.EXACT_PROJECTION].is_on and level >= structs.AccuracyLevel.FINAL:
        asked['projection'] = int(structs.Projection.RAY)
    if rows[structs.Effect.ZOOM_ANTIALIASING].is_on and knobs['antialiasing'] == structs.Sampling.AS_TRAINED:
        asked['antialiasing'] = int(structs.Sampling.MIP)
    return asked


def knobs(library):
    """Every knob with its label and the bound of its error."""
    if library not in _knobs:
        _knobs[library] = native.accuracy_knobs(library)
    return _knobs[library]


def take_level(library, settings):
    """Sets every knob as the level of the settings has it. Errors: StippleError."""
    _take(settings, native.accuracy(library, structs.AccuracyLevel[settings.level]))


def store(settings, accuracy):
    """Puts a StippleAccuracy into a column of settings."""
    with_level = structs.AccuracyLevel(accuracy.level).name
    if settings.level != with_level:
        settings.level = with_level  # which sets the knobs; those that differ follow
    _take(settings, accuracy)


def is_same(one, other):
    """Whether two StippleAccuracy draw the same image."""
    return all(_single(getattr(one, name)) == _single(getattr(other, name)) for name in ('level', *KNOBS))


def is_changed(library, settings):
    """Whether any knob differs from the level's. Errors: StippleError."""
    made = native.accuracy(library, structs.AccuracyLevel[settings.level])
    return any(getattr(settings, property_of(name)) != value for name, value in _values(made))


def key_of(settings):
    """A text that is equal for equal settings."""
    return repr([getattr(settings, property_of(name)) for name in ('level', *KNOBS)])


def _take(settings, accuracy):
    for name, value in _values(accuracy):
        if getattr(settings, property_of(name)) != value:
            setattr(settings, property_of(name), value)


def _values(accuracy):
    for name in _ENUMS:
        yield name, _enum(name)(getattr(accuracy, name)).name
    for name in _NUMBERS:
        value = getattr(accuracy, name)
        yield name, _single(value)


def _single(value):
    """A number as Blender's properties keep it."""
    return struct.unpack('f', struct.pack('f', value))[0] if isinstance(value, float) else value
