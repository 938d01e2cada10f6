# SPDX-License-Identifier: GPL-3.0-or-later
"""A virtual screen, a Blender with a window on it, and what it shows."""

import json
import os
import shutil
import struct
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

HERE = Path(__file__).resolve().parent
WIDTH, HEIGHT = 1280, 800


def run_steps(steps_file, folder, blender, timeout=300, size=(WIDTH, HEIGHT), arguments=(),
              options=()):
    """Runs the steps of a file (window.py) in a Blender with these options, and returns {name: picture [H,W,3] uint8},
    the facts that the steps have noted, and what Blender has written."""
    if shutil.which('Xvfb') is None:
        pytest.skip('Xvfb is not installed: nothing can be shown in a window')
    with Screen(folder, size) as screen:
        environment = dict(os.environ, DISPLAY=screen.display, LIBGL_ALWAYS_SOFTWARE='1')
        command = [blender, *options, '--factory-startup', '--window-geometry', '0', '0', *map(str, size), '--python',
                   str(HERE / 'window.py'), '--', str(steps_file), str(folder), str(screen.file), *arguments]
        with open(folder / 'log.txt', 'w') as log:
            process = subprocess.Popen(command, env=environment, cwd=folder, stdout=log, stderr=subprocess.STDOUT)
            try:
                process.wait(timeout)
            finally:
                process.kill()
                process.wait()
    text = (folder / 'log.txt').read_text()
    failed = folder / 'failed'
    assert not failed.exists(), failed.read_text() + text
    assert (folder / 'done').exists(), text
    pictures = {path.stem: read_xwd(path) for path in sorted(folder.glob('*.xwd'))}
    return pictures, json.loads((folder / 'facts.json').read_text()), text


class Screen:
    """An X server that keeps its picture in a file."""

    def __init__(self, folder, size):
        self._folder = folder / 'screen'
        self._size = 'x'.join(map(str, size))
        self.file = self._folder / 'Xvfb_screen0'

    def __enter__(self):
        self._folder.mkdir()
        reading, writing = os.pipe()
        self._process = subprocess.Popen(['Xvfb', '-displayfd', str(writing), '-screen', '0', f'{self._size}x24',
                                          '-fbdir', str(self._folder), '-nolisten', 'tcp'], pass_fds=[writing],
                                         stderr=subprocess.DEVNULL)
        os.close(writing)
        with os.fdopen(reading) as pipe:
            number = pipe.readline().strip()
        assert number, 'Xvfb did not start'
        self.display = f':{number}'
        for _ in range(100):
            if self.file.exists():
                break
            time.sleep(0.1)
        return self

    def __exit__(self, *_):
        self._process.terminate()
        self._process.wait()


def read_xwd(path):
    """[H,W,3] of an X window dump with 32 bits a pixel."""
    data = path.read_bytes()
    header = struct.unpack('>25I', data[:100])
    size, width, height, line, colours = header[0], header[4], header[5], header[12], header[19]
    pixels = np.frombuffer(data, np.uint8, count=line * height, offset=size + 12 * colours)
    return pixels.reshape(height, line)[:, :4 * width].reshape(height, width, 4)[..., 2::-1]
