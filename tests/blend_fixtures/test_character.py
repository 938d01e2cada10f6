"""A character on a splat floor, rendered in background Blender under both engines, against stored pictures.

The stored pictures were looked at: the character stands behind the one column of splats and before the other, casts a
shadow on the floor, and is a hole in the picture of the engine Stipple. What lacks the shadow, or has the character
before both columns, must not pass.
"""
import pytest

from test_pictures import FIXTURES, compare, render, scripts  # noqa: F401 (a fixture)

# Path tracing: another Blender has another noise. 5.2.2 gets 43.5 dB against 3.4.1's picture; without the shadow it is
# 30.8 dB, and 21.4 dB with the character before both columns.
CYCLES_FLOOR_DB = 38.0
# No noise: only rounding differs (5.2.2: 86 dB). One step of 8 bits everywhere would be 48 dB.
MATTE_FLOOR_DB = 50.0


@pytest.fixture(scope='module')
def pictures(scripts, tmp_path_factory):  # noqa: F811
    out = tmp_path_factory.mktemp('character')
    render('render_character.py', scripts, out)
    return out


def psnr(pictures, name, stored):
    return compare(FIXTURES / 'reference' / f'character_{stored}.png', pictures / f'{name}.png')['psnr']


def test_cycles_and_splats_are_the_stored_picture(pictures):
    assert psnr(pictures, 'cycles', 'cycles') >= CYCLES_FLOOR_DB


def test_mattes_are_the_stored_picture(pictures):
    assert psnr(pictures, 'matte', 'matte') >= MATTE_FLOOR_DB


@pytest.mark.parametrize('name', ['without_shadow', 'before_column'])
def test_wrong_pictures_do_not_pass(pictures, name):
    assert psnr(pictures, name, 'cycles') < CYCLES_FLOOR_DB - 3
