# SPDX-License-Identifier: GPL-3.0-or-later
"""Max Splats under Simplify: shared in proportion to the objects' own budgets, never above them."""

import bpy
import pytest

import scenes
import series
from shots import camera, splat_wall  # noqa: F401


@pytest.fixture
def pair(tmp_path):
    """Two objects of 600 and 300 splats."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    found = []
    for name, x, budget in (('a', 0.0, 600), ('b', 5.0, 300)):
        obj = scenes.make_splats(scenes.quad(name, offset=(x, 0, 0)), anchors=budget)
        found.append(obj)
    bpy.context.view_layer.update()
    return found


def counts(stipple, objects):
    bpy.context.view_layer.update()
    return [stipple.scene.source.splat_data.count(obj.data) for obj in objects]


def simplify(most=0, most_render=0, on=True):
    scene = bpy.context.scene
    scene.stipple.max_splats, scene.stipple.max_splats_render = most, most_render
    scene.render.use_simplify = on
    return scene


def drawn(stipple, mode):
    """Splats of each instance that an engine draws."""
    gathered = stipple.scene.instances.gather(bpy.context.evaluated_depsgraph_get(), mode)
    return sorted(placed[0].info().count for placed in gathered)


def test_the_viewport_shares_the_limit_by_budget(stipple, pair):
    scene = simplify(450)
    assert counts(stipple, pair) == [300, 150]
    scene.stipple.max_splats = 3000
    assert counts(stipple, pair) == [600, 300]  # never above their own
    scene.stipple.max_splats = 90
    assert counts(stipple, pair) == [60, 30]
    assert [obj.data.stipple.anchors for obj in pair] == [600, 300]
    scene.render.use_simplify = False
    assert counts(stipple, pair) == [600, 300]


def test_the_limit_counts_only_while_simplify_is_on(stipple, pair):
    scene = simplify(90, 90, on=False)
    assert counts(stipple, pair) == [600, 300] and drawn(stipple, 'RENDER') == [300, 600]
    scene.render.use_simplify = True
    assert counts(stipple, pair) == [60, 30] and drawn(stipple, 'RENDER') == [30, 60]


def test_renders_have_a_limit_of_their_own(stipple, pair):
    simplify(90, 300)
    assert drawn(stipple, 'RENDER') == [100, 200] and drawn(stipple, 'VIEWPORT') == [30, 60]
    pair[1].data.stipple.anchors_render = 1200
    assert drawn(stipple, 'RENDER') == [100, 200]  # 600 : 1200 now


def test_a_budget_that_grows_takes_from_the_others(stipple, pair):
    simplify(450)
    pair[1].data.stipple.anchors = 600
    assert counts(stipple, pair) == [225, 225]


def test_instances_count_each_for_itself_and_hidden_objects_do_not(stipple, pair):
    simplify(450, 450)
    twin = scenes.link(bpy.data.objects.new('twin', pair[0].data))
    assert counts(stipple, pair) == [180, 90]  # 180 + 180 + 90
    assert drawn(stipple, 'RENDER') == [90, 180, 180]
    twin.hide_viewport = True
    assert counts(stipple, pair) == [300, 150]
    pair[0].hide_viewport = True
    assert counts(stipple, pair)[1] == 300


def test_splats_without_a_budget_leave_the_rest_to_others(stipple, pair):
    wall = splat_wall(stipple, 'wall', 0.0, count=10)
    simplify(550, 550)
    assert counts(stipple, [*pair, wall]) == [300, 150, 100]
    assert drawn(stipple, 'RENDER') == [100, 150, 300]
    simplify(50, 50)  # fewer than those
    assert counts(stipple, [*pair, wall]) == [1, 1, 100]


def test_splats_that_were_edited_by_hand_stay(stipple, pair):
    pair[0].data.stipple.edited = True
    simplify(900 - 150)
    assert counts(stipple, pair) == [600, 150]


def test_series_share_the_limit_frame_by_frame(stipple, pair, tmp_path):
    swarm = series.load(series.write(stipple, tmp_path / 'swarm', range(1, 4)))
    swarm.data.stipple.ratio = swarm.data.stipple.ratio_render = 0.5
    whole = series.COUNT // 2 + 900
    simplify(whole // 2, whole // 2)
    shared = whole // 2 / whole
    expected = [int(600 * shared), int(300 * shared), int(series.COUNT // 2 * shared)]
    assert counts(stipple, [*pair, swarm]) == expected
    bpy.context.scene.frame_set(2)
    assert counts(stipple, [*pair, swarm]) == expected
    assert drawn(stipple, 'RENDER') == sorted(expected)


def test_a_keyframed_budget_is_shared_at_every_frame(stipple, pair):
    settings = pair[1].data.stipple
    for frame, budget in ((1, 300), (2, 600)):
        settings.anchors = budget
        settings.keyframe_insert('anchors', frame=frame)
    simplify(450)
    bpy.context.scene.frame_set(2)
    assert counts(stipple, pair) == [225, 225]
    bpy.context.scene.frame_set(1)
    assert counts(stipple, pair) == [300, 150]


@pytest.mark.parametrize('engine', ['STIPPLE', 'STIPPLE_CYCLES', 'CYCLES'])
def test_every_engine_follows_the_limit(stipple, pair, tmp_path, engine, monkeypatch):
    scenes.camera(width=8, height=8)
    scene = simplify(0, 450)
    scene.render.engine = engine
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    seen = []
    decode = stipple.scene.source.decoded.begin
    monkeypatch.setattr(stipple.scene.source.decoded, 'begin',
                        lambda data, settings, *more: seen.append(settings.anchors) or decode(data, settings, *more))

    def note(*_):
        if engine == 'CYCLES':  # it draws what is stored
            seen.extend(stipple.scene.source.splat_data.count(obj.data) for obj in pair)

    bpy.app.handlers.render_post.append(note)
    try:
        scenes.render_pixels(tmp_path)
    finally:
        bpy.app.handlers.render_post.remove(note)
    assert seen == [300, 150]
    assert counts(stipple, pair) == [600, 300]


def test_the_setting_stands_in_the_simplify_panels(stipple):
    panels = stipple.panels.render
    added = [(panel, draw) for panel, draw in panels._added_panels() if 'simplify' in panel.__name__]
    assert {panel.__name__ for panel, _ in added} == {
        'RENDER_PT_simplify_viewport', 'RENDER_PT_simplify_render', 'CYCLES_RENDER_PT_simplify_viewport',
        'CYCLES_RENDER_PT_simplify_render'}
    for name in ('RENDER_PT_simplify', 'RENDER_PT_simplify_viewport', 'RENDER_PT_simplify_render'):
        assert 'STIPPLE' in getattr(bpy.types, name).COMPAT_ENGINES
    for panel, draw in added:
        assert draw in panel.draw._draw_funcs
