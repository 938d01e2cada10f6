# SPDX-License-Identifier: GPL-3.0-or-later
"""One function keeps stored splats and settings in step: who calls it, when it writes, and what it leaves alone."""

import ast
from pathlib import Path

import bpy
import pytest

import scenes
import series


@pytest.fixture
def splats(tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    return scenes.make_splats(scenes.quad(), anchors=300)


@pytest.fixture
def writes(stipple, monkeypatch):
    """Counts of splats, in the order in which they were written into Blender data."""
    found, write = [], stipple.scene.source.splat_data.write

    def note(data, arrays, *more, **named):
        found.append(arrays.count)
        write(data, arrays, *more, **named)

    monkeypatch.setattr(stipple.scene.source.splat_data, 'write', note)
    return found


def count(stipple, obj):
    return stipple.scene.source.splat_data.count(obj.data)


def test_only_the_module_itself_calls_sync(stipple):
    """Operators write what they have made; following settings is the business of one module."""
    root = Path(stipple.__file__).parent
    callers = set()
    for path in root.rglob('*.py'):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call):
                name = getattr(node.func, 'attr', getattr(node.func, 'id', ''))
                if name in {'sync', 'try_sync', 'sync_all'}:
                    callers.add(path.relative_to(root).as_posix())
    assert callers == {'scene/source/sync.py'}


def test_the_handlers_that_call_it(stipple):
    module = stipple.scene.source.sync.__name__
    ours = {name for name in dir(bpy.app.handlers) if isinstance(getattr(bpy.app.handlers, name), list)
            and any(getattr(f, '__module__', '') == module for f in getattr(bpy.app.handlers, name))}
    assert {'frame_change_post', 'render_complete', 'render_cancel', 'undo_post', 'redo_post', 'load_post'} <= ours
    # These come too often, or before animation is evaluated.
    assert not ours & {'frame_change_pre', 'render_write', 'depsgraph_update_pre', 'render_stats'}


def test_a_property_writes_once_and_the_same_value_not_at_all(stipple, splats, writes):
    splats.data.stipple.anchors = 400
    assert writes == [400]
    splats.data.stipple.anchors = 400
    splats.data.stipple.anchors_render = 900  # shown by renders only
    bpy.context.view_layer.update()
    assert writes == [400]


def test_frames_write_where_something_is_animated_and_only_then(stipple, splats, writes):
    bpy.context.scene.frame_set(5)
    assert writes == []
    settings = splats.data.stipple
    for frame, budget in ((1, 100), (3, 300)):
        settings.anchors = budget
        settings.keyframe_insert('anchors', frame=frame)
    writes.clear()
    for frame in (1, 2, 3, 3, 4, 1):
        bpy.context.scene.frame_set(frame)
    assert writes == [100, 200, 300, 100]


def test_a_render_with_cycles_writes_its_budget_and_gives_the_viewports_back(stipple, splats, writes, tmp_path):
    splats.data.stipple.anchors_render = 500
    scenes.camera(width=8, height=8)
    scene = bpy.context.scene
    scene.render.engine = 'CYCLES'
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    scenes.render_pixels(tmp_path)
    assert writes == [500, 300] and count(stipple, splats) == 300


class Failing(bpy.types.RenderEngine):
    """Another engine, whose render fails: Blender then calls render_cancel."""

    bl_idname = 'STIPPLE_TEST_FAILING'
    bl_label = "Failing"

    def render(self, _depsgraph):
        self.report({'ERROR'}, 'fails on purpose')


def test_a_cancelled_render_gives_the_viewports_budget_back(stipple, splats, writes):
    splats.data.stipple.anchors_render = 500
    scenes.camera(width=8, height=8)
    bpy.utils.register_class(Failing)
    try:
        bpy.context.scene.render.engine = Failing.bl_idname
        scenes.refuses(bpy.ops.render.render, 'fails on purpose')
    finally:
        bpy.context.scene.render.engine = 'STIPPLE'
        bpy.utils.unregister_class(Failing)
    assert writes == [500, 300] and count(stipple, splats) == 300


def test_the_engine_stipple_writes_nothing(stipple, splats, writes, tmp_path):
    splats.data.stipple.anchors_render = 500
    scenes.camera(width=8, height=8)
    bpy.context.scene.render.engine = 'STIPPLE'
    scenes.render_pixels(tmp_path)
    assert writes == []


def test_settings_that_change_while_a_render_runs_wait_for_its_end(stipple, splats, writes, tmp_path):
    scenes.camera(width=8, height=8)
    scene = bpy.context.scene
    scene.render.engine = 'CYCLES'
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    seen = []

    def change(*_):
        splats.data.stipple.anchors = 350
        seen.append(list(writes))

    bpy.app.handlers.render_post.append(change)
    try:
        scenes.render_pixels(tmp_path)
    finally:
        bpy.app.handlers.render_post.remove(change)
    assert seen == [[]] and writes == [350]


def test_linked_duplicates_are_written_once(stipple, splats, writes):
    for _ in range(3):
        scenes.link(bpy.data.objects.new('twin', splats.data))
    splats.data.stipple.anchors = 200
    assert writes == [200]


def test_linked_data_follow_their_animation(stipple, splats, tmp_path):
    settings = splats.data.stipple
    for frame, budget in ((1, 100), (3, 300)):
        settings.anchors = budget
        settings.keyframe_insert('anchors', frame=frame)
    name = splats.name
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(tmp_path / 'a.blend'), link=True) as (_, here):
        here.objects = [name]
    linked = scenes.link(here.objects[0])
    for frame, expected in ((3, 300), (2, 200), (1, 100)):
        bpy.context.scene.frame_set(frame)
        arrays = stipple.scene.source.splat_data.read(linked.data)
        assert arrays.count == expected and arrays.scales.min() > 0


def test_overridden_data_have_a_budget_of_their_own(stipple, splats, tmp_path):
    name, data_name = splats.name, splats.data.name
    kind = 'meshes' if isinstance(splats.data, bpy.types.Mesh) else 'pointclouds'
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(tmp_path / 'a.blend'), link=True) as (_, here):
        here.objects = [name]
        setattr(here, kind, [data_name])  # linked for itself: only then can it be overridden for itself
    linked = scenes.link(here.objects[0])
    own = linked.data.override_create()
    obj = scenes.link(linked.override_create())
    obj.data = own
    own.stipple.anchors = 120
    assert stipple.scene.source.sync.problems == {}
    assert count(stipple, obj) == 120 and count(stipple, linked) == 300
    arrays = stipple.scene.source.splat_data.read(own)
    assert arrays.scales.min() > 0
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'b.blend'))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'b.blend'))
    again = next(o for o in bpy.data.objects if o.override_library is not None)
    assert again.data.stipple.anchors == 120
    assert count(stipple, again) == 120 and stipple.scene.source.splat_data.read(again.data).scales.min() > 0


def test_undo_restores_settings_and_splats_of_a_series(stipple, tmp_path):
    obj = series.load(series.write(stipple, tmp_path / 'swarm', range(1, 4)))
    bpy.ops.ed.undo_push(message='before')
    obj.data.stipple.ratio = 0.5
    bpy.ops.ed.undo_push(message='after')
    bpy.ops.ed.undo()
    obj = bpy.data.objects['swarm']
    assert obj.data.stipple.ratio == 1.0 and count(stipple, obj) == series.COUNT
    bpy.ops.ed.redo()
    assert count(stipple, bpy.data.objects['swarm']) == series.COUNT // 2


def test_a_new_file_forgets_the_problems_of_the_old(stipple, splats):
    splats.data.stipple.anchors = -1
    assert stipple.scene.source.sync.problems
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert stipple.scene.source.sync.problems == {}
