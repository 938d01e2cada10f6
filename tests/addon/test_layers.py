# SPDX-License-Identifier: GPL-3.0-or-later
"""What another renderer drew, through the binding: meshes as a surface and as a matte, and the picture of all."""
import numpy as np
import pytest
from stipple.binding import context as contexts
from stipple.binding import layers, mesh
from stipple.binding.errors import StippleError
from stipple.binding.structs import StippleCamera

EMPTY = np.float32(1e10)


def passes():
    """Two rows of three pixels: nothing, a mesh, half a mesh; nothing in shadow, a mesh in shadow, nothing."""
    combined = np.zeros((2, 3, 4), np.float32)
    combined[0, 1], combined[0, 2] = (0.5, 0.25, 0.125, 1.0), (0.25, 0.25, 0.25, 0.5)
    combined[1, 0], combined[1, 1] = (0.0, 0.0, 0.0, 0.75), (0.5, 0.5, 0.5, 1.0)
    depth = np.array([[EMPTY, 2.0, EMPTY], [EMPTY, 3.0, EMPTY]], np.float32)
    shadow = np.ones((2, 3, 3), np.float32)
    shadow[1, :2] = 0.25
    return combined, depth, shadow


def test_a_surface_has_what_was_drawn(context):
    combined, depth, shadow = passes()
    plain = layers.Layers(context, combined, depth)
    assert not plain.info().has_light and not plain.info().has_opacity
    surface = plain.surface()
    assert np.array_equal(surface.colour, combined) and surface.light is None and surface.opacity is None
    # The half pixel's own sample missed the mesh: it has its nearest neighbour's depth.
    assert surface.depth[0].tolist() == [EMPTY, 2.0, 2.0]
    lit = layers.Layers(context, combined, depth, shadow)
    assert lit.info().has_shadows
    assert np.array_equal(lit.surface().light, shadow)
    assert lit.surface().colour[1, 0, 3] == 0, 'that alpha was the shadow on nothing'


def test_holdouts_hide_and_have_a_depth(context):
    combined, depth, _ = passes()
    held = layers.Layers(context, combined, depth)
    opacity = np.array([[0.5, 0, 0.75], [0, 0, 0]], np.float32)
    held.hold_out(np.where(opacity > 0, np.float32(1.0), EMPTY), opacity)
    surface = held.surface()
    assert surface.opacity.tolist() == [[0.5, 1, 1], [0.75, 1, 0]]
    assert surface.depth[0].tolist() == [1.0, 2.0, 1.0]
    matte = held.matte(np.full((2, 3), 5.0, np.float32), 0.5)
    assert matte.colour is None and (matte.opacity == 1).all()
    assert matte.depth[0, 0] == 1.0 and matte.depth[1, 2] == 4.5


def test_the_picture_has_the_world_behind_it(context):
    combined, depth, _ = passes()
    whole = layers.Layers(context, combined, depth)
    whole.take_world(np.full((2, 3, 3), 0.5, np.float32))
    colour = combined.copy()
    colour[1, 2] = (0.25, 0.25, 0.25, 0.5)  # a splat
    through = 1 - colour[..., 3]
    made, far = whole.compose(colour, np.full((2, 3), 7.0, np.float32), through)
    assert made is not colour and np.allclose(made[..., 3], 1)
    assert made[0, 0, :3].tolist() == [0.5, 0.5, 0.5] and made[1, 2, :3].tolist() == [0.5, 0.5, 0.5]
    assert far[0, 1] == 2.0 and far[1, 2] == 7.0


def test_arrays_of_another_shape_are_refused(context):
    combined, depth, shadow = passes()
    with pytest.raises(StippleError, match='shape'):
        layers.Layers(context, combined[..., :3], depth)
    made = layers.Layers(context, combined, depth)
    with pytest.raises(StippleError, match='shape'):
        made.take_world(shadow[:1])
    with pytest.raises(StippleError, match='memory limit'):
        layers.Layers(contexts.Context(context.library, memory_limit_bytes=100), combined, depth)


def test_a_matte_of_a_mesh_has_smooth_edges(context):
    square = mesh.Mesh.create(context)
    square.add_part(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32),
                    np.array([[0, 1, 2], [0, 2, 3]], np.uint32), np.eye(4))
    camera = StippleCamera(model=1, width=4, height=4, fx=2.0, fy=2.0, cx=0.25, cy=0.0, near_plane=0.1, far_plane=10)
    camera.world_to_camera = (type(camera.world_to_camera))(*np.eye(4).reshape(16))
    camera.world_to_camera[11] = 1.0
    task = mesh.start_matte(context, [(square, np.eye(4))], camera, 4)
    task.job.wait()
    # Two pixels to the metre, and the square begins a quarter of a pixel inside the first.
    assert task.opacity[0].tolist() == [0.75, 1.0, 0.25, 0.0]
    assert task.depth[0].tolist() == [1.0, 1.0, 1.0, EMPTY]
    with pytest.raises(StippleError, match='1 to 16 is allowed'):
        mesh.start_matte(context, [(square, np.eye(4))], camera, 17)


def test_shadows_of_another_picture_leave_meshes_and_world(context):
    combined, depth, shadow = passes()
    combined[1, 0] = 0.0
    lit = layers.Layers(context, combined, depth)
    lit.take_shadow(shadow)
    assert lit.info().has_shadows and lit.info().has_light
    surface = lit.surface()
    assert np.array_equal(surface.colour, combined)
    assert np.array_equal(surface.light, shadow)
    with pytest.raises(StippleError, match='another is allowed without it'):
        lit.take_shadow(shadow)
    with pytest.raises(StippleError, match=r'has shape \(2, 2, 3\)'):
        lit.take_shadow(shadow[:, :2])
