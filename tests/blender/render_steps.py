# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders the open file in a Blender with a window, as F12 does; window.py runs it."""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import scenes  # noqa: E402


def render(_window):
    folder = Path(sys.argv[sys.argv.index('--') + 2])
    np.save(folder / 'picture.npy', scenes.render_pixels(folder))


steps = [render]
