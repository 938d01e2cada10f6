# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures that comparisons with other programs are made on (tests/peers) can still be rendered."""

import json
import subprocess
from pathlib import Path

import bpy
import pytest

PEERS = Path(__file__).resolve().parent.parent / 'peers'


def render(script, folder, *options):
    command = [bpy.app.binary_path, '-b', '--factory-startup', '--python-exit-code', '1', '-P', str(PEERS / script),
               '--', str(folder), *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr


def check(folder, views):
    data = json.loads((folder / 'transforms.json').read_text())
    assert len(data['frames']) == views
    assert all((folder / frame['file_path']).is_file() for frame in data['frames'])
    assert (folder / data['ply_file_path']).is_file()


def test_objects(tmp_path):
    render('make_objects.py', tmp_path, '--views', '2', '--size', '16')
    for name in ('head', 'cage', 'heap'):
        check(tmp_path / name, 2)


@pytest.mark.parametrize('scene', ('fine_texture', 'thin_structures', 'furnished_room', 'still_life'))
def test_photographs(tmp_path, scene):
    render('make_photos.py', tmp_path, '--scene', scene, '--views', '2', '--width', '32', '--height', '18')
    check(tmp_path, 2)
