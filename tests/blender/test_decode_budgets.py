# SPDX-License-Identifier: GPL-3.0-or-later
"""Prepare Budgets of splats with a keyframed budget: each is decoded once, and nothing has to be when it is shown."""

import os
import subprocess

import bpy
import pytest

import scenes
import series
from test_decoding import ENGINES, count_of, decodes, prepare_render, source  # noqa: F401
from test_latent import EACH, splats, take_weights_away  # noqa: F401

BYTES = 4 * 14  # of a splat of degree 0


@pytest.fixture
def animated(source, splats):  # noqa: F811
    """40 to 60 anchors over frames 1 to 5, 70 in renders; frame 2 is shown."""
    settings = splats.data.stipple
    for frame, anchors in ((1, 40), (5, 60)):
        settings.anchors = anchors
        settings.keyframe_insert('anchors', frame=frame)
    settings.anchors_render = 70
    scenes.make_linear(splats.data)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 5
    scene.frame_set(2)
    scenes.select(splats)
    source.decoded.forget()
    return splats


def test_every_budget_is_decoded_once(source, animated, decodes, capfd):  # noqa: F811
    assert bpy.ops.stipple.decode_budgets() == {'FINISHED'}
    assert sorted(decodes) == [40, 45, 50, 55, 60, 70]
    size = BYTES * EACH * (40 + 45 + 50 + 55 + 60 + 70)
    assert source.decoded.cached(animated.data) == (6, size)
    text = capfd.readouterr().out
    assert f"6 budgets of '{animated.name}' are decoded, 6 of them now, in " in text
    assert f'they take {size / 1e6:.1f} MB of memory' in text
    # The scene is as it was.
    assert bpy.context.scene.frame_current == 2 and count_of(source, animated) == 45 * EACH
    assert bpy.ops.stipple.decode_budgets() == {'FINISHED'}
    assert len(decodes) == 6 and '6 budgets' in capfd.readouterr().out


@pytest.mark.parametrize('engine', (*ENGINES, 'CYCLES'))
def test_playing_and_rendering_then_take_no_decode(source, animated, decodes, tmp_path, engine):  # noqa: F811
    assert bpy.ops.stipple.decode_budgets() == {'FINISHED'}
    decodes.clear()
    for frame in (1, 2, 3, 4, 5, 1):
        bpy.context.scene.frame_set(frame)
        assert count_of(source, animated) == (35 + 5 * frame) * EACH
    prepare_render(engine)
    bpy.context.scene.render.filepath = str(tmp_path / 'frame_')
    bpy.ops.render.render(animation=True)
    assert len(list(tmp_path.glob('frame_*'))) == 5 and decodes == []


def test_a_budget_that_is_not_animated_is_prepared_for_renders(source, splats, decodes):  # noqa: F811
    splats.data.stipple.anchors_render = 64
    scenes.select(splats)
    decodes.clear()
    assert bpy.ops.stipple.decode_budgets() == {'FINISHED'}
    assert decodes == [40, 64]


def test_max_splats_counts(source, animated, decodes):  # noqa: F811
    scene = bpy.context.scene
    scene.render.use_simplify = True
    scene.stipple.max_splats, scene.stipple.max_splats_render = 50 * EACH, 36 * EACH
    decodes.clear()
    assert bpy.ops.stipple.decode_budgets() == {'FINISHED'}
    assert sorted(set(decodes)) == [36, 40, 45, 50]


def test_more_than_is_kept_is_refused_before_anything_is_decoded(stipple, source, animated, decodes):  # noqa: F811
    animated.data.stipple.anchors_render = 1000  # 1.8 MB
    chosen = stipple.preferences.get()
    try:
        chosen.budget_cache = 1
        text = scenes.refuses(bpy.ops.stipple.decode_budgets, 'choose a larger Budget Cache')
        assert "6 budgets of 'thing' take 2.2 MB, and at most 1.0 MB are kept" in text
        assert decodes == [] and source.decoded.cached() == (0, 0)
        chosen.budget_cache = 3
        assert bpy.ops.stipple.decode_budgets() == {'FINISHED'}
    finally:
        chosen.budget_cache = 0


def test_the_memory_limit_holds_for_budgets_and_their_decoding(stipple, source, animated, decodes):  # noqa: F811
    chosen = stipple.preferences.get()
    try:
        chosen.memory_limit = 32  # the budgets take half a megabyte, decoding some 70
        scenes.refuses(bpy.ops.stipple.decode_budgets, 'the memory limit is 34 MB')
        assert decodes == []
    finally:
        chosen.memory_limit = 0
        source.decoded.forget()


def test_missing_weights_are_one_error(stipple, source, animated, decodes, tmp_path):  # noqa: F811
    take_weights_away(stipple, tmp_path)
    scenes.refuses(bpy.ops.stipple.decode_budgets, 'decoder.safetensors')
    assert decodes == [] and count_of(source, animated) == 45 * EACH and bpy.context.scene.frame_current == 2
    (tmp_path / 'decoder.safetensors').rename(tmp_path / 'weights' / 'decoder.safetensors')
    assert bpy.ops.stipple.decode_budgets() == {'FINISHED'}


def test_a_source_that_is_gone_is_one_error(source, animated, tmp_path):  # noqa: F811
    for path in tmp_path.rglob('thing*.safetensors'):
        path.unlink()
    scenes.refuses(bpy.ops.stipple.decode_budgets, 'is missing')


def test_what_was_decoded_before_a_cancel_stays(stipple, source, animated, decodes, monkeypatch, capfd):  # noqa: F811
    advance = stipple.jobs.Task.advance

    def cancelled_in_the_third(self, fraction, stage):
        if stage == 'budget 3 of 6':
            self.cancel()
        advance(self, fraction, stage)

    with monkeypatch.context() as patch:
        patch.setattr(stipple.jobs.Task, 'advance', cancelled_in_the_third)
        assert bpy.ops.stipple.decode_budgets() == {'CANCELLED'}
    assert "Cancelled: of 6 budgets of 'thing', 2 are decoded and stay so" in capfd.readouterr().out
    assert len(decodes) == source.decoded.cached(animated.data)[0] == 2
    assert bpy.ops.stipple.decode_budgets() == {'FINISHED'}
    assert len(decodes) == len(set(decodes)) == 6


def test_a_cancel_within_a_decode_ends_it(stipple, source, animated, monkeypatch):  # noqa: F811
    animated.data.stipple.anchors_render = 30_000  # seconds, even with this small network
    run = stipple.jobs.Task.run

    def cancelled(self, job, *more):
        if more and more[-1] == 'budget 2 of 6':
            self.cancel()
        return run(self, job, *more)

    monkeypatch.setattr(stipple.jobs.Task, 'run', cancelled)
    assert bpy.ops.stipple.decode_budgets() == {'CANCELLED'}
    assert source.decoded.cached(animated.data)[0] == 1


def test_the_splats_may_go_while_it_works(stipple, source, animated, monkeypatch):  # noqa: F811
    """In a window Blender goes on meanwhile; the work holds nothing of it."""
    name, advance = animated.name, stipple.jobs.Task.advance
    gone = []

    def deleted(self, fraction, stage):
        advance(self, fraction, stage)
        if not gone:
            gone.append(bpy.data.objects.remove(bpy.data.objects[name]))

    monkeypatch.setattr(stipple.jobs.Task, 'advance', deleted)
    assert bpy.ops.stipple.decode_budgets() == {'FINISHED'}
    assert gone and source.decoded.cached()[0] == 6


def test_who_has_no_budget_is_not_offered_it(stipple, source, tmp_path):  # noqa: F811
    assert not bpy.ops.stipple.decode_budgets.poll()
    scenes.select(scenes.quad())
    assert not bpy.ops.stipple.decode_budgets.poll()
    scenes.select(series.load(series.write(stipple, tmp_path / 'swarm', range(1, 4))))
    assert not bpy.ops.stipple.decode_budgets.poll() and bpy.ops.stipple.prepare_budgets.poll()


def test_splats_of_meshes_and_trees_are_prepared_too(source, decodes, tmp_path):  # noqa: F811
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    obj = scenes.make_splats(scenes.quad(), anchors=300)
    for frame, anchors in ((1, 300), (2, 500)):
        obj.data.stipple.anchors = anchors
        obj.data.stipple.keyframe_insert('anchors', frame=frame)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 2
    bpy.context.scene.frame_set(1)
    source.decoded.forget()
    decodes.clear()
    assert bpy.ops.stipple.decode_budgets() == {'FINISHED'}
    bpy.context.scene.frame_set(1)
    bpy.context.scene.frame_set(2)
    assert decodes == [300, 500] and count_of(source, obj) == 500


# Prepares and renders frames; says what was decoded when.
SCRIPT = '''
import bpy, sys
bpy.ops.preferences.addon_enable(module='stipple')
package = sys.modules['stipple']
package.preferences.get().weights_folder = sys.argv[-1]
model = package.binding.model.Model
for name in ('decode', 'decode_start'):
    def noted(self, settings, original=getattr(model, name)):
        print('DECODED', settings.anchors, flush=True)
        return original(self, settings)
    setattr(model, name, noted)
assert bpy.ops.stipple.decode_budgets() == {'FINISHED'}
print('PREPARED', flush=True)
bpy.ops.render.render(animation=True)
'''


def test_a_script_prepares_in_the_background(animated, tmp_path):  # noqa: F811
    prepare_render('STIPPLE')
    bpy.context.scene.render.filepath = str(tmp_path / 'frame_')
    bpy.ops.wm.save_mainfile()
    (tmp_path / 'script.py').write_text(SCRIPT)
    result = subprocess.run([bpy.app.binary_path, '--background', '--factory-startup', str(tmp_path / 'a.blend'),
                             '--python-exit-code', '3', '--python', str(tmp_path / 'script.py'), '--',
                             str(tmp_path / 'weights')], env=os.environ, timeout=200, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    before, after = result.stdout.split('PREPARED')
    assert before.count('DECODED') == 6 and 'DECODED' not in after
    assert len(list(tmp_path.glob('frame_*'))) == 5
