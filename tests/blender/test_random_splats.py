# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that no image tells of, by the small networks of a golden."""

import sys
from pathlib import Path

import bpy
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import pipeline_weights  # noqa: E402

FEW = {'steps': 3, 'tokens': 64, 'anchors': 40}


@pytest.fixture
def weights(stipple, tmp_path):
    folder = tmp_path / 'weights'
    folder.mkdir()
    pipeline_weights.split(folder)
    chosen = sys.modules[stipple.__name__ + '.preferences'].get()
    before = chosen.weights_folder, chosen.cache_folder
    chosen.weights_folder, chosen.cache_folder = str(folder), str(tmp_path / 'cache')
    yield folder
    chosen.weights_folder, chosen.cache_folder = before


def places_of(obj):
    found = obj.data.points if hasattr(obj.data, 'points') else obj.data.vertices
    values = np.empty(3 * len(found), np.float32)
    found.foreach_get('co', values)
    return values


def test_each_seed_gives_another_object(weights):
    before = set(bpy.data.objects)
    assert bpy.ops.stipple.random_splats(seed=5, seed_count=2, **FEW) == {'FINISHED'}
    made = sorted(set(bpy.data.objects) - before, key=lambda obj: obj.name)
    assert [obj.name for obj in made] == ['Random Splats', 'Random Splats.001']
    first, second = (places_of(obj) for obj in made)
    assert len(first) == len(second) == 3 * 40 * 32
    assert np.abs(first - second).max() > 1e-3
    assert bpy.ops.stipple.random_splats(seed=5, **FEW) == {'FINISHED'}
    again = next(obj for obj in bpy.data.objects if obj not in before and obj not in made)
    assert (places_of(again) == first).all()
    assert again.data.stipple.anchors == 40  # The budget can be moved, as of any model.


def test_without_weights_it_says_where_they_are_told(stipple, monkeypatch):
    preferences = sys.modules[stipple.__name__ + '.preferences']
    monkeypatch.setattr(preferences, 'shipped_weights_folder', lambda: '')
    before, preferences.get().weights_folder = preferences.get().weights_folder, ''
    try:
        with pytest.raises(RuntimeError, match='No weights folder is chosen'):
            bpy.ops.stipple.random_splats(**FEW)
    finally:
        preferences.get().weights_folder = before
