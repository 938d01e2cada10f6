"""Depth, normals and indices of splats, composited with a Cycles render in background Blender, against a stored
picture.

The stored picture was looked at: a yellow bar passes through both rings, before them where it is nearer; the half
transparent ring is shaded by its normals, the other is not.
"""
import pytest

from test_pictures import FIXTURES, compare, render, scripts  # noqa: F401 (a fixture)

# Cycles' edges of the bar differ between versions, by a fraction of a pixel around it.
FLOOR_DB = 35.0


@pytest.fixture(scope='module')
def pictures(scripts, tmp_path_factory):  # noqa: F811
    out = tmp_path_factory.mktemp('passes')
    render('render_passes.py', scripts, out)
    return out


def psnr(pictures, name):
    return compare(FIXTURES / 'reference' / 'passes.png', pictures / f'{name}.png')['psnr']


def test_splats_and_meshes_are_composited_by_their_passes(pictures):
    assert psnr(pictures, 'passes') >= FLOOR_DB


@pytest.mark.parametrize('name', ['passes_over', 'passes_plain'])
def test_without_a_pass_the_picture_is_another(pictures, name):
    assert psnr(pictures, name) < FLOOR_DB - 4
