# SPDX-License-Identifier: GPL-3.0-or-later
"""What panels offer for splats, and what of Blender's own they leave out."""

from types import SimpleNamespace

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


class Sentences:
    """A layout that notes the labels in it."""

    def __init__(self):
        self.labels = []

    def label(self, text='', icon='NONE'):
        self.labels.append((text, icon))

    def prop(self, *_arguments, **_options):
        pass

    def operator(self, *_arguments, **_options):
        return self

    operator_menu_enum = prop

    def box(self, *_arguments, **_options):
        return self

    row = column = split = box


@pytest.mark.parametrize('pixels', [180, 260, 500])
def test_sentences_of_the_render_panel_are_whole(stipple, imported, monkeypatch, pixels):
    """Blender cuts off what is wider than its panel: about seven pixels for a letter, three letters for an icon."""
    render = stipple.panels.render
    monkeypatch.setattr(render.cycles_functions, 'denoising_problem', lambda *_: True)
    scene = bpy.context.scene
    scene.stipple.splat_color, scene.view_settings.view_transform = 'AS_TRAINED', 'Raw'
    found = []
    for engine in ('STIPPLE_CYCLES', 'STIPPLE'):
        layout = Sentences()
        panel = type('Panel', (), {'layout': layout})
        context = type('Context', (), {'engine': engine, 'scene': scene, 'view_layer': bpy.context.view_layer,
                                       'preferences': SimpleNamespace(system=SimpleNamespace(ui_scale=1.0)),
                                       'region': SimpleNamespace(width=pixels)})
        render.STIPPLE_PT_render_splats.draw(panel, context)
        widths = [7 * (len(text) + (3 if icon != 'NONE' else 0)) for text, icon in layout.labels]
        assert max(widths) < pixels, layout.labels
        found.append(' '.join(text for text, _ in layout.labels))
    assert 'without a denoiser' in found[0] and 'do not appear in reflections' in found[0]
    assert 'changes colors' in found[1]


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
