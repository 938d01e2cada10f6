# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture without effects has the bits of a library that has none compiled in."""
import os
import subprocess
from pathlib import Path

FOLDER = Path(os.environ['STIPPLE_BUILD_DIR']) / 'tests'


def hashes(name):
    """{(kernel, projector, case...): hash}"""
    output = subprocess.run([FOLDER / name], check=True, capture_output=True, text=True, timeout=240).stdout
    rows = [line.split() for line in output.splitlines()]
    return {tuple(row[:-1]): row[-1] for row in rows}


def test_every_target_gives_the_same_bits_with_and_without_effects():
    full, plain = hashes('full_pictures'), hashes('plain_pictures')
    assert full == plain
    assert 'scalar' in {key[0] for key in full} and len({key[0] for key in full}) >= 2
    # Pictures of something: perspective and orthographic, on two backgrounds, of two clouds.
    assert len(set(full.values())) >= 8
