"""Many splat objects, and a keyframed budget, rendered in background Blender under both engines, against stored
pictures.

The stored pictures were looked at: the two rings pass through each other link by link, the blue one half transparent;
200 trees of different sizes stand in ten rows; a tree stands around a ball, made of 60, 400 and 6,000 splats.
"""
import subprocess

import pytest

from test_pictures import FIXTURES, STORED_FLOOR_DB, compare, render, scripts  # noqa: F401 (a fixture)

FRAMES = (1, 2, 3)


@pytest.fixture(scope='module')
def pictures(scripts, tmp_path_factory):  # noqa: F811
    out = tmp_path_factory.mktemp('shots')
    render('render_shots.py', scripts, out)
    return out


def psnr(pictures, name, stored):
    return compare(FIXTURES / 'reference' / f'{stored}.png', pictures / f'{name}.png')['psnr']


@pytest.mark.parametrize('name, stored', [
    ('crossing', 'crossing'), ('crossing_cycles', 'crossing'), ('crossing_merged', 'crossing'), ('crowd', 'crowd'),
    ('crowd_cycles', 'crowd')])
def test_splats_of_many_objects_are_the_stored_picture(pictures, name, stored):
    assert psnr(pictures, name, stored) >= STORED_FLOOR_DB


def test_rings_that_are_laid_over_each_other_do_not_pass(pictures):
    """What comes out where each object is sorted for itself, in either order."""
    for front, back in (('first', 'second'), ('second', 'first')):
        over = pictures / f'{front}_over.png'
        subprocess.run(['oiiotool', str(pictures / f'crossing_{front}.png'), str(pictures / f'crossing_{back}.png'),
                        '--over', '-o', str(over)], check=True)
        assert compare(FIXTURES / 'reference' / 'crossing.png', over)['psnr'] < STORED_FLOOR_DB - 20


def test_one_instance_of_200_is_missed(pictures):
    assert psnr(pictures, 'crowd_less', 'crowd') < STORED_FLOOR_DB - 5


@pytest.mark.parametrize('frame', FRAMES)
@pytest.mark.parametrize('suffix', ['', '_cycles'])
def test_a_keyframed_budget_is_the_stored_frame(pictures, suffix, frame):
    assert psnr(pictures, f'budget{suffix}_{frame:04d}', f'budget{suffix}_{frame:04d}') >= STORED_FLOOR_DB


@pytest.mark.parametrize('frame', FRAMES)
@pytest.mark.parametrize('suffix', ['', '_cycles'])
def test_another_budget_is_not(pictures, suffix, frame):
    other = frame % 3 + 1
    assert psnr(pictures, f'budget{suffix}_{other:04d}', f'budget{suffix}_{frame:04d}') < STORED_FLOOR_DB - 10
