# SPDX-License-Identifier: GPL-3.0-or-later
"""Images to splats, with the small networks of a golden: what they make is noise, where it stands is not."""

import math
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Vector

import scenes

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import pipeline_weights  # noqa: E402

SMALL = {'canvas': '512', 'tokens': 64, 'steps': 3, 'anchors': 40, 'show_previews': False}
EACH = 32  # splats of an anchor


@pytest.fixture
def weights(stipple, tmp_path):
    folder = tmp_path / 'weights'
    folder.mkdir()
    pipeline_weights.split(folder)
    chosen = stipple.preferences.get()
    chosen.weights_folder, chosen.cache_folder = str(folder), str(tmp_path / 'cache')
    yield folder
    chosen.weights_folder = chosen.cache_folder = ''


@pytest.fixture
def picture(tmp_path):
    width, height, rgba = pipeline_weights.image()
    return save_image(tmp_path / 'chair.png', np.frombuffer(rgba, np.uint8).reshape(height, width, 4))


def save_image(path, pixels):
    """pixels [H,W,4] bytes, row 0 = top."""
    height, width, _ = pixels.shape
    image = bpy.data.images.new(path.stem, width, height, alpha=True)
    image.pixels.foreach_set((pixels[::-1].astype(np.float32) / 255).ravel())
    image.filepath_raw, image.file_format = str(path), 'PNG'
    image.save()
    bpy.data.images.remove(image)
    return path


def extent(stipple, obj):
    """(lowest, highest) corner of the splats that are seen, in the world, without the outermost."""
    splats = stipple.scene.source.splat_data.read(obj.data)
    seen = splats.opacities >= 0.1 if (splats.opacities >= 0.1).any() else slice(None)
    matrix = np.array(obj.matrix_world)
    points = splats.positions[seen] @ matrix[:3, :3].T + matrix[:3, 3]
    return np.percentile(points, 0.5, axis=0), np.percentile(points, 99.5, axis=0)


def test_an_image_becomes_splats_that_stand_on_the_cursor(stipple, weights, picture):
    bpy.context.scene.cursor.location = (1.0, 2.0, 3.0)
    assert bpy.ops.stipple.splats_from_image(filepath=str(picture), size=2.0, **SMALL) == {'FINISHED'}
    obj = bpy.context.object
    assert obj.name == 'chair Splats'
    assert stipple.scene.source.splat_data.count(obj.data) == 40 * EACH
    assert tuple(obj.location) == pytest.approx((1.0, 2.0, 3.0))
    # The network's +x, which the image shows, looks along -y.
    assert (obj.matrix_world.to_3x3() @ Vector((1, 0, 0)))[:] == pytest.approx((0, -1, 0), abs=1e-6)
    low, high = extent(stipple, obj)
    # The size was measured with 256 anchors, not these 40: a fifth of it is left for that.
    assert max(high - low) == pytest.approx(2.0, rel=0.2)
    assert low[2] == pytest.approx(3.0, abs=0.4)


def test_the_budget_decodes_again_and_travels_with_a_file(stipple, weights, picture, tmp_path):
    bpy.ops.stipple.splats_from_image(filepath=str(picture), **SMALL)
    obj = bpy.context.object
    obj.data.stipple.anchors = 33
    assert stipple.scene.source.splat_data.count(obj.data) == 33 * EACH
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'a.blend'))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'a.blend'))
    obj = bpy.data.objects['chair Splats']
    obj.data.stipple.anchors = 50
    assert stipple.scene.source.splat_data.count(obj.data) == 50 * EACH


def test_renders_have_a_budget_of_their_own(stipple, weights, picture):
    bpy.ops.stipple.splats_from_image(filepath=str(picture), **SMALL)
    data = bpy.context.object.data
    data.stipple.anchors_render = 70
    assert stipple.scene.source.decoded.full_cloud(data).info().count == 70 * EACH


def test_seeds_stand_side_by_side_and_differ(stipple, weights, picture):
    bpy.ops.stipple.splats_from_image(filepath=str(picture), seed=3, seed_count=2, **SMALL)
    made = sorted(bpy.context.selected_objects, key=lambda obj: obj.location.x)
    assert [obj.location.x for obj in made] == pytest.approx([-0.625, 0.625])
    one, two = (stipple.scene.source.splat_data.read(obj.data).positions for obj in made)
    assert one.shape == two.shape and np.abs(one - two).max() > 1e-3


def test_of_several_seeds_the_best_one_is_kept_where_one_would_stand(stipple, weights, picture, tmp_path):
    bpy.ops.stipple.splats_from_image(filepath=str(picture), seed=3, seed_count=3, keep_best=True, **SMALL)
    kept, = bpy.context.selected_objects
    assert bpy.data.objects[:] == [kept] and tuple(kept.location) == (0, 0, 0)
    task_module, binding = stipple.scene.generate.image_task, stipple.binding
    native = stipple.scene.source.sources.context()
    likeness = {}
    for seed in range(3, 6):
        options = binding.generate.generate_options(native.library, task_module.require_weights(), seed=seed, steps=3,
                                                    token_count=64, canvas_size=512, measures_likeness=1)
        job = binding.generate.Generation.start(native, binding.image.Image.load(native, picture), None, options)
        job.wait()
        likeness[seed] = job.figures().likeness
    best = max(likeness, key=likeness.get)
    positions = stipple.scene.source.splat_data.read(kept.data).positions.copy()
    bpy.ops.stipple.splats_from_image(filepath=str(picture), seed=best, **SMALL)
    assert (stipple.scene.source.splat_data.read(bpy.context.object.data).positions == positions).all()
    assert not list((tmp_path / 'cache').glob('generation_*'))


def test_colors_are_matched_with_the_networks_that_come_with_the_add_on(stipple, tmp_path):
    # test_colours_are_led_to_those_of_the_image (tests/cli/test_generate.py) looks at what comes out.
    side = 128
    pixels = np.zeros((side, side, 4), np.uint8)
    y, x = np.mgrid[:side, :side]
    pixels[((x - 64) / 30) ** 2 + ((y - 64) / 50) ** 2 < 1] = (160, 32, 192, 255)
    image = str(save_image(tmp_path / 'purple.png', pixels))
    off = []
    for matches in (False, True):
        bpy.ops.stipple.splats_from_image(filepath=image, seed=3, seed_count=2, keep_best=True, match_colours=matches)
        made, = bpy.context.selected_objects
        colours = 0.5 + 0.28209479177387814 * stipple.scene.source.splat_data.read(made.data).sh[:, 0]
        off.append(np.abs(colours - np.array((160, 32, 192)) / 255).mean())
    assert off[1] < 0.8 * off[0], off


def test_an_opaque_image_needs_a_mask(stipple, weights, picture, tmp_path):
    width, height, rgba = pipeline_weights.image()
    pixels = np.frombuffer(rgba, np.uint8).reshape(height, width, 4).copy()
    mask = np.full_like(pixels, 255)
    mask[..., :3] = pixels[..., 3:]
    pixels[..., 3] = 255
    opaque = save_image(tmp_path / 'opaque.png', pixels)
    with pytest.raises(RuntimeError, match='mask'):
        bpy.ops.stipple.splats_from_image(filepath=str(opaque), **SMALL)
    assert not bpy.data.objects
    mask_path = save_image(tmp_path / 'mask.png', mask)
    assert bpy.ops.stipple.splats_from_image(filepath=str(opaque), mask=str(mask_path), **SMALL) == {'FINISHED'}


def test_without_weights_the_message_says_where_they_are_named(stipple, picture, monkeypatch):
    stipple.preferences.get().weights_folder = ''
    monkeypatch.setattr(stipple.preferences, 'shipped_weights_folder', lambda: '')
    with pytest.raises(RuntimeError, match='Preferences'):
        bpy.ops.stipple.splats_from_image(filepath=str(picture), **SMALL)


def test_a_render_of_the_selection_stands_where_it_does(stipple, weights):
    cube = scenes.mesh_object('Block', [(x, y, z) for x in (2, 4) for y in (-1, 0) for z in (1, 5)],
                              [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
    scenes.select(cube)
    assert bpy.ops.stipple.splats_from_render(engine='CYCLES', samples=1, **SMALL) == {'FINISHED'}
    obj = bpy.context.object
    assert obj.name == 'Block Splats' and cube.hide_render
    assert tuple(obj.location) == pytest.approx((3.0, -0.5, 1.0))
    low, high = extent(stipple, obj)
    assert max(high - low) == pytest.approx(4.0, rel=0.2)
    # Seen from the front: as an image of the file browser.
    assert math.remainder(obj.rotation_euler.z + math.pi / 2, 2 * math.pi) == pytest.approx(0, abs=1e-6)


def test_the_scenes_camera_tells_which_side_is_the_front(stipple, weights):
    cube = scenes.mesh_object('Block', [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)],
                              [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
    camera = scenes.link(bpy.data.objects.new('Camera', bpy.data.cameras.new('Camera')))
    camera.location, camera.rotation_euler = (8.0, 0.0, 0.0), (math.pi / 2, 0.0, math.pi / 2)
    bpy.context.scene.camera = camera
    scenes.select(cube)
    bpy.ops.stipple.splats_from_render(view='CAMERA', samples=1, hide_source=False, **SMALL)
    obj = bpy.context.object
    assert math.remainder(obj.rotation_euler.z, 2 * math.pi) == pytest.approx(0, abs=1e-6)
    assert not cube.hide_render


def test_time_and_memory_are_told_before(stipple, weights):
    task = stipple.scene.generate.image_task
    few = task.estimate_of(task.GenerateSettings(steps=2, tokens=64, canvas=512))
    many = task.estimate_of(task.GenerateSettings(steps=40, tokens=64, canvas=512))
    assert 0 < few.seconds < many.seconds and few.bytes > 0


def test_a_cancelled_seed_goes_on_from_its_last_step(stipple, weights, picture, tmp_path):
    """The task as the operator has it in a window, stopped when a checkpoint is there."""
    import time
    task_module = stipple.scene.generate.image_task
    image = stipple.binding.image.Image.load(stipple.scene.source.sources.context(), picture)
    settings = task_module.GenerateSettings(steps=400, tokens=64, canvas=512, previews=False)
    task = task_module.ImageTask(image, None, b'one', settings, 1, 40)
    cache = tmp_path / 'cache'
    until = time.monotonic() + 60
    while not list(cache.glob('generation_*')) and time.monotonic() < until:
        time.sleep(0.01)
    task.cancel()
    with pytest.raises(stipple.binding.errors.CancelledError):
        task.wait()
    assert len(list(cache.glob('generation_*'))) == 1
    again = task_module.ImageTask(image, None, b'one', settings, 1, 40)
    while again._running is None and time.monotonic() < until:
        time.sleep(0.001)
    job = again._running[1]
    again.wait()
    assert job.figures().resumed_step > 0
    assert again.result[0].splats.count == 40 * EACH
    assert not list(cache.glob('generation_*'))
