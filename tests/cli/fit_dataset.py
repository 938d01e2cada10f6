"""The tool, and a data set that it can fit splats to."""
import json
import math
import os
import subprocess
from pathlib import Path

import conversion_table as conversions
import pytest

TOOL = Path(os.environ['STIPPLE_BUILD_DIR']) / 'bin' / 'stipple'


def run(*arguments, status=0):
    result = subprocess.run([TOOL, *map(str, arguments)], capture_output=True, text=True, timeout=120)
    assert result.returncode == status, (arguments, result.stdout, result.stderr)
    return result


def help_of(command):
    """What --help prints, with the names of an option joined without a space, which newer releases of CLI11 add."""
    return run(command, '--help').stdout.replace(', --', ',--')


def error(*arguments):
    lines = run(*arguments, status=1).stderr.strip().splitlines()
    assert lines[-1].startswith('stipple: '), lines
    return lines[-1]


def figures(text):
    return dict(line.split(None, 1) for line in text.strip().splitlines())


@pytest.fixture(scope='module')
def dataset(tmp_path_factory):
    """Twelve pictures of a cloud from a ring around it, as NeRF-synthetic has them."""
    folder = tmp_path_factory.mktemp('dataset')
    conversions.write_ply(folder / 'truth.ply', conversions.make_cloud(5), conversions.DEGREE)
    low, high = (json.loads(run('info', folder / 'truth.ply', '--json').stdout)[f'bounds_{end}']
                 for end in ('min', 'max'))
    middle = [(a + b) / 2 for a, b in zip(low, high)]
    distance = 2 * max(b - a for a, b in zip(low, high))
    frames = []
    for i in range(12):
        c, s = math.cos(math.tau * i / 12), math.sin(math.tau * i / 12)
        eye = (middle[0] + distance * s, middle[1], middle[2] + distance * c)
        frames.append({'file_path': f'images/{i:02}.png',
                       'transform_matrix': [[c, 0, s, eye[0]], [0, 1, 0, eye[1]], [-s, 0, c, eye[2]], [0, 0, 0, 1]]})
    (folder / 'images').mkdir()
    (folder / 'transforms.json').write_text(json.dumps(
        {'camera_angle_x': 0.7, 'w': 48, 'h': 36, 'fl_x': 66, 'fl_y': 66, 'cx': 24, 'cy': 18, 'frames': frames}))
    for i in range(12):
        run('render', folder / 'truth.ply', '--camera', folder / 'transforms.json', '--view', i, '--colour', 'display',
            '-o', folder / 'images' / f'{i:02}.png')
    return folder
