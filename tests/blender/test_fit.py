# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats fitted to views of a scene: from the operator to an object with a budget."""

import importlib
import json
import os
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from mathutils import Vector

import photo_set
import scenes


@pytest.fixture
def fitting(stipple):
    return importlib.import_module('.scene.fit.fitting', stipple.__name__)


@pytest.fixture
def ball(tmp_path):
    return scenes.two_coloured_ball(tmp_path)


def settings(**values):
    """Few small views without light: seconds."""
    chosen = bpy.context.scene.stipple.fit
    for name, value in {'view_count': 10, 'view_size': 48, 'engine': 'WORKBENCH', 'max_splats': 2000,
                        'quality': 'FAST', **values}.items():
        setattr(chosen, name, value)
    return chosen


def fitted():
    assert bpy.ops.stipple.splats_fit() == {'FINISHED'}
    return next(o for o in bpy.data.objects if o.name.endswith(' Fit'))


def test_a_ball_is_fitted_and_gets_a_budget(stipple, ball, fitting, tmp_path):
    settings(report=str(tmp_path / 'report.json'))
    obj = fitted()
    count = obj.data.stipple.source_count
    assert obj.name == 'Sphere Fit' and 100 <= count <= 2000
    assert obj.data.stipple.source_kind == 'TREE' and obj.data.stipple.source.startswith('//')
    assert not ball.hide_render  # nothing is replaced
    splats = stipple.scene.source.splat_data.read(obj.data)
    # Nine of ten splats lie about the surface, by their opacity.
    distance = np.abs(np.linalg.norm(splats.positions, axis=1) - 1)
    weight = splats.opacities / splats.opacities.sum()
    assert weight[distance < 0.15].sum() > 0.9
    # Far above what an empty picture would have: 8 dB.
    assert fitting.state.figures.best_psnr > 20
    assert not fitting.state.is_running
    report = json.loads((tmp_path / 'report.json').read_text())
    assert report and (tmp_path / 'report.svg').exists()
    with_budget = obj.data.stipple
    with_budget.ratio = 0.25
    assert stipple.scene.source.splat_data.count(obj.data) == round(0.25 * count)


def test_the_report_is_an_image_that_the_file_keeps(stipple, ball, tmp_path):
    settings(view_count=4, view_size=32)
    obj = fitted()
    name = obj.name
    image = obj.data.stipple.fit_report
    assert image.name == 'Sphere Fit Report' and image.packed_file is not None and not image.is_dirty
    # Two columns of 960 / 2 units at 2 pixels; two rows for one budget.
    assert tuple(image.size) == (1920, 1280)
    assert not bpy.ops.stipple.show_report.poll()  # no window
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'b.blend'))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'b.blend'))
    image = bpy.data.objects[name].data.stipple.fit_report
    pixels = np.empty(1920 * 1280 * 4, np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(1280, 1920, 4)
    # White paper, dark titles at the top (the last rows), blue and orange curves below them.
    assert np.all(pixels[0, 0] == 1) and (pixels[1230:, :, :3].max(axis=2) < 0.2).sum() > 500
    colours = pixels[:1200, :, :3].reshape(-1, 3)
    for wanted in ((0x00, 0x72, 0xb2), (0xd5, 0x5e, 0x00)):
        assert (np.abs(colours - np.array(wanted) / 255).max(axis=1) < 0.02).sum() > 300


def test_the_same_fit_twice_gives_the_same_splats(stipple, ball, tmp_path):
    settings(view_count=4, view_size=32)
    first = stipple.scene.source.splat_data.read(fitted().data)
    for obj in [o for o in bpy.data.objects if o.name.endswith(' Fit')]:
        bpy.data.objects.remove(obj)
    scenes.select(ball)
    again = stipple.scene.source.splat_data.read(fitted().data)
    assert np.array_equal(first.positions, again.positions) and np.array_equal(first.sh, again.sh)


def test_a_fit_begins_with_the_splats_of_an_object(stipple, ball, fitting):
    def psnr(**values):
        settings(**values)
        scenes.select(ball)
        assert bpy.ops.stipple.splats_fit() == {'FINISHED'}
        return fitting.state.figures.best_psnr

    anew = psnr(max_splats=300)
    start = next(o for o in bpy.data.objects if o.name.endswith(' Fit'))
    start.name, count = 'Start', len(stipple.scene.source.splat_data.read(start.data).positions)
    on = psnr(begin_with=start)
    assert on > anew + 0.5
    assert len(stipple.scene.source.splat_data.read(start.data).positions) == count  # it stays as it was
    # It begins with them where they are shown.
    start.location = 2, 0, 0
    bpy.context.view_layer.update()
    assert psnr() < on - 0.5
    settings(max_splats=100)
    scenes.refuses(bpy.ops.stipple.splats_fit, "'Start', which the fit begins with, has ")
    bpy.data.objects.remove(start)
    assert bpy.context.scene.stipple.fit.begin_with is None


def test_a_field_decodes_at_any_budget(stipple, ball):
    settings(model='FIELD', view_count=6, view_size=32, max_splats=10_000)
    obj = fitted()
    data = obj.data.stipple
    splats_each = data.learned_gaussians
    assert data.source_kind == 'MODEL' and splats_each >= 4 and data.learned_least < data.learned_most == data.anchors
    assert data.anchors == 10_000 // splats_each
    assert stipple.scene.source.splat_data.count(obj.data) == data.anchors * splats_each
    for anchors in (200, 700):
        data.anchors = anchors
        assert stipple.scene.source.splat_data.count(obj.data) == anchors * splats_each
    # Splats per anchor are learned: nothing refuses whatever the setting of other models says.
    for chosen in (1, 5, splats_each):
        data.gaussians_per_anchor = chosen
        data.order = 'PROGRESSIVE' if chosen == 5 else 'SYSTEMATIC'
        data.seed = chosen
        assert stipple.scene.source.splat_data.count(obj.data) == 700 * splats_each
        assert not stipple.scene.source.sync.problems
        assert stipple.scene.source.sources.count_of(obj.data, 'RENDER') == 700 * splats_each
    scenes.select(obj)
    scenes.refuses(bpy.ops.stipple.delete_floaters, 'decoded from a learned field')
    path = bpy.path.abspath(data.source)
    moved = os.path.join(os.path.dirname(path), 'moved.stipple.safetensors')
    os.rename(path, moved)
    scenes.select(obj)
    assert bpy.ops.stipple.relink(filepath=moved) == {'FINISHED'} and 'moved' in data.source
    data.anchors = 300
    assert stipple.scene.source.splat_data.count(obj.data) == 300 * splats_each
    assert bpy.ops.stipple.use_as_new_source() == {'FINISHED'}
    assert data.source_kind == 'CLOUD' and data.learned_gaussians == data.learned_most == 0


@pytest.mark.parametrize('chosen,least,most', [
    ({'transparent': False}, 5, 1e9),                         # the world behind the ball
    ({'transparent': False, 'shell': 'OFF'}, 0, 2),
    ({}, 0, 2),                                               # alpha tells what belongs to the scene
    ({'transparent': False, 'rig': 'INSIDE'}, 1.3, 5),        # walls all around: right behind them
    ({'transparent': False, 'rig': 'INSIDE', 'shell': 'OFF'}, 0, 1.2),
], ids=str)
def test_a_field_has_a_shell_for_what_is_far_away(stipple, ball, chosen, least, most):
    if 'rig' in chosen:
        ball.data.flip_normals()
    settings(model='FIELD', view_count=4, view_size=32, max_splats=400, **chosen)
    # Not the very farthest, which chance has a part in.
    farthest = np.quantile(np.abs(stipple.scene.source.splat_data.read(fitted().data).positions).max(axis=1), 0.99)
    # The ball has a radius of 1, which a tenth is added to; Gaussians stand around their anchors.
    assert least < farthest < most


@pytest.mark.parametrize('model', ['FIELD', 'EXPLICIT'])
def test_an_asset_file_is_imported_with_its_budgets(stipple, ball, model):
    settings(model=model, view_count=4, view_size=32)
    obj = fitted()
    fitted_splats = stipple.scene.source.splat_data.read(obj.data)
    path = bpy.path.abspath(obj.data.stipple.source)
    assert bpy.ops.stipple.splats_import(filepath=path) == {'FINISHED'}
    imported = bpy.context.object
    assert imported != obj and imported.name.startswith('Sphere Fit') and 'stipple' not in imported.name
    data = imported.data.stipple
    assert data.source_kind == obj.data.stipple.source_kind and data.learned_most == obj.data.stipple.learned_most
    splats = stipple.scene.source.splat_data.read(imported.data)
    assert np.array_equal(splats.positions, fitted_splats.positions)
    assert np.allclose(imported.matrix_world, obj.matrix_world)
    before = splats.count
    if model == 'FIELD':
        data.anchors //= 2
    else:
        data.ratio = 0.5
    assert stipple.scene.source.splat_data.count(imported.data) == before // 2


def test_scene_cameras_serve_as_views(stipple, ball):
    for i in range(5):
        angle = i * 1.2566
        scenes.camera(location=(4 * np.sin(angle), -4 * np.cos(angle), 0), rotation=(np.pi / 2, 0, angle))
    settings(views_from='CAMERAS', view_size=32)
    assert stipple.scene.source.splat_data.count(fitted().data) > 0


@pytest.mark.parametrize('up_axis,up', [('AUTO', (0, 0, 1)), ('-Y', (0, -1, 0))])
def test_photographs_are_fitted_where_their_cameras_stand(stipple, ball, tmp_path, up_axis, up):
    name = stipple.__name__
    capture = importlib.import_module('.scene.fit.view_capture', name)
    ball.location.z = 0.5
    bpy.context.view_layer.update()
    photo_set.write(importlib.import_module('.scene.fit.view_rigs', name), capture, ball, tmp_path / 'photos', 12,
                    capture.CaptureSettings('WORKBENCH', 48))
    bpy.data.objects.remove(ball)
    settings(views_from='DATASET', dataset=str(tmp_path / 'photos'), up_axis=up_axis)
    assert bpy.ops.stipple.cameras_import(filepath=str(tmp_path / 'photos'), up_axis=up_axis) == {'FINISHED'}
    obj = fitted()
    assert obj.name == 'photos Fit' and obj.hide_get() is False
    bpy.context.view_layer.update()
    # Half a metre up in the data set's world, wherever that points.
    centre = obj.matrix_world @ Vector(np.median(stipple.scene.source.splat_data.read(obj.data).positions,
                                                 axis=0).tolist())
    assert (centre - 0.5 * (obj.matrix_world @ Vector((0, 0, 1)))).length < 0.2
    assert (obj.matrix_world @ Vector(up) - Vector((0, 0, 1))).length < 1e-5
    cameras = [other for other in bpy.data.objects if other.type == 'CAMERA']
    assert len(cameras) == 12
    for camera in cameras:
        towards = (centre - camera.matrix_world.translation).normalized()
        assert (camera.matrix_world.to_quaternion() @ Vector((0, 0, -1))).dot(towards) > 0.99
    # Its file says which way is up.
    assert bpy.ops.stipple.splats_import(filepath=bpy.path.abspath(obj.data.stipple.source)) == {'FINISHED'}
    assert np.allclose(bpy.context.object.matrix_world, obj.matrix_world)


def test_a_cancel_while_views_are_rendered_leaves_nothing(ball, fitting, stipple):
    task = fitting.FitTask(bpy.context, [ball], settings(), '')
    while 'Rendering view 2' not in task.poll()[2]:
        pass
    objects_before = {'Sphere', 'Stipple View'}
    assert set(bpy.data.objects.keys()) == objects_before
    task.cancel()
    with pytest.raises(stipple.binding.errors.CancelledError):
        task.wait()
    assert task.result is None and set(bpy.data.objects.keys()) == {'Sphere'}
    assert bpy.context.scene.render.engine != 'BLENDER_WORKBENCH'


def test_a_cancel_while_it_fits_keeps_the_best(ball, fitting):
    task = fitting.FitTask(bpy.context, [ball], settings(quality='FINE_DETAIL'), '')
    while fitting.state.figures is None or fitting.state.figures.iteration < 30:
        task.poll()
    task.cancel()
    task.wait()
    assert task.result.splats.count > 0 and fitting.state.figures.iteration < fitting.state.figures.iterations


@pytest.mark.parametrize('model', ('EXPLICIT', 'FIELD'))
def test_a_stopped_fit_goes_on_from_its_checkpoint(stipple, ball, fitting, tmp_path, model):
    few = settings(model=model, view_count=6, view_size=32, max_splats=400)
    read = stipple.scene.source.splat_data.read
    whole = read(fitted().data)
    bpy.data.objects.remove(bpy.data.objects['Sphere Fit'])
    few.checkpoint = str(tmp_path / 'c.safetensors')
    assert not fitting.has_checkpoint(few)
    task = fitting.FitTask(bpy.context, [ball], few, '')
    while fitting.state.figures is None or fitting.state.figures.iteration < 300:
        task.poll()
    task.cancel()
    task.wait()
    stopped = fitting.state.figures.iteration
    assert stopped < fitting.state.figures.iterations and fitting.has_checkpoint(few)
    few.seed = 1  # of another fit: refused, and kept
    scenes.select(ball)
    scenes.refuses(bpy.ops.stipple.splats_fit, 'seed')
    assert fitting.has_checkpoint(few)
    few.seed = 0
    task = fitting.FitTask(bpy.context, [ball], few, '')
    while fitting.state.figures is None or fitting.state.figures.iteration == 0:
        task.poll()
    assert fitting.state.figures.iteration >= stopped
    task.wait()
    went_on = task.result.splats
    assert np.array_equal(whole.positions, went_on.positions) and np.array_equal(whole.sh, went_on.sh)
    assert not fitting.has_checkpoint(few)  # the result is there


def test_begins_anew_where_it_shall_not_go_on(ball, fitting, tmp_path):
    few = settings(view_count=4, view_size=32, max_splats=400, checkpoint=str(tmp_path / 'c.safetensors'), resume=False)
    (tmp_path / 'c.safetensors').write_bytes(b'')
    fitted()
    assert not fitting.has_checkpoint(few)


@pytest.mark.parametrize('resume', [False, True])
def test_no_file_of_another_kind_is_replaced(ball, stipple, tmp_path, resume):
    """A model named as the checkpoint went with the end of the fit, any file named as the report at once."""
    mine = {tmp_path / 'c.safetensors': b'a model', tmp_path / 'scan.ply': b'ply', tmp_path / 'drawing.svg': b'<svg/>'}
    for path, content in mine.items():
        path.write_bytes(content)
    settings(view_count=4, view_size=32, max_splats=400, checkpoint=str(tmp_path / 'c.safetensors'), resume=resume)
    scenes.refuses(bpy.ops.stipple.splats_fit, 'c.safetensors')
    settings(checkpoint='', resume=False, report=str(tmp_path / 'scan.ply'))
    scenes.refuses(bpy.ops.stipple.splats_fit, 'scan.ply is a file of another kind')
    settings(report=str(tmp_path / 'drawing.json'))
    scenes.refuses(bpy.ops.stipple.splats_fit, 'drawing.svg is a file of another kind')
    assert {path: path.read_bytes() for path in mine} == mine
    settings(report='')


def test_ending_at_once_puts_the_scene_back(ball, fitting):
    scene = bpy.context.scene
    before = scene.render.engine, scene.render.resolution_x, scene.render.filepath
    task = fitting.FitTask(bpy.context, [ball], settings(), '')
    while 'Rendering view 2' not in task.poll()[2]:
        pass
    task.close()
    assert (scene.render.engine, scene.render.resolution_x, scene.render.filepath) == before
    assert not fitting.state.is_running


def test_messages(ball, stipple):
    refuses = scenes.refuses
    settings(views_from='CAMERAS')
    refuses(bpy.ops.stipple.splats_fit, 'no perspective or orthographic camera')
    settings(views_from='DATASET')
    refuses(bpy.ops.stipple.splats_fit, 'No data set is chosen')
    settings(views_from='DATASET', dataset='//nowhere')
    refuses(bpy.ops.stipple.splats_fit, 'nowhere')
    settings(views_from='RIG', dataset='', checkpoint='/tmp/fit.blend')
    refuses(bpy.ops.stipple.splats_fit, 'must end in .safetensors')
    settings(checkpoint='/nowhere/c.safetensors')
    refuses(bpy.ops.stipple.splats_fit, "no folder '/nowhere'")
    bpy.data.objects.remove(ball)
    settings(checkpoint='')
    refuses(bpy.ops.stipple.splats_fit, 'no mesh')
    assert not bpy.data.objects


def test_strategies_and_parts_are_those_of_the_library(stipple, ball, fitting):
    strategies = importlib.import_module('.scene.fit.strategies', stipple.__name__)
    native = importlib.import_module('.binding.strategies', stipple.__name__)
    library = stipple.scene.source.sources.context().library
    assert [item[0] for item in strategies.part_items()] == [entry.name for entry in native.strategy_parts(library)]
    # A part that the library gets has a box at once.
    parts = native.strategy_parts(library)
    another = native.StrategyEntry('another', "Another Part", "Does something", native.FitModel.EXPLICIT,
                                   'what goes', 30)
    shown = strategies._part_items((*parts, another))
    assert shown[-1] == ('another', "Another Part", "Does something. It decides what goes", 1 << 30)
    assert [item[3] for item in shown[:-1]] == [1 << entry.bit for entry in parts]
    names = [item[0] for item in strategies.strategy_items()]
    assert names[:2] == ['by_quality', 'adaptive'] and 'learned_density' not in names
    assert len({item[3] for item in strategies.strategy_items()}) == len(names)

    for quality, name in (('FAST', 'adaptive'), ('BALANCED', 'improved'), ('FINE_DETAIL', 'improved')):
        chosen = settings(quality=quality, strategy='by_quality')
        assert strategies.text_of(chosen) == name and strategies.summary(chosen).startswith(f'{name.title()}: ')
    chosen = settings(strategy='improved', parts={'opacity_correction'})
    assert strategies.text_of(chosen) == 'improved+opacity_correction'
    problem = strategies.problem(strategies.text_of(chosen))
    assert 'opacity_correction does not go with long_axis_split' in problem
    with pytest.raises(RuntimeError, match='does not go with'):
        bpy.ops.stipple.splats_fit()
    chosen.parts = {'growth_control'}
    assert strategies.problem(strategies.text_of(chosen)) is None
    assert fitted().data.stipple.source_count <= 2000


def test_a_window_says_what_begins_before_the_first_step(stipple):
    """A first step may take seconds, in which Blender draws nothing."""
    said, polls = [], []

    class Manager:
        def event_timer_add(self, *_arguments, **_options):
            return object()

        def progress_update(self, value):
            said.append(value)

        modal_handler_add = progress_begin = lambda self, *_arguments: None

    class Work(stipple.jobs.JobOperator):
        bl_label = 'Work'

        def start(self, _context):
            return Job()

    class Job:
        def poll(self):
            polls.append(len(said))
            return stipple.binding.structs.JobState.RUNNING, 0.25, 'Working'

    workspace = SimpleNamespace(status_text_set=said.append)
    context = SimpleNamespace(window_manager=Manager(), window=None, workspace=workspace)
    work, timer = Work(), SimpleNamespace(type='TIMER')
    assert work.run_in_window(context) == {'RUNNING_MODAL'}
    assert 'Work: Preparing 0%' in said[-1]
    work.modal(context, timer)
    assert not polls  # Blender draws now
    work.modal(context, timer)
    assert polls and 'Work: Working 25%' in said[-1]
