# SPDX-License-Identifier: GPL-3.0-or-later
"""Slow budgets in a window on a virtual screen: a slider, Esc, Prepare Budgets."""

import sys
from pathlib import Path

import bpy
import pytest

import screen

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import pipeline_weights  # noqa: E402

STEPS = Path(__file__).resolve().parent / 'decoding_steps.py'
EACH, FEW, MANY = 32, 64, 31250


@pytest.fixture(scope='module')
def shots(tmp_path_factory):
    folder = tmp_path_factory.mktemp('window')
    weights = tmp_path_factory.mktemp('networks') / 'weights'
    weights.mkdir()
    pipeline_weights.write_large_decoder(weights / 'decoder.safetensors')
    asset = weights.parent / 'thing.stipple.safetensors'
    pipeline_weights.write_latent(asset, weights / 'decoder.safetensors')
    return screen.run_steps(STEPS, folder, bpy.app.binary_path, size=(1600, 1000), timeout=500,
                            arguments=[str(weights), str(asset)], options=['--enable-event-simulate'])


def test_a_slow_move_waits_for_nothing_and_the_last_splats_stay(shots):
    pictures, facts, text = shots
    assert 'Traceback' not in text
    assert facts['count_after_move'] == facts['count_while_decoding'] == FEW * EACH
    # A move waits for LIVE_SECONDS at most, as long as nothing is known of larger budgets.
    assert facts['move_seconds'] < 10  # of a busy machine; the decode takes longer
    x, y, width, height = facts['editor']
    panel = [pictures[name][len(pictures[name]) - y - height:len(pictures[name]) - y, x:x + width]
             for name in ('few', 'decoding', 'cancelled')]
    assert (panel[0] != panel[1]).any(-1).sum() > 500 and (panel[1] != panel[2]).any(-1).sum() > 500


def test_escape_cancels_and_says_so_once(shots):
    _, facts, text = shots
    assert facts['declined'] and facts['count_after_esc'] == FEW * EACH
    assert text.count('was cancelled; what was shown before stays') >= 1


def test_the_last_of_several_moves_wins(shots):
    _, facts, _ = shots
    assert facts['counts_of_moves'] == [500 * EACH]


def test_preparing_is_cancelled_and_goes_on(shots):
    _, facts, text = shots
    assert facts['kept_after_esc'] == 1
    assert facts['said'][0] == "Cancelled: of 4 budgets of 'thing', 1 are decoded and stay so"
    assert facts['prepared'] == [200, 250, 300]
    assert "4 budgets of 'thing' are decoded, 3 of them now" in text


def test_playing_takes_no_decode(shots):
    _, facts, _ = shots
    assert facts['decoded_while_playing'] == []
    assert facts['played'] == [100 * EACH, 200 * EACH, 300 * EACH, 100 * EACH]
