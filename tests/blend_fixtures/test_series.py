"""The ten frames of a series of splat files, rendered in background Blender, against stored pictures."""
import pytest

from test_pictures import FIXTURES, STORED_FLOOR_DB, compare, render, scripts  # noqa: F401 (a fixture)

FRAMES = range(1, 11)


@pytest.fixture(scope='module')
def rendered(scripts, tmp_path_factory):  # noqa: F811
    """The folder of the pictures."""
    out = tmp_path_factory.mktemp('series')
    render('render_series.py', scripts, out)
    return out


def stored(frame):
    return FIXTURES / 'reference' / f'series_{frame:04d}.png'


@pytest.mark.parametrize('frame', FRAMES)
def test_frame_is_the_stored_one(rendered, frame):
    assert compare(stored(frame), rendered / f'series_{frame:04d}.png')['psnr'] >= STORED_FLOOR_DB


@pytest.mark.parametrize('frame', FRAMES)
def test_the_next_frame_is_not(rendered, frame):
    assert compare(stored(frame), rendered / f'series_{frame % 10 + 1:04d}.png')['psnr'] < STORED_FLOOR_DB
