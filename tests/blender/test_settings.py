# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats are a cache of (source, settings): slider, undo, save, edits, animation of the viewport."""

import bpy
import numpy as np
import pytest

import scenes


@pytest.fixture
def splats(tmp_path):
    return scenes.make_splats(scenes.sphere(), anchors=1000, source_path=str(tmp_path / 'a.stipple.safetensors'))


def count(stipple, obj):
    return stipple.scene.source.splat_data.count(obj.data)


def positions(stipple, obj):
    return stipple.scene.source.splat_data.read(obj.data).positions


def test_slider_decodes_at_once(stipple, splats):
    for budget in (2000, 500, 1, 30000):
        splats.data.stipple.anchors = budget
        assert count(stipple, splats) == budget
    splats.data.stipple.gaussians_per_anchor = 2
    assert count(stipple, splats) == 60000


def test_seed_and_order_change_the_splats_and_come_back(stipple, splats):
    first = positions(stipple, splats)
    splats.data.stipple.seed = 5
    assert not np.array_equal(positions(stipple, splats), first)
    splats.data.stipple.seed = 0
    np.testing.assert_array_equal(positions(stipple, splats), first)
    splats.data.stipple.order = 'PROGRESSIVE'
    assert count(stipple, splats) == 1000
    assert not np.array_equal(positions(stipple, splats), first)


def test_linked_duplicates_share_the_budget(stipple, splats):
    other = scenes.link(bpy.data.objects.new('other', splats.data))
    other.data.stipple.anchors = 300
    assert count(stipple, splats) == 300


def test_undo_and_redo(stipple, splats):
    name = splats.name
    bpy.ops.ed.undo_push(message='made')
    splats.data.stipple.anchors = 2500
    bpy.ops.ed.undo_push(message='moved')
    bpy.ops.ed.undo()
    obj = bpy.data.objects[name]
    assert (obj.data.stipple.anchors, count(stipple, obj)) == (1000, 1000)
    bpy.ops.ed.redo()
    obj = bpy.data.objects[name]
    assert (obj.data.stipple.anchors, count(stipple, obj)) == (2500, 2500)


def test_save_and_reload(stipple, splats, tmp_path):
    name = splats.name
    splats.data.stipple.anchors = 1500
    stored = positions(stipple, splats)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'a.blend'))
    obj = bpy.data.objects[name]
    np.testing.assert_array_equal(positions(stipple, obj), stored)
    obj.data.stipple.anchors = 700
    assert count(stipple, obj) == 700


def test_relative_source_survives_a_move_of_the_folder(stipple, tmp_path):
    here, there = tmp_path / 'here', tmp_path / 'there'
    here.mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(here / 'a.blend'))
    name = scenes.make_splats(scenes.quad(), anchors=100).name
    bpy.ops.wm.save_mainfile()
    here.rename(there)
    bpy.ops.wm.open_mainfile(filepath=str(there / 'a.blend'))
    bpy.data.objects[name].data.stipple.anchors = 200
    assert count(stipple, bpy.data.objects[name]) == 200


def test_keyframed_budget_follows_the_frame(stipple, splats):
    stipple_settings = splats.data.stipple
    for frame, budget in ((1, 1000), (11, 3000)):
        stipple_settings.anchors = budget
        stipple_settings.keyframe_insert('anchors', frame=frame)
    scene = bpy.context.scene
    scene.frame_set(1)
    assert count(stipple, splats) == 1000
    scene.frame_set(6)
    assert count(stipple, splats) == 2000
    scene.frame_set(11)
    assert count(stipple, splats) == 3000


def test_driven_budget_follows_the_frame(stipple, splats):
    curve = splats.data.driver_add('stipple.anchors')
    curve.driver.type = 'SCRIPTED'
    curve.driver.expression = '100 * frame'
    bpy.context.scene.frame_set(7)
    assert count(stipple, splats) == 700
    bpy.context.scene.frame_set(9)
    assert count(stipple, splats) == 900


def edit(obj, offset=1.0):
    """Moves the first splat, as an artist would."""
    data = obj.data
    collection, field = (data.vertices, 'co') if isinstance(data, bpy.types.Mesh) else (
        data.attributes['position'].data, 'vector')
    values = np.empty(len(collection) * 3, np.float32)
    collection.foreach_get(field, values)
    values[:3] += offset
    collection.foreach_set(field, values)
    data.update_tag()


def test_edits_by_hand_lock_the_slider_until_they_are_reverted(stipple, splats):
    before = positions(stipple, splats)
    edit(splats)
    edited = positions(stipple, splats)
    splats.data.stipple.anchors = 3000
    assert splats.data.stipple.edited
    np.testing.assert_array_equal(positions(stipple, splats), edited)
    assert bpy.ops.stipple.revert_to_source() == {'FINISHED'}
    assert not splats.data.stipple.edited
    assert count(stipple, splats) == 3000
    splats.data.stipple.anchors = 1000
    np.testing.assert_array_equal(positions(stipple, splats), before)


def test_edits_by_hand_can_become_the_source(stipple, splats, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    edit(splats)
    edited = positions(stipple, splats)
    assert bpy.ops.stipple.use_as_new_source() == {'FINISHED'}
    assert splats.data.stipple.source_kind == 'CLOUD'
    assert (tmp_path / 'stipple').is_dir() and list((tmp_path / 'stipple').glob('*.ply'))
    np.testing.assert_array_equal(positions(stipple, splats), edited)
    edit(splats)
    assert bpy.ops.stipple.revert_to_source() == {'FINISHED'}
    np.testing.assert_array_equal(positions(stipple, splats), edited)


def test_equal_settings_do_not_decode_again(stipple, splats, monkeypatch):
    decode, decoded = stipple.binding.model.Model.decode, []
    monkeypatch.setattr(stipple.binding.model.Model, 'decode',
                        lambda *given, **named: decoded.append(given) or decode(*given, **named))
    splats.data.stipple.anchors = splats.data.stipple.anchors
    bpy.context.scene.frame_set(5)
    assert not decoded
    splats.data.stipple.anchors += 1  # what is counted happens at all
    assert len(decoded) == 1


def test_twenty_moves_over_a_million_splats_add_under_500_megabytes(stipple, splats):
    def resident():
        with open('/proc/self/status') as status:
            return next(int(line.split()[1]) for line in status if line.startswith('VmRSS')) / 1024

    splats.data.stipple.anchors = 1_000_000
    start = resident()
    for i in range(20):
        splats.data.stipple.anchors = 1_000_000 - 1000 * (i % 3 + 1)
    assert count(stipple, splats) == 1_000_000 - 1000 * 2
    assert resident() - start < 500
