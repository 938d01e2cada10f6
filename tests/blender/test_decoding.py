# SPDX-License-Identifier: GPL-3.0-or-later
"""Decoding that takes long: what is waited for, what goes on beside Blender, what is kept, and how it is cancelled."""

import time

import bpy
import numpy as np
import pytest

import scenes
from test_latent import EACH, count, splats, take_weights_away  # noqa: F401

FLOATS = 14  # of a splat of degree 0
LONG = 10_000  # anchors that take half a second or more: Blender gets its turn meanwhile, on a busy machine too


@pytest.fixture
def source(stipple):
    yield stipple.scene.source
    stipple.scene.source.decoded.forget()


@pytest.fixture
def decodes(stipple, monkeypatch):
    """Anchors of what was decoded, in that order."""
    found = []
    for name in ('decode', 'decode_start'):
        original = getattr(stipple.binding.model.Model, name)
        monkeypatch.setattr(stipple.binding.model.Model, name, lambda self, settings, original=original:
                            found.append(settings.anchors) or original(self, settings))
    return found


@pytest.fixture
def viewed(source, monkeypatch):
    """As in a window: a slider is followed, and nothing that takes long is waited for."""
    monkeypatch.setattr(source.sync, '_has_views', lambda: True)
    monkeypatch.setattr(source.decode_progress, 'show', lambda is_busy: None)  # there is no window to show it in
    yield
    if bpy.app.timers.is_registered(source.sync.complete):
        bpy.app.timers.unregister(source.sync.complete)


def expect(source, monkeypatch, seconds):
    """What decodes are expected to take."""
    monkeypatch.setattr(source.decoded.times, 'estimate', lambda *_: seconds)


def move(source, obj, anchors):
    """A slider of a window is moved."""
    with source.sync.paused():
        obj.data.stipple.anchors = anchors
    source.decoded.allow(obj.data)
    source.sync.follow(obj)


def rest(source):
    """The timer that follows, until it ends."""
    end = time.monotonic() + 120
    while source.sync.complete() is not None:
        assert time.monotonic() < end
        time.sleep(0.005)


def test_times_are_judged_by_those_that_were_measured(source):
    times = source.decode_times.DecodeTimes()
    assert times.estimate('a', 1000) is None
    times.note('a', 1000, 0.1)
    assert times.estimate('a', 1000) == pytest.approx(0.1) and times.estimate('b', 1000) is None
    # Never too short: half of it takes half the time at most, twice of it four times.
    assert times.estimate('a', 500) == pytest.approx(0.05) and times.estimate('a', 2000) == pytest.approx(0.4)
    times.note('a', 16000, 6.4)
    assert times.estimate('a', 4000) == pytest.approx(0.8)
    times.note('a', 1000, 0.2)
    assert times.estimate('a', 1000) == pytest.approx(0.2)
    for size in range(1, 100):
        times.note('a', size, 1.0)
    assert times.estimate('a', 16000) == pytest.approx((16000 / 99) ** 2)  # the oldest are forgotten


def test_a_decode_tells_how_long_it_took(source, splats):  # noqa: F811
    path = source.source_paths.file_of(splats.data)
    source.decoded.times.forget()
    before = time.perf_counter()
    splats.data.stipple.anchors = 500
    assert 0 < source.decoded.times.estimate(path, 500 * EACH) <= time.perf_counter() - before


def test_a_budget_that_took_long_is_kept(source, splats, decodes, monkeypatch):  # noqa: F811
    monkeypatch.setattr(source.decoded, 'KEEP_SECONDS', 0.0)
    source.decoded.forget()
    settings = splats.data.stipple
    settings.anchors = 64
    first = source.splat_data.read(splats.data).positions.copy()
    settings.anchors = 80
    settings.anchors = 64
    assert decodes == [64, 80]
    np.testing.assert_array_equal(source.splat_data.read(splats.data).positions, first)
    assert source.decoded.cached(splats.data) == (2, 4 * FLOATS * EACH * (64 + 80)) == source.decoded.cached()


def test_what_is_quick_is_not_kept(source, splats, decodes, monkeypatch):  # noqa: F811
    monkeypatch.setattr(source.decoded, 'KEEP_SECONDS', 1e9)
    source.decoded.forget()
    for anchors in (64, 80, 64):
        splats.data.stipple.anchors = anchors
    assert decodes == [64, 80, 64] and source.decoded.cached() == (0, 0)


def test_the_budget_cache_has_a_size(stipple, source, splats, monkeypatch):  # noqa: F811
    monkeypatch.setattr(source.decoded, 'KEEP_SECONDS', 0.0)
    source.decoded.forget()
    chosen = stipple.preferences.get()
    try:
        chosen.memory_limit = 1000
        assert source.decoded.cache_limit() == 250 << 20
        chosen.budget_cache = 2000
        assert source.decoded.cache_limit() == 1000 << 20
        chosen.budget_cache = 1
        for anchors in (200, 201, 202, 200, 203):  # three of them are more than a mebibyte
            splats.data.stipple.anchors = anchors
        assert source.decoded.cached(splats.data) == (2, 4 * FLOATS * EACH * 403)
        decoder, at = source.decoded.Decoder(splats.data), stipple.binding.model.DecodeSettings
        order = stipple.binding.structs.AnchorOrder[splats.data.stipple.order]
        assert [decoder.is_kept(at(n, EACH, order)) for n in (200, 201, 202, 203)] == [True, False, False, True]
    finally:
        chosen.memory_limit = chosen.budget_cache = 0


def test_a_move_that_is_expected_to_be_quick_is_live(source, splats, viewed, monkeypatch):  # noqa: F811
    expect(source, monkeypatch, 0.01)
    monkeypatch.setattr(source.decoded, '_MOST_PATIENCE', 60.0)  # of a busy machine
    move(source, splats, 64)
    assert count_of(source, splats) == 64 * EACH and not source.decoded.is_decoding()


def test_a_move_that_is_expected_to_be_slow_waits_for_nothing(source, splats, viewed, monkeypatch):  # noqa: F811
    expect(source, monkeypatch, 10.0)
    move(source, splats, LONG)
    assert count_of(source, splats) == 40 * EACH and source.decoded.is_decoding()
    assert 0 <= source.decoded.decoding_share(splats.data) <= 1
    rest(source)
    assert count_of(source, splats) == LONG * EACH and not source.decoded.is_decoding()


def test_the_last_of_several_moves_wins(source, splats, viewed, monkeypatch):  # noqa: F811
    written, write = [], source.splat_data.write
    monkeypatch.setattr(source.splat_data, 'write', lambda data, arrays, *more, **named:
                        written.append(arrays.count) or write(data, arrays, *more, **named))
    expect(source, monkeypatch, 10.0)
    for anchors in (LONG, LONG - 100, LONG - 200, 90):
        move(source, splats, anchors)
    rest(source)
    assert written == [90 * EACH] and not source.decoded.is_decoding()
    # Back to what is shown: what was begun is not wanted any more.
    move(source, splats, LONG)
    move(source, splats, 90)
    assert source.decoded.names() == ()
    rest(source)
    assert written == [90 * EACH]


def test_a_cancelled_decode_leaves_the_splats_and_does_not_begin_again(source, splats, viewed,  # noqa: F811
                                                                       monkeypatch, decodes):
    expect(source, monkeypatch, 10.0)
    assert not bpy.ops.stipple.decoding_cancel.poll()
    move(source, splats, LONG)
    assert bpy.ops.stipple.decoding_cancel() == {'FINISHED'}
    rest(source)
    source.sync._follow_all()
    assert decodes == [LONG] and count_of(source, splats) == 40 * EACH
    assert source.decoded.is_declined(splats.data) and not source.sync.problems
    scenes.select(splats)
    assert bpy.ops.stipple.decoding_resume() == {'FINISHED'}
    assert bpy.app.timers.is_registered(source.sync.complete)
    rest(source)
    assert count_of(source, splats) == LONG * EACH and not bpy.ops.stipple.decoding_resume.poll()


def test_a_slider_that_moves_again_asks_again(source, splats, viewed, monkeypatch):  # noqa: F811
    expect(source, monkeypatch, 10.0)
    move(source, splats, LONG)
    source.decoded.decline()
    move(source, splats, 300)
    rest(source)
    assert count_of(source, splats) == 300 * EACH
    move(source, splats, LONG)  # what was declined once
    rest(source)
    assert count_of(source, splats) == LONG * EACH


def test_a_frame_is_followed_beside_blender_in_a_window(source, splats, viewed, monkeypatch):  # noqa: F811
    for frame, anchors in ((1, 40), (2, LONG)):
        splats.data.stipple.anchors = anchors
        splats.data.stipple.keyframe_insert('anchors', frame=frame)
    bpy.context.scene.frame_set(1)
    rest(source)
    assert count_of(source, splats) == 40 * EACH
    source.decoded.forget()
    expect(source, monkeypatch, 10.0)
    bpy.context.scene.frame_set(2)
    assert count_of(source, splats) == 40 * EACH and bpy.app.timers.is_registered(source.sync.complete)
    rest(source)
    assert count_of(source, splats) == LONG * EACH


def test_an_object_that_is_deleted_is_not_decoded_any_more(source, splats, viewed, monkeypatch):  # noqa: F811
    expect(source, monkeypatch, 10.0)
    move(source, splats, LONG)
    job = source.decoded._beside[splats.data.name_full].job
    bpy.data.objects.remove(splats)
    rest(source)
    assert source.decoded.names() == ()
    with pytest.raises(Exception, match='cancelled'):
        job.wait()


def test_undo_takes_the_decoding_back(source, splats, viewed, monkeypatch):  # noqa: F811
    expect(source, monkeypatch, 10.0)
    name = splats.name
    bpy.ops.ed.undo_push(message='before')
    move(source, splats, LONG)
    bpy.ops.ed.undo_push(message='after')
    bpy.ops.ed.undo()
    obj = bpy.data.objects[name]
    assert obj.data.stipple.anchors == 40 and source.decoded.names() == ()
    rest(source)
    assert count_of(source, obj) == 40 * EACH


def test_another_file_ends_it(source, splats, viewed, monkeypatch, tmp_path):  # noqa: F811
    bpy.ops.wm.save_mainfile()
    expect(source, monkeypatch, 10.0)
    move(source, splats, LONG)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'a.blend'))
    assert source.decoded.names() == () and source.sync.problems == {}
    obj = next(obj for obj in bpy.data.objects if source.splat_data.is_splat_object(obj))
    rest(source)
    assert count_of(source, obj) == 40 * EACH


def test_missing_weights_are_said_and_the_splats_stay(stipple, source, splats, viewed, monkeypatch,  # noqa: F811
                                                      tmp_path):
    expect(source, monkeypatch, 10.0)
    take_weights_away(stipple, tmp_path)
    move(source, splats, LONG)
    rest(source)
    assert 'decoder.safetensors' in source.sync.problems[splats.data.name] and count_of(source, splats) == 40 * EACH


ENGINES = ('STIPPLE', 'STIPPLE_CYCLES')


def prepare_render(engine):
    scenes.camera((0, 0, 1.5), width=64, height=64)
    scene = bpy.context.scene
    scene.render.engine = engine
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    scene.render.film_transparent = True


def native_work(stipple, engine):
    return getattr(stipple.cycles_engine if engine == 'STIPPLE_CYCLES' else stipple.engine,
                   'classes')[0]


@pytest.mark.parametrize('engine', ENGINES)
def test_a_render_says_how_far_its_decoding_is(stipple, source, splats, monkeypatch, tmp_path, engine):  # noqa: F811
    said = []
    monkeypatch.setattr(stipple.engine.NativeWork, '_say',
                        lambda self, fraction, stage: said.append((self._stats, fraction, stage)))
    splats.data.stipple.anchors_render = LONG
    prepare_render(engine)
    assert scenes.render_pixels(tmp_path)[..., 3].max() > 0
    shares = [fraction for stats, fraction, _ in said if stats == f"Decoding the splats of '{splats.name}'"]
    assert len(shares) > 1 and shares == sorted(shares) and shares[-1] <= 1
    # Once it is decoded there is nothing to say.
    said.clear()
    scenes.render_pixels(tmp_path)
    assert said and not any('Decoding' in stats for stats, _, _ in said)


@pytest.mark.parametrize('engine', ENGINES)
def test_esc_ends_a_render_that_decodes(stipple, source, splats, monkeypatch, tmp_path, engine,  # noqa: F811
                                        capfd):
    splats.data.stipple.anchors_render = LONG
    prepare_render(engine)
    work = native_work(stipple, engine)
    with monkeypatch.context() as patch:
        patch.setattr(work, '_cancelled', lambda self: True, raising=False)
        bpy.ops.render.render()
    text = capfd.readouterr().out
    assert text.count(f"cancelled while the splats of '{splats.name}' were decoded") == 1 and 'Traceback' not in text
    assert count_of(source, splats) == 40 * EACH and not source.decoded.is_decoding()
    assert scenes.render_pixels(tmp_path)[..., 3].max() > 0  # nothing is in the way of the next one


def test_another_engines_render_waits_for_its_budget(source, splats, tmp_path):  # noqa: F811
    splats.data.stipple.anchors_render = 300
    prepare_render('CYCLES')
    seen = []
    bpy.app.handlers.render_post.append(lambda *_: seen.append(count_of(source, splats)))
    try:
        scenes.render_pixels(tmp_path)
    finally:
        bpy.app.handlers.render_post.pop()
    assert seen == [300 * EACH] and count_of(source, splats) == 40 * EACH


def test_a_view_shows_what_is_stored_until_the_rest_is_there(stipple, source, splats, viewed, decodes,  # noqa: F811
                                                             monkeypatch):
    """The engine's own view, which Blender's thread draws."""
    monkeypatch.setattr(stipple.scene.instances, '_waits', lambda mode: False)
    expect(source, monkeypatch, 10.0)
    source.decoded.forget()
    depsgraph = bpy.context.evaluated_depsgraph_get()

    def shown():
        return [placed[0].info().count for placed in stipple.scene.instances.gather(depsgraph, 'VIEWPORT')]

    assert shown() == [40 * EACH] and decodes == []
    with source.sync.paused():
        splats.data.stipple.anchors = 500
    depsgraph.update()
    assert shown() == [40 * EACH] and decodes == [] and bpy.app.timers.is_registered(source.sync.complete)
    rest(source)
    depsgraph.update()
    assert shown() == [500 * EACH]


def count_of(source, obj):
    return source.splat_data.count(obj.data)
