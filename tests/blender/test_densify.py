# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats of an object multiply where views ask for it: from the operator to an object with a budget."""

import bpy
import pytest

import scenes


@pytest.fixture
def ball(tmp_path):
    """A ball with two colours and few splats that stand for it."""
    obj = scenes.two_coloured_ball(tmp_path)
    chosen = bpy.context.scene.stipple.fit
    for name, value in {'view_count': 6, 'view_size': 48, 'engine': 'WORKBENCH', 'max_splats': 150,
                        'quality': 'FAST'}.items():
        setattr(chosen, name, value)
    assert bpy.ops.stipple.splats_fit() == {'FINISHED'}
    return obj


def few():
    return next(o for o in bpy.data.objects if o.name.endswith(' Fit'))


def densify(ball, splats, **options):
    scenes.select(ball, splats)
    bpy.context.view_layer.objects.active = splats
    assert bpy.ops.stipple.splats_densify(strategy='adaptive(threshold=1e-7)', **options) == {'FINISHED'}
    return splats


def test_a_ball_gets_more_splats_and_keeps_a_budget(stipple, ball):
    splats = few()
    before, count = splats.data, splats.data.stipple.source_count
    densify(ball, splats, max_splats=count + 20)
    stipple_data = splats.data.stipple
    assert stipple_data.source_kind == 'TREE' and stipple_data.source_count == count + 20
    assert stipple.scene.source.splat_data.count(splats.data) == count + 20
    # The old datablock is as it was: what else uses it, and undo, go on with it.
    assert splats.data != before and stipple.scene.source.splat_data.count(before) == count
    stipple_data.ratio = 0.5
    assert stipple.scene.source.splat_data.count(splats.data) == round(0.5 * (count + 20))


def test_where_the_scene_stands_does_not_matter(stipple, ball):
    """Moved and enlarged together, the splats and what they stand for see the same views."""
    splats = few()
    start = splats.data
    here = stipple.scene.source.splat_data.read(densify(ball, splats, max_splats=100000).data)
    for obj in (ball, splats):
        obj.scale, obj.location = (3, 3, 3), (5, -2, 1)
    splats.data = start
    there = stipple.scene.source.splat_data.read(densify(ball, splats, max_splats=100000).data)
    # Pixels differ by rounding, and with them a splat at the threshold; cameras in another place would see another
    # half.
    assert abs(here.count - there.count) <= 0.05 * here.count
    assert here.count > start.stipple.source_count


def test_undo_brings_the_splats_back(stipple, ball):
    splats = few()
    count = splats.data.stipple.source_count
    bpy.ops.ed.undo_push(message='before')
    densify(ball, splats, max_splats=count + 20)
    bpy.ops.ed.undo_push(message='after')
    bpy.ops.ed.undo()
    assert few().data.stipple.source_count == count == stipple.scene.source.splat_data.count(few().data)


def test_messages(stipple, ball):
    splats = few()
    scenes.select(splats)
    bpy.context.view_layer.objects.active = splats
    data, count = splats.data, splats.data.stipple.source_count
    run = bpy.ops.stipple.splats_densify
    scenes.refuses(lambda: run(strategy='best'), "strategy is 'best'")
    scenes.refuses(lambda: run(max_splats=1), 'at most 1 splats are asked for')
    splats.scale = (1, 2, 1)
    bpy.context.view_layer.update()
    scenes.refuses(run, 'scaled unevenly')
    splats.scale = (1, 1, 1)
    bpy.context.view_layer.update()
    bpy.context.scene.stipple.fit.views_from = 'DATASET'
    scenes.refuses(run, 'No data set is chosen')
    bpy.context.scene.stipple.fit.views_from = 'RIG'
    bpy.data.objects.remove(ball)
    scenes.refuses(run, 'no mesh to take views of')
    assert splats.data == data and stipple.scene.source.splat_data.count(data) == count
