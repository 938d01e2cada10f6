# SPDX-License-Identifier: GPL-3.0-or-later
"""Networks that come with the add-on are used where no weights folder is chosen; here the small ones of a golden."""

import sys
from pathlib import Path

import bpy
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import pipeline_weights  # noqa: E402

FEW = {'steps': 3, 'tokens': 64, 'anchors': 40}


@pytest.fixture
def shipped(stipple, tmp_path, monkeypatch):
    folder = tmp_path / 'networks'
    folder.mkdir()
    pipeline_weights.split(folder)
    monkeypatch.setattr(stipple.preferences, 'shipped_weights_folder', lambda: str(folder))
    chosen = stipple.preferences.get()
    chosen.weights_folder, chosen.cache_folder = '', str(tmp_path / 'cache')
    yield folder
    chosen.weights_folder = chosen.cache_folder = ''


def count_of(stipple, obj):
    return len(stipple.scene.source.splat_data.read(obj.data).positions)


def test_they_are_used_and_say_what_they_know(stipple, shipped):
    table = stipple.scene.generate.weights_table
    assert table.is_complete() and table.is_trained() and 'came with Stipple' in table.caution()
    assert not bpy.ops.stipple.weights_refresh.poll()  # There is nothing to look for.
    assert bpy.ops.stipple.random_splats(seed=1, **FEW) == {'FINISHED'}
    assert count_of(stipple, bpy.context.object) == 40 * 32


def test_their_splats_move_their_budget_where_another_folder_is_chosen_later(stipple, shipped, tmp_path):
    assert bpy.ops.stipple.random_splats(seed=1, **FEW) == {'FINISHED'}
    obj = bpy.context.object
    (tmp_path / 'others').mkdir()
    stipple.preferences.get().weights_folder = str(tmp_path / 'others')
    stipple.scene.source.sources.forget()
    obj.data.stipple.anchors = 60
    assert count_of(stipple, obj) == 60 * 32


def test_a_folder_of_ones_own_comes_first(stipple, shipped, tmp_path):
    (tmp_path / 'others').mkdir()
    stipple.preferences.get().weights_folder = str(tmp_path / 'others')
    assert not stipple.scene.generate.weights_table.is_complete()
    with pytest.raises(RuntimeError, match='has no file with the weights'):
        bpy.ops.stipple.random_splats(seed=1, **FEW)
