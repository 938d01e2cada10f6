# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats of an object get the detail that views show: from a training to the operator."""

import json
import os
import subprocess
import sys
from pathlib import Path

import bpy
import pytest

import scenes

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'cli'))
import ball_collection  # noqa: E402

TOOL = Path(os.environ['STIPPLE_BUILD_DIR']) / 'bin' / 'stipple'


@pytest.fixture(scope='module')
def weights_folder(tmp_path_factory):
    """What a few steps learn of balls."""
    folder = tmp_path_factory.mktemp('detail')
    ball_collection.write_collection(folder / 'objects', count=3)
    detail = {'steps': 8, 'warm_up': 2, 'least_splats': 32, 'most_splats': 64, 'views': 3, 'seen': 2, 'heads': 2,
              'head_width': 4, 'blocks': 1, 'patch': 16, 'fit_steps': 20, 'fit_splats': 100}
    (folder / 'config.json').write_text(json.dumps({'collection': 'objects', 'out': 'result', 'held_out': 3,
                                                    'points': 64, 'detail': detail}))
    subprocess.run([TOOL, 'train', folder / 'config.json'], check=True, capture_output=True)
    return folder / 'result'


@pytest.fixture
def splats(stipple, tmp_path, weights_folder):
    """A ball with two colours, and few splats that stand for it."""
    ball = scenes.two_coloured_ball(tmp_path)
    chosen = bpy.context.scene.stipple.fit
    for name, value in {'view_count': 6, 'view_size': 48, 'engine': 'WORKBENCH', 'max_splats': 150,
                        'quality': 'FAST'}.items():
        setattr(chosen, name, value)
    assert bpy.ops.stipple.splats_fit() == {'FINISHED'}
    made = next(o for o in bpy.data.objects if o.name.endswith(' Fit'))
    scenes.select(ball, made)
    bpy.context.view_layer.objects.active = made
    preferences = stipple.preferences.get()
    preferences.weights_folder = str(weights_folder)
    yield made
    preferences.weights_folder = ''


def test_all_splats_become_finer_and_the_object_keeps_a_budget(stipple, splats):
    before, count = splats.data, splats.data.stipple.source_count
    assert bpy.ops.stipple.add_detail() == {'FINISHED'}
    assert splats.data.stipple.source_kind == 'TREE' and splats.data.stipple.source_count == 4 * count
    assert stipple.scene.source.splat_data.count(splats.data) == 4 * count
    assert splats.data != before and stipple.scene.source.splat_data.count(before) == count
    splats.data.stipple.ratio = 0.5
    assert stipple.scene.source.splat_data.count(splats.data) == 2 * count


def test_a_maximum_is_kept(stipple, splats):
    count = splats.data.stipple.source_count
    assert bpy.ops.stipple.add_detail(max_splats=count + 31, view_count=2) == {'FINISHED'}
    assert splats.data.stipple.source_count == count + 30


def test_undo_brings_the_splats_back(stipple, splats):
    name, count = splats.name, splats.data.stipple.source_count
    bpy.ops.ed.undo_push(message='before')
    assert bpy.ops.stipple.add_detail() == {'FINISHED'}
    bpy.ops.ed.undo_push(message='after')
    bpy.ops.ed.undo()
    data = bpy.data.objects[name].data
    assert data.stipple.source_count == count == stipple.scene.source.splat_data.count(data)


def test_messages(stipple, splats, weights_folder, tmp_path, monkeypatch):
    monkeypatch.setattr(stipple.preferences, 'shipped_weights_folder', lambda: '')
    data, count = splats.data, splats.data.stipple.source_count
    run = bpy.ops.stipple.add_detail
    preferences = stipple.preferences.get()
    preferences.weights_folder = ''
    scenes.refuses(run, 'No folder of weights is chosen')
    preferences.weights_folder = str(tmp_path)
    scenes.refuses(run, "detail.safetensors is not in")
    preferences.weights_folder = str(weights_folder)
    wrong = tmp_path / 'wrong.safetensors'
    wrong.write_bytes(b'nothing')
    scenes.refuses(lambda: run(weights=str(wrong)), 'wrong.safetensors')
    scenes.refuses(lambda: run(weights=str(tmp_path / 'missing.safetensors')), 'missing.safetensors')
    scenes.refuses(lambda: run(max_splats=1), 'the number of splats is 1')
    bpy.context.scene.stipple.fit.views_from = 'DATASET'
    scenes.refuses(run, 'No data set is chosen')
    assert splats.data == data and stipple.scene.source.splat_data.count(data) == count
