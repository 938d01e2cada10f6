# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that look different from different sides, through the binding: their splats, and what is refused."""

import numpy as np
import pytest

DIRECTIONS = np.array([[0.6, 0, -0.8], [-0.6, 0, -0.8]], np.float32)


def square(context, directions=DIRECTIONS):
    """A mesh with view directions and two view textures, and no material yet."""
    from stipple.binding.mesh import Mesh
    mesh = Mesh.create(context)
    mesh.set_view_directions(directions)
    return mesh, [mesh.add_texture(np.full((1, 1, 3), value, np.float32), srgb=False) for value in (0.4, 0.0)]


def add_square(mesh):
    mesh.add_part(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32), [[0, 1, 2], [0, 2, 3]], np.eye(4),
                  corner_uvs=np.full((2, 3, 2), 0.5, np.float32), triangle_materials=[0, 0])


def splats(context, mesh, degree):
    from stipple.binding.cloud import Cloud
    from stipple.binding.model import DecodeSettings, Model
    making = Model.from_mesh_start(context, mesh, sample_count=4000, harmonic_degree=degree)
    making.wait()
    decoding = Model.of_job(making).decode_start(DecodeSettings(200))
    decoding.wait()
    return Cloud.of_job(decoding).read()


@pytest.mark.parametrize('degree', [0, 1, 2, 3, None])
def test_splats_have_harmonics_of_the_degree_that_was_asked_for(context, degree):
    mesh, textures = square(context)
    mesh.add_material(base_colour=(0.1, 0.1, 0.1, 1), view_textures=textures)
    add_square(mesh)
    count = (1 + (3 if degree is None else degree)) ** 2
    seen = splats(context, mesh, degree)
    assert np.asarray(seen.sh).reshape(200, -1).shape[1] == 3 * count
    if count > 1:
        # The third basis function of degree 1 is -x times a constant: it is brighter along +x.
        assert (np.asarray(seen.sh).reshape(200, count, 3)[:, 3] < -0.05).all()


def test_what_does_not_fit_is_refused(context):
    from stipple.binding.errors import StippleError
    mesh, textures = square(context)
    for views, words in ((textures[:1], 'holds 1 values; 2 are needed'), ([textures[0], 9], 'view texture 9')):
        with pytest.raises(StippleError, match=words):
            mesh.add_material(view_textures=views)
    with pytest.raises(StippleError, match='has view directions already'):
        mesh.set_view_directions(DIRECTIONS)
    for directions, words in ((2 * DIRECTIONS, 'has a length of 2'), (DIRECTIONS[:0], 'count is 0; 1 to 1024'),
                              (np.full((1, 3), np.nan, np.float32), 'nan')):
        with pytest.raises(StippleError, match=words):
            square(context, directions)
    mesh.add_material(view_textures=textures)
    add_square(mesh)
    with pytest.raises(StippleError, match='harmonic_degree is 4; 0 to 3 is allowed'):
        splats(context, mesh, 4)
