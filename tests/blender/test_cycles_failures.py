# SPDX-License-Identifier: GPL-3.0-or-later
"""A Cycles that fails leaves passes without memory. What follows is one message, never a crash."""

import os
import subprocess

import _cycles
import bpy
import pytest

import scenes
from shots import camera, prepare, splat_wall  # noqa: F401

fails_to_denoise = pytest.mark.skipif(
    getattr(_cycles, 'with_openimagedenoise', True) or bpy.app.version >= (5, 0, 0),
    reason='this Cycles can denoise, or leaves the image as it is')

# The default scene with splats, as it comes out of the box. A crash must not take the tests along.
CHILD = '''
import sys
sys.path[:0] = {paths!r}
import bpy
bpy.ops.preferences.addon_enable(module='stipple')
package = sys.modules['stipple']
import test_files
from test_splat_data import make_arrays
test_files.write_ply(package, {folder!r} + '/in.ply', make_arrays(package, 100))
bpy.ops.stipple.splats_import(filepath={folder!r} + '/in.ply')
scene = bpy.context.scene
scene.render.engine = 'STIPPLE_CYCLES'
scene.cycles.samples = 1
scene.render.resolution_x = scene.render.resolution_y = 32
scene.render.filepath = {folder!r} + '/out.png'
{more}
def render():
    try:
        bpy.ops.render.render(write_still=True)
    except RuntimeError as error:
        print('REFUSED', str(error).strip().replace(chr(10), ' / '), flush=True)
render()
if {again}:
    bpy.ops.stipple.turn_denoising_off()
    render()
'''


def child(folder, more='', again=False):
    """What a Blender of its own prints; checks that it comes to its end."""
    here = os.path.dirname(os.path.abspath(__file__))
    script = CHILD.format(paths=[here, '/usr/lib/python3/dist-packages'], folder=str(folder), more=more, again=again)
    done = subprocess.run([bpy.app.binary_path, '--background', '--factory-startup', '--python-expr', script],
                          timeout=120, capture_output=True, text=True)
    # Blender ends with 1 after a render that was broken off.
    assert done.returncode in (0, 1) and 'Blender quit' in done.stdout, done.stdout + done.stderr
    return done.stdout


@fails_to_denoise
def test_the_default_scene_where_blender_cannot_denoise(tmp_path):
    """Refused before anything is drawn, with the way out, which works."""
    output = child(tmp_path, again=True)
    refusals = [line for line in output.splitlines() if line.startswith('REFUSED')]
    assert len(refusals) == 1 and 'built without OpenImageDenoise' in refusals[0] and 'turn Denoise off' in refusals[0]
    assert output.count('Build without OpenImageDenoiser') == 0
    assert (tmp_path / 'out.png').exists()


@fails_to_denoise
def test_a_cycles_that_fails_when_it_has_drawn(tmp_path):
    """As it is for failures that nobody foresees: Cycles' own message stays the only one. Two view layers, a border."""
    output = child(tmp_path, '''
package.cycles_functions.denoising_problem = lambda *_: ''
scene.view_layers.new('second')
scene.render.use_border = scene.render.use_crop_to_border = True
scene.render.border_max_x = 0.5
bpy.context.view_layer.use_pass_normal = bpy.context.view_layer.use_pass_object_index = True
''')
    refusals = [line for line in output.splitlines() if line.startswith('REFUSED')]
    assert len(refusals) == 1 and 'OpenImageDenoise' in refusals[0]
    assert not (tmp_path / 'out.png').exists()


@fails_to_denoise
def test_views_of_a_fit_whose_render_fails(stipple, tmp_path, monkeypatch):
    """What is captured of a failed render is nothing, and one message."""
    capture = stipple.scene.fit.view_capture
    ball = scenes.sphere()
    kept = capture._Kept.set
    monkeypatch.setattr(capture._Kept, 'set', lambda self, owner, **values: kept(
        self, owner, **{**values, **({'use_denoising': True} if 'use_denoising' in values else {})}))
    scenes.camera()
    settings = capture.CaptureSettings(engine='CYCLES', size=16, samples=1)
    with capture.Capture(bpy.context, [ball], settings) as views:
        with pytest.raises((stipple.binding.errors.StippleError, RuntimeError), match='OpenImageDenoise|no picture'):
            views.camera(bpy.context.scene.camera)


@fails_to_denoise
def test_the_panel_offers_to_turn_it_off(stipple, camera):  # noqa: F811
    splat_wall(stipple, 'wall', 0.0)
    scene = prepare('STIPPLE_CYCLES')
    problem = stipple.cycles_functions.denoising_problem
    scene.cycles.use_denoising = True
    assert 'OpenImageDenoise' in problem(scene, bpy.context.view_layer)
    bpy.context.view_layer.cycles.use_denoising = False  # of one layer
    assert problem(scene, bpy.context.view_layer) == ''
    bpy.context.view_layer.cycles.use_denoising = True
    assert bpy.ops.stipple.turn_denoising_off() == {'FINISHED'}
    assert not scene.cycles.use_denoising and problem(scene, bpy.context.view_layer) == ''
