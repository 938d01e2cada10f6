# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of a fit that the add-on shares with the library: the library's table says what they may be."""

import importlib

import bpy
import pytest


@pytest.fixture
def options(stipple):
    """The library's options that are settings of the panel, by name: [(option, property)]."""
    fit = importlib.import_module('.binding.fit', stipple.__name__)
    library = stipple.scene.source.sources.context().library
    table = {option.name: option for option in fit.fit_option_table(library)}
    properties = bpy.context.scene.stipple.fit.bl_rna.properties
    return {name: (table[name], properties[name]) for name in properties.keys() if name in table}


def test_the_shared_settings_are_those_that_the_panel_has(options):
    """Another one is compared from the day it has the library's name."""
    assert sorted(options) == ['density_gradient', 'key_frame_spacing', 'max_splats', 'model', 'resume', 'seed',
                               'shell', 'strategy']


def test_numbers_stay_within_the_range_of_the_library(options):
    numbers = [name for name, (_, shown) in options.items() if shown.type in {'INT', 'FLOAT'}]
    assert sorted(numbers) == ['key_frame_spacing', 'max_splats', 'seed']
    for name in numbers:
        option, shown = options[name]
        assert option.minimum <= shown.hard_min <= shown.default <= shown.hard_max <= option.maximum, name


def test_words_and_switches_are_those_of_the_library(options):
    for name in ('model', 'shell'):
        option, shown = options[name]
        assert [item.identifier.lower() for item in shown.enum_items] == list(option.choices)
        assert shown.default.lower() == option.default
    assert options['seed'][1].default == int(options['seed'][0].default)
    assert options['density_gradient'][1].default == bool(int(options['density_gradient'][0].default))


def test_a_tooltip_is_one_sentence_about_the_same_setting(options):
    """The panel says in an artist's words what the library says in a caller's: both name the same thing."""
    same = {'density_gradient': 'learn', 'key_frame_spacing': 'seconds', 'max_splats': 'splats', 'model': 'splats',
            'resume': 'checkpoint', 'seed': 'seed', 'shell': 'shell', 'strategy': 'splats are added and removed'}
    for name, (option, shown) in options.items():
        tooltip = shown.description + ' ' + shown.name
        assert same[name] in tooltip.lower() and same[name] in option.help.lower(), (name, tooltip, option.help)
