# SPDX-License-Identifier: GPL-3.0-or-later
"""Which settings a source has: the library's answer, kept with the datablock; files of earlier versions; time."""

import json
from dataclasses import replace

import bpy
import pytest

import scenes

PROPERTIES = ('source_settings',)  # what earlier versions did not store


@pytest.fixture
def source(stipple):
    return stipple.scene.source


@pytest.fixture
def splats(tmp_path):
    return scenes.make_splats(scenes.sphere(), anchors=200, source_path=str(tmp_path / 'a.stipple.safetensors'))


@pytest.fixture
def tree(splats):
    assert bpy.ops.stipple.use_as_new_source() == {'FINISHED'}
    assert bpy.ops.stipple.add_budget() == {'FINISHED'}
    return bpy.context.object


@pytest.fixture
def moving(splats, source):
    """A model of which the datablock believes that it moves."""
    known = source.source_settings.of(splats.data.stipple)
    source.source_settings.note_model(splats.data.stipple, replace(known, has_time=True))
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = 24, 1.0
    return splats


def test_a_mesh_has_the_settings_of_anchors(splats, source):
    known = source.source_settings.of(splats.data.stipple)
    assert known.counts_anchors and known.has_order and known.has_seed and not known.takes_mask and not known.has_time
    assert (known.min_gaussians, known.max_gaussians, known.default_budget) == (1, 32, 20000)


def test_a_cloud_and_its_tree_count_splats(splats, source):
    assert bpy.ops.stipple.use_as_new_source() == {'FINISHED'}
    data = bpy.context.object.data
    assert source.source_settings.of(data.stipple).as_they_are
    assert bpy.ops.stipple.add_budget() == {'FINISHED'}
    known = source.source_settings.of(data.stipple)
    assert known.counts_splats and known.takes_mask and not known.has_order and not known.has_seed
    assert source.sources.decode_settings(data.stipple).anchors == 200


def test_nothing_is_known_of_splats_without_a_source(source):
    data = bpy.data.meshes.new('none')
    assert source.source_settings.of(data.stipple) == source.source_settings.SourceSettings()


def test_files_of_earlier_versions_have_the_same_settings(splats, source):
    stipple = splats.data.stipple
    now = source.source_settings.of(stipple)
    for name in PROPERTIES:
        stipple.property_unset(name)
    assert source.source_settings.of(stipple) == now


def test_trees_of_earlier_versions_have_the_same_settings(tree, source):
    stipple = tree.data.stipple
    now = source.source_settings.of(stipple)
    for name in PROPERTIES:
        stipple.property_unset(name)
    assert source.source_settings.of(stipple) == now


def test_fields_of_earlier_versions_keep_what_they_learned(splats, source):
    stipple = splats.data.stipple
    for name in PROPERTIES:
        stipple.property_unset(name)
    stipple.learned_gaussians, stipple.learned_least, stipple.learned_most = 4, 16, 64
    known = source.source_settings.of(stipple)
    assert (known.min_gaussians, known.max_gaussians, known.least_learned, known.most_learned) == (4, 4, 16, 64)
    assert known.is_learned and known.has_seed and not known.has_order
    assert source.sources.gaussians_per_anchor(stipple) == 4


def test_settings_of_a_later_version_are_left_out(splats, source):
    stipple = splats.data.stipple
    now = source.source_settings.of(stipple)
    stipple.source_settings = json.dumps({**json.loads(stipple.source_settings), 'has_wind': True})
    assert source.source_settings.of(stipple) == now


@pytest.mark.parametrize('text', ['[' * 100_000, '{"a":' * 100_000, 'x', '[]', '3', '{"has_seed": [1]}'])
def test_a_text_without_settings_counts_as_none(splats, source, text):
    """As a .blend from elsewhere may hold it."""
    stipple = splats.data.stipple
    stipple.source_settings = ''
    none = source.source_settings.of(stipple)
    stipple.source_settings = text
    assert source.source_settings.of(stipple) == none


def test_splats_that_stand_still_are_not_made_again_as_time_passes(splats, source):
    key = splats.data[source.sync.WRITTEN_KEY]
    bpy.context.scene.frame_set(30)
    assert splats.data[source.sync.WRITTEN_KEY] == key
    assert source.sources.decode_settings(splats.data.stipple).time == 0


def test_splats_that_move_are_made_again_at_every_frame(moving, source):
    keys, scene = set(), bpy.context.scene
    for frame in (1, 2, 3):
        scene.frame_set(frame)
        keys.add(moving.data[source.sync.WRITTEN_KEY])
    assert len(keys) == 3
    scene.frame_set(2)
    assert moving.data[source.sync.WRITTEN_KEY] in keys


def test_time_is_seconds_since_the_start(moving, source):
    scene, stipple = bpy.context.scene, moving.data.stipple

    def seconds():
        return source.sources.decode_settings(stipple).time

    scene.frame_set(25)
    assert seconds() == 1
    scene.frame_set(25, subframe=0.5)
    assert seconds() == pytest.approx(24.5 / 24)
    stipple.frame_speed = 2
    scene.frame_set(13)
    assert seconds() == 1
    stipple.frame_start = 13
    assert seconds() == 0
    scene.render.fps_base = 2.0
    scene.frame_set(25)
    assert seconds() == 2


def test_clips_hold_repeat_and_turn_round(moving, source):
    """A clip from second 10 to 12, at 24 frames a second: 49 frames."""
    stipple = moving.data.stipple
    known = replace(source.source_settings.of(stipple), time_begin=10.0, time_end=12.0)
    source.source_settings.note_model(stipple, known)

    def seconds(frame):
        bpy.context.scene.frame_set(frame)
        return pytest.approx(source.sources.decode_settings(stipple).time)

    assert seconds(1) == 10 and seconds(49) == 12 and seconds(73) == 13  # the model stands still there
    stipple.time_mode = 'REPEAT'
    assert seconds(1) == 10 and seconds(49) == 12 and seconds(50) == 10 and seconds(0) == 12
    stipple.time_mode = 'PING_PONG'
    assert seconds(49) == 12 and seconds(50) == 12 - 1 / 24 and seconds(97) == 10 and seconds(98) == 10 + 1 / 24
    stipple.frame_offset = 24
    assert seconds(1) == 11


def test_the_native_cache_tells_times_apart(moving, source):
    settings = source.sources.decode_settings(moving.data.stipple)
    assert hash(settings) != hash(replace(settings, time=1.0)) and settings != replace(settings, time=1.0)
    first = source.decoded.begin(moving.data, settings).cloud()
    assert source.decoded.begin(moving.data, settings).cloud() is first
    assert source.decoded.begin(moving.data, replace(settings, time=1.0)).cloud() is not first


def test_a_time_that_is_not_finite_is_refused(stipple, moving, source):
    settings = replace(source.sources.decode_settings(moving.data.stipple), time=float('nan'))
    with pytest.raises(stipple.binding.errors.StippleError, match='Time is nan'):
        settings.check()
