# SPDX-License-Identifier: GPL-3.0-or-later
"""What panels offer for splats, and what of Blender's own they leave out."""

import bpy
import pytest

import scenes
from test_edits import import_arrays
from test_splat_data import make_arrays


@pytest.fixture
def imported(stipple, tmp_path):
    return import_arrays(stipple, tmp_path, make_arrays(stipple, count=50, degree=0))


def test_panels_about_faces_are_not_shown_for_splats(stipple, imported):
    shown = stipple.panels.mesh_panels
    mesh = scenes.link(bpy.data.objects.new('Mesh', bpy.data.meshes.new('Mesh')))

    def polled(name, obj):
        bpy.context.view_layer.objects.active = obj
        with bpy.context.temp_override(engine='CYCLES', mesh=mesh.data):
            return getattr(bpy.types, name).poll(bpy.context)

    assert 'DATA_PT_uv_texture' in shown._polls
    for name in shown._polls:
        assert not polled(name, imported), name
    assert polled('DATA_PT_vertex_groups', mesh)
    own = {name: getattr(bpy.types, name).__dict__.get('poll') for name in shown._polls}
    shown.unregister()
    try:
        assert polled('DATA_PT_vertex_groups', imported) or stipple.version.VERSION >= (5, 0, 0)
    finally:
        shown.register()
    assert {name for name in own} == set(shown._polls)


@pytest.mark.parametrize('engine, name', [('CYCLES', 'Cycles'), ('BLENDER_WORKBENCH', 'Workbench')])
def test_an_engine_that_does_not_draw_splats_is_named(stipple, imported, capsys, engine, name):
    scene, engines = bpy.context.scene, stipple.scene.view.splat_engines
    if bpy.app.version >= engines._BLENDER_DRAWS_SPLATS:
        pytest.skip('this Blender draws splats by itself')
    scene.render.engine = engine
    assert engines.hint(scene) == f'{name} does not draw the splats of 1 object'
    scene.camera = scenes.link(bpy.data.objects.new('Camera', bpy.data.cameras.new('Camera')))
    scene.render.resolution_x = scene.render.resolution_y = 8
    if engine == 'CYCLES':
        scene.cycles.use_denoising, scene.cycles.samples = False, 1  # not every build can denoise
    bpy.ops.render.render()
    assert f'{name} does not draw the splats of 1 object' in capsys.readouterr().out
    assert bpy.ops.stipple.use_engine(engine='STIPPLE') == {'FINISHED'}
    assert scene.render.engine == 'STIPPLE' and engines.hint(scene) == ''
    scene.render.engine = engine
    imported.hide_render = True
    assert engines.hint(scene) == ''


def test_of_two_waiting_fits_the_active_one_is_discarded(stipple, imported):
    proposals = stipple.scene.fit.fit_proposal
    second = scenes.link(bpy.data.objects.new('Second', imported.data.copy()))
    third = scenes.link(bpy.data.objects.new('Third', imported.data.copy()))
    for obj in (imported, second, third):
        proposals.propose(obj)
    bpy.context.view_layer.objects.active = second
    assert proposals.find(bpy.context) == second
    assert bpy.ops.stipple.fit_discard() == {'FINISHED'}
    assert 'Second' not in bpy.data.objects and imported.name in bpy.data.objects
    # None of them is active: the one that was made last.
    bpy.context.view_layer.objects.active = None
    assert proposals.find(bpy.context) == third
    assert not bpy.ops.stipple.splats_fit.poll(), 'a second fit would start while one waits'
    assert bpy.ops.stipple.fit_accept() == {'FINISHED'}
    # As older versions have marked it.
    imported[proposals.PROPOSED_KEY] = True
    assert proposals.find(bpy.context) == imported
    assert bpy.ops.stipple.fit_accept() == {'FINISHED'}
    assert bpy.ops.stipple.splats_fit.poll()
