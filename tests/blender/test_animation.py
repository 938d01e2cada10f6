# SPDX-License-Identifier: GPL-3.0-or-later
"""`blender -b file -a` with a keyframed budget, in Blender processes of their own."""

import os
import subprocess

import bpy
import pytest

import scenes

# Notes what each frame was rendered with; runs in the second Blender, before -a.
SPY = '''
import bpy, sys
bpy.ops.preferences.addon_enable(module='stipple')
package = sys.modules['stipple']
scene = bpy.context.scene
decode = package.scene.instances.decoded.begin
def noted(path, settings, *more):
    print('DECODED', scene.frame_current, settings.anchors, flush=True)
    return decode(path, settings, *more)
package.scene.instances.decoded.begin = noted
def stored(scene, *_):
    obj = next(o for o in bpy.data.objects if package.scene.source.splat_data.is_splat_object(o))
    print('STORED', scene.frame_current, package.scene.source.splat_data.count(obj.data), flush=True)
bpy.app.handlers.render_post.append(stored)
'''


@pytest.fixture
def animated(tmp_path):
    """Frames 1 to 3, budget 500 to 1500, a quad under a camera."""
    quad = scenes.quad()
    scenes.material('red', (0.8, 0.1, 0.1), quad)
    scenes.camera((0, 0, 6), width=32, height=32)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    obj = scenes.make_splats(quad, anchors=500)
    settings = obj.data.stipple
    for frame, budget in ((1, 500), (3, 1500)):
        settings.anchors = budget
        settings.keyframe_insert('anchors', frame=frame)
    scene = bpy.context.scene
    scene.frame_set(1)
    scene.frame_start, scene.frame_end = 1, 3
    scene.render.image_settings.file_format = 'PNG'
    scene.render.filepath = str(tmp_path / 'frame_')
    return obj


def render(tmp_path, engine):
    scene = bpy.context.scene
    scene.render.engine = engine
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    bpy.ops.wm.save_mainfile()
    (tmp_path / 'spy.py').write_text(SPY)
    result = subprocess.run([bpy.app.binary_path, '--background', '--factory-startup', str(tmp_path / 'a.blend'),
                             '--python', str(tmp_path / 'spy.py'), '--render-anim'], env=os.environ, timeout=120,
                            capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    assert sorted(p.name for p in tmp_path.glob('frame_*.png')) == [f'frame_000{i}.png' for i in (1, 2, 3)]
    lines = [line.split() for line in result.stdout.splitlines()]
    return ({int(l[1]): int(l[2]) for l in lines if l[:1] == ['DECODED']},
            {int(l[1]): int(l[2]) for l in lines if l[:1] == ['STORED']})


def test_engine_stipple_decodes_the_frames_budget(animated, tmp_path):
    decoded, _ = render(tmp_path, 'STIPPLE')
    assert decoded == {1: 500, 2: 1000, 3: 1500}


def test_cycles_finds_the_frames_splats_in_the_attributes(animated, tmp_path):
    _, stored = render(tmp_path, 'CYCLES')
    assert stored == {1: 500, 2: 1000, 3: 1500}


def test_render_budget_in_cycles(animated, tmp_path):
    animated.data.stipple.anchors_render = 700
    _, stored = render(tmp_path, 'CYCLES')
    assert stored == {1: 700, 2: 700, 3: 700}


def test_still_in_cycles_gives_the_viewport_its_budget_back(animated, tmp_path, stipple):
    animated.data.animation_data_clear()
    animated.data.stipple.anchors = 800
    animated.data.stipple.anchors_render = 1200
    scene = bpy.context.scene
    scene.render.engine = 'CYCLES'
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    seen = []

    def note(*_):
        seen.append(stipple.scene.source.splat_data.count(animated.data))

    bpy.app.handlers.render_post.append(note)
    bpy.ops.render.render()
    bpy.app.handlers.render_post.remove(note)
    assert seen == [1200]
    assert stipple.scene.source.splat_data.count(animated.data) == 800
