"""The ten frames of a series of splat files, rendered in background Blender, against stored pictures."""
import os
import subprocess

import pytest

from test_pictures import BLENDER, BLENDER_SECONDS, FIXTURES, STORED_FLOOR_DB, compare, scripts  # noqa: F401

FRAMES = range(1, 11)


@pytest.fixture(scope='module')
def rendered(scripts, tmp_path_factory):  # noqa: F811
    """The folder of the pictures."""
    out = tmp_path_factory.mktemp('series')
    environment = {key: value for key, value in os.environ.items() if key != 'STIPPLE_LIBRARY'}
    environment.update(BLENDER_USER_SCRIPTS=str(scripts), PATH=f"/usr/bin:{os.environ['PATH']}")
    result = subprocess.run([BLENDER, '-b', '--factory-startup', '--addons', 'stipple', '--python-exit-code', '1',
                             '--python', str(FIXTURES / 'render_series.py'), '--', str(out)], env=environment, text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=BLENDER_SECONDS)
    assert result.returncode == 0, result.stdout[-4000:]
    return out


def stored(frame):
    return FIXTURES / 'reference' / f'series_{frame:04d}.png'


@pytest.mark.parametrize('frame', FRAMES)
def test_frame_is_the_stored_one(rendered, frame):
    assert compare(stored(frame), rendered / f'series_{frame:04d}.png')['psnr'] >= STORED_FLOOR_DB


@pytest.mark.parametrize('frame', FRAMES)
def test_the_next_frame_is_not(rendered, frame):
    assert compare(stored(frame), rendered / f'series_{frame % 10 + 1:04d}.png')['psnr'] < STORED_FLOOR_DB
