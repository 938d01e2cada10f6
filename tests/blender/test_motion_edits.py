# SPDX-License-Identifier: GPL-3.0-or-later
"""What is done to splats that move: it holds at all times, or one sentence says why it cannot."""

import shutil

import bpy
import numpy as np
import pytest
from mathutils import Vector

import scenes
from test_motion import ASSET, clip, model, shown  # noqa: F401

EDGE = 3.3  # of x, metres: a single splat of the clip is ever behind it


def at(stipple, obj, frame):
    bpy.context.scene.frame_set(frame)
    return stipple.scene.source.splat_data.read(obj.data)


def rows(stipple, obj, frame):
    """[N] which rows of the whole clip an object shows at a frame."""
    splats = at(stipple, obj, frame)
    sources = stipple.scene.source.sources
    whole = sources.whole_cloud(obj.data).read()
    found = np.array([np.flatnonzero((whole.positions == position).all(axis=1))[0] for position in splats.positions])
    np.testing.assert_array_equal(whole.opacities[found], splats.opacities)
    return found


@pytest.fixture
def box(stipple, clip):  # noqa: F811
    """An empty around the splats left of the middle, as they are at frame 2; selected with them."""
    middle = float(np.median(at(stipple, clip, 2).positions[:, 0]))
    empty = scenes.link(bpy.data.objects.new('Box', None))
    empty.location, empty.scale = (middle - 100.0, 0.0, 0.0), (100.0, 100.0, 100.0)
    scenes.select(clip, empty)
    return empty


def test_a_crop_holds_at_all_times(stipple, clip, box):  # noqa: F811
    total = len(shown(stipple, clip))
    inside = np.flatnonzero(at(stipple, clip, 2).positions[:, 0] <= box.location.x + 100.0)
    assert 0 < len(inside) < total
    assert bpy.ops.stipple.crop_by_box(keep='INSIDE') == {'FINISHED'}
    for frame in (2, 5, 1):
        np.testing.assert_array_equal(rows(stipple, clip, frame), inside)
    assert not stipple.scene.source.sync.problems
    # Twice, at another time: on top of the first. Then all come back.
    low = float(np.median(at(stipple, clip, 5).positions[:, 1]))
    box.location, box.scale = (0.0, low - 100.0, 0.0), (100.0, 100.0, 100.0)
    scenes.select(clip, box)
    assert bpy.ops.stipple.crop_by_box(keep='INSIDE') == {'FINISHED'}
    twice = rows(stipple, clip, 1)
    assert set(twice) < set(inside)
    assert bpy.ops.stipple.clear_mask() == {'FINISHED'}
    assert len(rows(stipple, clip, 4)) == total


@pytest.mark.parametrize('operator', ['crop_by_box', 'crop_by_mesh'])
def test_a_crop_over_the_clip_takes_what_ever_enters(stipple, clip, operator):  # noqa: F811
    """Whatever passes the box at a frame of the clip at which it shows, and nothing else."""
    known = stipple.scene.source.source_settings.of(clip.data.stipple)
    last = 1 + round((known.time_end - known.time_begin) * bpy.context.scene.render.fps)
    frames = [at(stipple, clip, frame) for frame in range(1, last + 1)]
    if operator == 'crop_by_box':
        cutter = scenes.link(bpy.data.objects.new('Box', None))
    else:
        bpy.ops.mesh.primitive_cube_add(size=2.0)
        cutter = bpy.context.object
    crop = getattr(bpy.ops.stipple, operator)
    scenes.select(clip, cutter)
    cutter.location, cutter.scale = (100.0 + EDGE, 0.0, 0.0), (100.0, 100.0, 100.0)
    inside = [(seen.positions[:, 0] > EDGE) & (seen.opacities >= 1 / 255) for seen in frames]
    ever = np.any(inside, axis=0)
    assert not inside[1].any() and 0 < ever.sum() < len(ever)
    bpy.context.scene.frame_set(2)
    with pytest.raises(RuntimeError, match='No splat'):
        crop(keep='INSIDE')
    assert crop(keep='INSIDE', times='CLIP') == {'FINISHED'}
    np.testing.assert_array_equal(rows(stipple, clip, 3), np.flatnonzero(ever))
    assert bpy.ops.stipple.clear_mask() == {'FINISHED'}
    assert crop(keep='OUTSIDE', times='CLIP') == {'FINISHED'}
    np.testing.assert_array_equal(rows(stipple, clip, 3), np.flatnonzero(~ever))
    assert bpy.ops.stipple.clear_mask() == {'FINISHED'}
    # What passes a place where nobody sees it is not there.
    unseen = next(seen for seen in frames if seen.opacities[0] < 1e-4)
    cutter.location, cutter.scale = unseen.positions[0], (0.01, 0.01, 0.01)
    with pytest.raises(RuntimeError, match='No splat'):
        crop(keep='INSIDE', times='CLIP')
    assert len(rows(stipple, clip, 3)) == len(ever)


def test_a_mask_stays_in_the_file_and_in_what_is_written(stipple, clip, box, tmp_path):  # noqa: F811
    assert bpy.ops.stipple.crop_by_box(keep='INSIDE') == {'FINISHED'}
    kept = len(shown(stipple, clip))
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 3
    scenes.select(clip)
    assert bpy.ops.stipple.splats_export(filepath=str(tmp_path / 'a.ply'), frames='SCENE', use_selection=True,
                                         up_axis='Z', budget='FULL') == {'FINISHED'}
    for frame in (1, 2, 3):
        path = next(p for p in tmp_path.iterdir() if p.name.endswith(f'{frame}.ply'))
        cloud = stipple.binding.cloud.Cloud.load(stipple.scene.source.sources.context(), str(path))
        np.testing.assert_allclose(cloud.positions(), at(stipple, clip, frame).positions, atol=1e-6)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'b.blend'))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'b.blend'))
    obj = next(o for o in bpy.data.objects if stipple.scene.source.splat_data.is_splat_object(o))
    assert len(rows(stipple, obj, 3)) == kept


def test_what_is_selected_is_erased_and_separated_at_all_times(stipple, clip):  # noqa: F811
    total = len(shown(stipple, clip))
    stored = clip.data.stipple
    stored.frame_start, stored.frame_speed = 2, 0.5
    places = at(stipple, clip, 3).positions
    radius = float(np.quantile(np.linalg.norm(places - places[0], axis=1), 0.3))
    near = np.flatnonzero(np.linalg.norm(places - places[0], axis=1) <= radius)
    scenes.select(clip)

    def choose():
        assert bpy.ops.stipple.select_sphere(center=tuple(clip.matrix_world @ Vector(places[0].tolist())),
                                             radius=radius) == {'FINISHED'}

    choose()
    assert bpy.ops.stipple.separate_selected() == {'FINISHED'}
    part = bpy.context.view_layer.objects.active
    assert part != clip and part.data.stipple.frame_start == 2 and part.data.stipple.frame_speed == 0.5
    for frame in (3, 1, 6):
        found = at(stipple, part, frame).positions
        rest = at(stipple, clip, frame).positions
        assert len(found) + len(rest) == total and abs(len(found) - len(near)) <= 1
        whole = stipple.scene.source.sources.whole_cloud(clip.data).positions()
        np.testing.assert_array_equal(np.sort(np.concatenate([found, rest]), axis=0), np.sort(whole, axis=0))
    assert np.abs(at(stipple, part, 3).positions - at(stipple, part, 6).positions).max() > 1e-5


def test_floaters_and_a_grade_hold_at_all_times(stipple, clip):  # noqa: F811
    total = len(shown(stipple, clip))
    faint = float(np.median(at(stipple, clip, 3).opacities))
    scenes.select(clip)
    assert bpy.ops.stipple.delete_floaters(by_opacity=True, min_opacity=faint, by_size=False,
                                           by_connectivity=False) == {'FINISHED'}
    left = rows(stipple, clip, 3)
    assert 0 < len(left) < total and (at(stipple, clip, 3).opacities >= faint).all()
    np.testing.assert_array_equal(rows(stipple, clip, 6), left)
    before = at(stipple, clip, 4)
    clip.data.stipple.grade_opacity = 0.5
    np.testing.assert_allclose(at(stipple, clip, 4).opacities, 0.5 * before.opacities, rtol=1e-6)
    later = at(stipple, clip, 6).opacities
    clip.data.stipple.grade_opacity = 1.0
    np.testing.assert_allclose(later, 0.5 * at(stipple, clip, 6).opacities, rtol=1e-6)


def test_what_would_keep_one_moment_says_so(stipple, clip):  # noqa: F811
    scenes.select(clip)
    for call in (bpy.ops.stipple.apply_transform, bpy.ops.stipple.splats_densify):
        scenes.refuses(call, 'is a clip of splats that move')
    other = clip.copy()
    other.data = clip.data.copy()
    scenes.link(other)
    scenes.select(clip, other)
    scenes.refuses(bpy.ops.stipple.merge_splats, 'is a clip of splats that move')
    scenes.select(clip)
    assert bpy.ops.stipple.select_all(action='SELECT') == {'FINISHED'}
    scenes.refuses(bpy.ops.stipple.fill_erased, 'is a clip of splats that move')
    # The way out that it names: the present moment, which stands still.
    now = at(stipple, clip, 4).positions
    assert bpy.ops.stipple.use_as_new_source() == {'FINISHED'}
    np.testing.assert_allclose(at(stipple, clip, 2).positions, now, atol=1e-6)
    assert bpy.ops.stipple.apply_transform() == {'FINISHED'}


def test_another_clip_in_its_place_brings_its_own_times(stipple, clip, tmp_path):  # noqa: F811
    """Relink notes the new file's seconds."""
    path = tmp_path / 'other.stipple.safetensors'
    settings = model(stipple, clip).settings()
    shutil.copy(tmp_path / ASSET.name, path)
    known = stipple.scene.source.source_settings.of(clip.data.stipple)
    assert (known.time_begin, known.time_end) == (settings.time_begin, settings.time_end)
    clip.data.stipple.source_settings = clip.data.stipple.source_settings.replace(
        f'"time_end": {settings.time_end}', '"time_end": 99.0')
    assert stipple.scene.source.source_settings.of(clip.data.stipple).time_end == 99.0
    scenes.select(clip)
    assert bpy.ops.stipple.relink(filepath=str(path)) == {'FINISHED'}
    assert stipple.scene.source.source_settings.of(clip.data.stipple).time_end == settings.time_end
