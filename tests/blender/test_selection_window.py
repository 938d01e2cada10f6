# SPDX-License-Identifier: GPL-3.0-or-later
"""Tools that select splats with the mouse, in a window on a virtual screen."""

from pathlib import Path

import bpy
import numpy as np
import pytest

import screen
import selection_steps


@pytest.fixture(scope='module')
def shots(tmp_path_factory):
    folder = tmp_path_factory.mktemp('window')
    pictures, facts, text = screen.run_steps(Path(selection_steps.__file__), folder, bpy.app.binary_path, timeout=500,
                                             options=('--enable-event-simulate',))
    assert 'Traceback' not in text, text
    return pictures, facts


def test_strokes_select_extend_subtract_and_undo(shots):
    counts = shots[1]['steps']
    assert counts['brush'] > 500
    assert 100 < counts['subtracted'] < counts['brush'] - 100
    assert counts['added'] > counts['subtracted'] + 50
    assert counts['undone'] == counts['subtracted'] and counts['undone_twice'] == counts['brush']
    assert counts['cancelled'] == counts['brush']


def test_front_only_takes_the_first_wall(shots):
    counts = shots[1]['steps']
    assert 0.4 * counts['brush'] < counts['front'] < 0.6 * counts['brush']


def test_a_region_of_quad_view_selects_what_it_shows_itself(shots):
    facts = shots[1]
    assert facts['regions'] == 4
    assert facts['steps']['quad'] == facts['quad expected'] > 20


def test_nothing_is_drawn_in_a_panorama(shots):
    """One warning, and the selection stays."""
    assert shots[1]['steps']['panorama'] == shots[1]['steps']['quad']


def test_the_other_tools_select(shots):
    counts = shots[1]['steps']
    assert counts['lasso'] > 500 and counts['sphere'] > 50
    # Half of both walls is red.
    assert 3500 < counts['color'] < 4500
    red, green, blue = shots[1]['color']
    assert red > 0.6 and green < 0.05 and blue < 0.05
    assert shots[1]['tools'] == ['stipple.select_brush', 'stipple.select_sphere', 'stipple.select_color',
                                 'stipple.select_brush']
    assert shots[1]['tool_of_button'] == 'stipple.select_lasso'


def test_keys_change_the_radius_and_the_wheel_leaves_the_view(shots):
    radii, distances = shots[1]['radii'], shots[1]['distances']
    assert radii['larger'] == pytest.approx(44, rel=0.01) and radii['smaller'] == pytest.approx(40 / 1.1, rel=0.01)
    assert radii['wheel'] == pytest.approx(40 * 1.1, rel=0.01)
    assert distances['before'] == distances['after']
    # The wheel is the view's again, and F drags the radius as it does for other brushes.
    assert distances['zoomed'] != distances['before']
    assert radii['dragged'] == pytest.approx(70, abs=15)


def test_tools_come_and_go_with_the_add_on(shots):
    assert shots[1]['disabled'] == []
    assert shots[1]['enabled'] == ['stipple.select_brush', 'stipple.select_lasso', 'stipple.select_sphere',
                                   'stipple.select_color']


def test_selected_splats_and_strokes_are_drawn(shots):
    pictures, facts = shots
    changed = {name: (pictures[name] != pictures['hover']).any(-1).sum() for name in ('stroke', 'brush', 'lasso')}
    assert changed['brush'] > 2000 and changed['stroke'] > 100, changed
    # The theme's colour over what the stroke has passed, and nowhere before.
    def of_theme(name):
        return (np.abs(pictures[name] - 255 * np.array(facts['theme'])).max(axis=-1) < 8).sum()
    assert of_theme('brush') > 1000 and of_theme('hover') < 50
    # While the button is down already, and no longer once a stroke is cancelled.
    for name, selected in (('stroke', 'brush'), ('lasso', 'lasso_done')):
        assert 0.5 < of_theme(name) / of_theme(selected) < 2, name
    # In the view: the status bar shows the last report for some seconds.
    x, y, width, height = facts['view']

    def in_view(name):
        rows = len(pictures[name])
        return pictures[name][rows - y - height:rows - y, x:x + width]

    assert in_view('cancelled').size and np.array_equal(in_view('cancelled'), in_view('before_cancel'))


def test_what_is_drawn_while_the_mouse_moves_is_what_is_selected(shots):
    """At most every splat is looked at here, so that it is all of them."""
    facts = shots[1]
    assert facts['previewed'] == facts['steps']['brush']
    assert max(facts['preview seconds']) < 1.0
    print('seconds of an update:', [round(seconds, 4) for seconds in facts['preview seconds']])


def test_tools_read_the_source_before_the_first_stroke(shots):
    assert shots[1]['prepared'] == [False, True]


def test_erased_splats_are_gone(shots):
    assert shots[1]['steps']['erased'] == 0
    assert (shots[0]['erased'] != shots[0]['hover']).any(-1).sum() > 5000
