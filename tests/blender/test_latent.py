# SPDX-License-Identifier: GPL-3.0-or-later
"""Generated splats: a source that needs a file of weights beside its own, and whose decoding may take long."""

import sys
import time
from pathlib import Path

import bpy
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import pipeline_weights  # noqa: E402

EACH = 32  # splats of an anchor


@pytest.fixture
def splats(stipple, tmp_path, monkeypatch):
    """Imported generated splats of a small network, at 40 anchors."""
    monkeypatch.delenv('STIPPLE_WEIGHTS', raising=False)
    weights = tmp_path / 'weights'
    weights.mkdir()
    pipeline_weights.split(weights)
    pipeline_weights.write_latent(tmp_path / 'thing.stipple.safetensors', weights / 'decoder.safetensors')
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    stipple.preferences.get().weights_folder = str(weights)
    # The network's usual budget is more than this test needs.
    monkeypatch.setattr(stipple.scene.source.sources, 'first_settings',
                        lambda settings: stipple.binding.model.DecodeSettings(40, EACH))
    assert bpy.ops.stipple.splats_import(filepath=str(tmp_path / 'thing.stipple.safetensors')) == {'FINISHED'}
    yield bpy.context.object
    stipple.preferences.get().weights_folder = ''


def count(stipple, obj):
    return stipple.scene.source.splat_data.count(obj.data)


def take_weights_away(stipple, tmp_path):
    stipple.scene.source.decoded.forget()
    (tmp_path / 'weights' / 'decoder.safetensors').rename(tmp_path / 'decoder.safetensors')


def test_a_budget_is_followed_through_the_weights_of_preferences(stipple, splats):
    assert count(stipple, splats) == 40 * EACH
    splats.data.stipple.anchors = 64
    assert count(stipple, splats) == 64 * EACH
    known = stipple.scene.source.source_settings.of(splats.data.stipple)
    assert (known.least_learned, known.most_learned, known.least_budget) == (1024, 8192, 32)
    assert known.min_gaussians == known.max_gaussians == EACH and known.has_order and known.has_seed


def test_without_weights_the_stored_splats_stay_and_the_reason_is_said(stipple, splats, tmp_path):
    before = stipple.scene.source.splat_data.read(splats.data).positions.copy()
    take_weights_away(stipple, tmp_path)
    splats.data.stipple.anchors = 80
    said = stipple.scene.source.sync.problems[splats.data.name]
    assert 'decoder.safetensors' in said and str(tmp_path / 'weights') in said
    np.testing.assert_array_equal(stipple.scene.source.splat_data.read(splats.data).positions, before)
    # They come when the file does.
    (tmp_path / 'decoder.safetensors').rename(tmp_path / 'weights' / 'decoder.safetensors')
    splats.data.stipple.anchors = 81
    assert count(stipple, splats) == 81 * EACH and not stipple.scene.source.sync.problems


def test_without_weights_the_engine_draws_what_is_stored_while_it_is_what_is_wanted(stipple, splats, tmp_path):
    gathered = stipple.scene.instances.gather(bpy.context.evaluated_depsgraph_get(), 'RENDER')
    take_weights_away(stipple, tmp_path)
    again = stipple.scene.instances.gather(bpy.context.evaluated_depsgraph_get(), 'RENDER')
    for placed in (*gathered, *again):
        assert placed[0].columns().count == 40 * EACH
    assert len(gathered) == len(again) == 1
    splats.data.stipple.anchors_render = 60
    splats.data.update_tag()
    with pytest.raises(stipple.binding.errors.StippleError, match='decoder.safetensors'):
        stipple.scene.instances.gather(bpy.context.evaluated_depsgraph_get(), 'RENDER')


def test_a_blend_file_opens_without_weights_and_shows_what_it_holds(stipple, splats, tmp_path):
    bpy.ops.wm.save_mainfile()
    take_weights_away(stipple, tmp_path)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'a.blend'))
    obj = next(obj for obj in bpy.data.objects if obj.type in {'MESH', 'POINTCLOUD'})
    assert count(stipple, obj) == 40 * EACH
    assert not stipple.scene.source.sync.problems


def test_what_takes_long_is_decoded_beside_blender(stipple, splats):
    decoded, data = stipple.scene.source.decoded, splats.data

    def wanted(anchors):
        return stipple.binding.model.DecodeSettings(anchors, EACH)

    assert not decoded.is_decoded(data, wanted(3000), 0.0)
    first = decoded._beside[data.name_full].job
    assert decoded.is_decoding() and 0 <= decoded.decoding_share(data) <= 1
    # Other settings take the place of what was wanted before.
    assert not decoded.is_decoded(data, wanted(2000), 0.0)
    assert data.name_full not in decoded._beside or decoded._beside[data.name_full].job is not first
    with pytest.raises(stipple.binding.errors.CancelledError):
        first.wait()
    end = time.monotonic() + 60
    while not decoded.is_decoded(data, wanted(2000), 0.0):
        assert time.monotonic() < end
        time.sleep(0.01)
    beside = decoded.decode_data(data, wanted(2000)).columns()
    assert not decoded.is_decoding() and decoded.decoding_share(data) is None
    direct = decoded.decode_data(data, wanted(2000)).columns()
    np.testing.assert_array_equal(beside.column('positions'), direct.column('positions'))


def test_what_nobody_takes_is_forgotten(stipple, splats):
    decoded = stipple.scene.source.decoded
    decoded.is_decoded(splats.data, stipple.binding.model.DecodeSettings(50, EACH), 0.0)
    end = time.monotonic() + 60
    while decoded.is_decoding():
        assert time.monotonic() < end
        time.sleep(0.01)
    assert decoded.decoding_share(splats.data) is None


def test_a_resting_slider_is_followed_without_waiting(stipple, splats):
    sync = stipple.scene.source.sync
    with sync.paused():
        splats.data.stipple.anchors = 2500
    end = time.monotonic() + 60
    while sync.complete() is not None:
        assert time.monotonic() < end
        time.sleep(0.01)
    assert count(stipple, splats) == 2500 * EACH


def test_few_splats_are_never_fewer_than_the_network_makes(stipple, splats):
    settings = stipple.binding.model.DecodeSettings(4000, EACH)
    sources = stipple.scene.source.sources
    assert sources.at_most(settings, 100, 32).anchors == 32
    assert sources.at_most(settings, 64 * EACH, 32).anchors == 64
