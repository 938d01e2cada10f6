# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats drawn by the graphics card against the native renderer's pictures, without a window."""

import importlib
from ctypes import c_double

import numpy as np
import pytest

import graphics

WIDTH, HEIGHT = 320, 240
# The card computes in single precision and blends in half floats (11 bits): after a hundred blended splats the picture
# is off by about 100^(1/2) 2^-12 = 2.4e-3 in the worst pixels and a tenth of that on average, 60 to 70 dB. Colours have
# steps of 2.4e-4. Beside that the card decides the cut-off at alpha = 1/255 in single precision: some splats
# more or less at that alpha, 4e-3 in single pixels. 50 dB (3e-3 everywhere) lets none of these fail; splats in
# wrong order, without low-pass or with colours of another camera stay below 35 dB here.
PSNR = 50.0


@pytest.fixture
def drawing(stipple):
    graphics.require()
    name = stipple.__name__
    return tuple(importlib.import_module(f'{name}.viewport.{module}') for module in ('splat_drawing', 'view_ellipses'))


def random_arrays(stipple, count=4000, degree=3, size=0.03, seed=0, **flags):
    rng = np.random.default_rng(seed)

    def normal(*shape):
        return rng.standard_normal(shape).astype(np.float32)

    positions = normal(count, 3)
    positions *= (rng.random((count, 1)) ** (1 / 3) / np.linalg.norm(positions, axis=1,
                                                                     keepdims=True)).astype(np.float32)
    scales = (size * np.exp(0.5 * normal(count, 1) + 0.7 * normal(count, 3))).astype(np.float32)
    opacities = (0.02 + 0.97 * rng.random(count)).astype(np.float32)
    sh = (0.3 * normal(count, (degree + 1) ** 2, 3)).astype(np.float32)
    return stipple.binding.cloud.SplatArrays(positions, normal(count, 4), scales, opacities, sh, **flags)


def camera(stipple, model=0, distance=3.0):
    """Looks down on the origin from above; off-centre."""
    matrix = np.array([[1, 0, 0, 0.1], [0, -1, 0, -0.05], [0, 0, -1, distance], [0, 0, 0, 1.0]])
    structs = stipple.binding.structs
    focal = 250.0 if model == 0 else 80.0
    return structs.StippleCamera(model=model, width=WIDTH, height=HEIGHT, fx=focal, fy=focal, cx=150.0, cy=130.0,
                                 world_to_camera=(c_double * 16)(*matrix.reshape(16)), near_plane=0.1, far_plane=50.0)


def shown(drawing, stipple, arrays, matrix=np.eye(4), key='one', **more):
    cloud = stipple.binding.cloud.Cloud.create(stipple.scene.source.sources.context(), arrays)
    return drawing[0].ShownSplats((key,), cloud, arrays.count, arrays.antialias, np.array(matrix, np.float64), **more)


def draw(drawing, stipple, entries, view_camera, depth=None, clip_planes=(), view=None):
    """[H,W,4] as the card blends it, top row first."""
    splats, ellipses = drawing
    shaders = ellipses.Shaders()
    own = view or splats.SplatView(stipple.scene.source.sources.context())
    own.update(entries, view_camera, wait=view is None)
    target = ellipses.Target(WIDTH, HEIGHT)
    with_selection = any(entry.selected for entry in entries)
    with target.bound(depth, with_selection):
        own.draw(shaders, entries, view_camera, graphics.window_matrix(view_camera), 0.0, clip_planes, with_selection)
    picture = target.read()[::-1]
    if view is None:
        own.close()
    return picture


def reference(stipple, entries, view_camera):
    """[H,W,4] display values by the native renderer."""
    renderer = stipple.binding.renderer.Renderer(stipple.scene.source.sources.context())
    options = renderer.options(output_colour=stipple.binding.structs.OutputColour.COMPOSITED)
    task = renderer.start([(entry.cloud, entry.matrix) for entry in entries], view_camera, options, with_depth=False)
    task.job.wait()
    return task.colour


def psnr(a, b):
    return 10 * np.log10(1 / np.mean((np.float64(a) - np.float64(b)) ** 2))


@pytest.mark.parametrize('model', (0, 1), ids=('perspective', 'orthographic'))
@pytest.mark.parametrize('antialias', (0, 1), ids=('classic', 'mip'))
def test_the_card_draws_what_the_native_renderer_draws(drawing, stipple, model, antialias):
    entries = [shown(drawing, stipple, random_arrays(stipple, antialias=antialias))]
    view_camera = camera(stipple, model)
    expected = reference(stipple, entries, view_camera)
    assert expected[..., 3].mean() > 0.2
    assert psnr(draw(drawing, stipple, entries, view_camera), expected) > PSNR


def test_needles_and_specks_are_drawn_alike(drawing, stipple):
    arrays = random_arrays(stipple, 1500, degree=0, seed=1)
    arrays.scales[:500] = (0.4, 1e-4, 1e-4)
    arrays.scales[500:1000] = 1e-4
    entries = [shown(drawing, stipple, arrays)]
    view_camera = camera(stipple)
    assert psnr(draw(drawing, stipple, entries, view_camera), reference(stipple, entries, view_camera)) > PSNR


def test_objects_and_instances_sort_together(drawing, stipple):
    """Two clouds through each other, one of them twice, turned, mirrored and sheared."""
    turn = np.array([[0, -0.7, 0.2, 0.4], [0.6, 0, 0, -0.3], [0, 0.1, -0.8, 0.2], [0, 0, 0, 1]])
    first = shown(drawing, stipple, random_arrays(stipple, 2000, seed=2), key='first')
    second = shown(drawing, stipple, random_arrays(stipple, 3000, seed=3), key='second')
    again = drawing[0].ShownSplats(('again',), first.cloud, first.count, first.antialias, turn)
    entries = [first, second, again]
    view_camera = camera(stipple)
    assert psnr(draw(drawing, stipple, entries, view_camera), reference(stipple, entries, view_camera)) > PSNR
    geometry = drawing[0].Geometry(entries)
    assert geometry.first_row(first) == geometry.first_row(again) == 0
    assert geometry.first_row(second) == 2000


def test_more_splats_than_a_row_of_the_textures_holds(drawing, stipple):
    """Textures are tiled in rows of 4096 splats, batches of quads as well."""
    entries = [shown(drawing, stipple, random_arrays(stipple, 9001, degree=0, size=0.01, seed=4))]
    view_camera = camera(stipple)
    assert psnr(draw(drawing, stipple, entries, view_camera), reference(stipple, entries, view_camera)) > PSNR


def test_grades_are_drawn(drawing, stipple):
    entry = shown(drawing, stipple, random_arrays(stipple, seed=5))
    grade = importlib.import_module(f'{stipple.__name__}.binding.grade')
    settings = grade.GradeSettings(exposure=0.5, tint=(1.0, 0.6, 0.8), saturation=0.5, opacity=0.6)
    graded = drawing[0].ShownSplats(entry.key, grade.GradedCloud(entry.cloud, settings), entry.count, entry.antialias,
                                    entry.matrix)
    view_camera = camera(stipple)
    assert psnr(draw(drawing, stipple, [graded], view_camera), reference(stipple, [graded], view_camera)) > PSNR


def test_the_scene_hides_what_lies_behind_it(drawing, stipple):
    """A plane at the splats' middle over the left half: there only splats before it are left."""
    arrays = random_arrays(stipple, seed=6)
    entries = [shown(drawing, stipple, arrays)]
    for model in (0, 1):
        view_camera = camera(stipple, model)
        depth = np.full((HEIGHT, WIDTH), 40.0)
        depth[:, :WIDTH // 2] = 3.0
        picture = draw(drawing, stipple, entries, view_camera, graphics.depth_texture(view_camera, depth))
        # The camera looks down from z = 3: depth 3 is z = 0.
        front = arrays.positions[:, 2] > 0
        half = stipple.binding.cloud.SplatArrays(arrays.positions[front], arrays.rotations[front], arrays.scales[front],
                                                 arrays.opacities[front], arrays.sh[front])
        before = reference(stipple, [shown(drawing, stipple, half)], view_camera)
        whole = reference(stipple, entries, view_camera)
        assert psnr(picture[:, :WIDTH // 2], before[:, :WIDTH // 2]) > PSNR
        assert psnr(picture[:, WIDTH // 2:], whole[:, WIDTH // 2:]) > PSNR
        assert psnr(before, whole) < 35


def test_clipping_planes_hide_splats(drawing, stipple):
    arrays = random_arrays(stipple, seed=7)
    plane = np.array([0.6, 0.8, 0.0, -0.1])
    left = arrays.positions @ plane[:3] + plane[3] <= 0
    rest = stipple.binding.cloud.SplatArrays(arrays.positions[left], arrays.rotations[left], arrays.scales[left],
                                             arrays.opacities[left], arrays.sh[left])
    view_camera = camera(stipple)
    picture = draw(drawing, stipple, [shown(drawing, stipple, arrays)], view_camera, clip_planes=[plane])
    assert psnr(picture, reference(stipple, [shown(drawing, stipple, rest)], view_camera)) > PSNR


def test_what_is_hidden_goes_at_once_and_never_waits_for_a_sort(drawing, stipple):
    """A view that turns is drawn with the order of the last sort and the new camera."""
    splats = drawing[0]
    first = shown(drawing, stipple, random_arrays(stipple, 2000, degree=0, seed=8), key='first')
    second = shown(drawing, stipple, random_arrays(stipple, 2000, degree=0, seed=9), key='second')
    view = splats.SplatView(stipple.scene.source.sources.context())
    view_camera = camera(stipple)
    draw(drawing, stipple, [first, second], view_camera, view=view)
    assert not view.is_sorting()

    moved = camera(stipple, distance=3.5)
    view.update([first, second], moved)
    order = view._order
    picture = draw(drawing, stipple, [first, second], moved, view=view)
    # Moved straight back the order stays right, whether or not the new one has come.
    assert order is not None
    assert psnr(picture, reference(stipple, [first, second], moved)) > PSNR

    target = drawing[1].Target(WIDTH, HEIGHT)
    with target.bound(None, False):
        view.draw(drawing[1].Shaders(), [second], moved, graphics.window_matrix(moved))
    assert psnr(target.read()[::-1], reference(stipple, [second], moved)) > PSNR
    view.close()


def test_selected_splats_get_an_outline(drawing, stipple):
    import gpu
    arrays = random_arrays(stipple, degree=0, seed=10)
    entry = shown(drawing, stipple, arrays, selected=True)
    view_camera = camera(stipple)
    splats, ellipses = drawing
    shaders = ellipses.Shaders()
    view = splats.SplatView(stipple.scene.source.sources.context())
    view.update([entry], view_camera, wait=True)
    target = ellipses.Target(WIDTH, HEIGHT)
    screen = gpu.types.GPUOffScreen(WIDTH, HEIGHT, format='RGBA32F')
    with screen.bind():
        gpu.state.active_framebuffer_get().clear(color=(0, 0, 0, 0))
        with target.bound(None, True):
            view.draw(shaders, [entry], view_camera, graphics.window_matrix(view_camera), with_selection=True)
        target.show(shaders, (0, 0), (1.0, 0.5, 0.0))
        values = gpu.state.active_framebuffer_get().read_color(0, 0, WIDTH, HEIGHT, 4, 0, 'FLOAT')
    values.dimensions = WIDTH * HEIGHT * 4
    picture = np.array(values, np.float32).reshape(HEIGHT, WIDTH, 4)[::-1]
    expected = reference(stipple, [entry], view_camera)
    inside = expected[..., 3] > 0.51
    outline = (np.abs(picture - (1.0, 0.5, 0.0, 1.0)) < 1e-3).all(-1)
    # One pixel wide, all around and nowhere inside; where alpha is near 1/2 rounding decides.
    grown = expected[..., 3] > 0.49
    grown = np.any([np.roll(grown, (y, x), (0, 1)) for x in (-1, 0, 1) for y in (-1, 0, 1)], axis=0)
    assert outline.sum() > 300
    assert not (outline & inside).any()
    assert not (outline & ~grown).any()
    assert psnr(picture[inside], expected[inside]) > PSNR
    view.close()


def test_nothing_and_objects_without_extent_draw_nothing(drawing, stipple):
    view_camera = camera(stipple)
    assert draw(drawing, stipple, [], view_camera).max() == 0
    flat = shown(drawing, stipple, random_arrays(stipple, 100, seed=11), np.diag([0.0, 0, 0, 1]))
    picture = draw(drawing, stipple, [flat], view_camera)
    assert np.isfinite(picture).all()
