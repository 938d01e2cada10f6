# SPDX-License-Identifier: GPL-3.0-or-later
"""Every test starts from an empty file and an empty folder of its own."""

import sys

import bpy
import numpy as np
import pytest


@pytest.fixture(autouse=True)
def clean_file(tmp_path):
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert not bpy.data.objects
    yield


@pytest.fixture
def stipple():
    """The add-on's package, whatever its name in this Blender."""
    return sys.modules[next(m for m in sys.modules if m.rpartition('.')[2] == 'stipple')]


@pytest.fixture
def depths(stipple, monkeypatch):
    """Depth pictures as an engine hands them to Blender, row 0 = bottom."""
    found, fill = [], stipple.version.fill_pass

    def note(render_pass, array):
        if render_pass.name == 'Depth':
            found.append(np.array(array))
        fill(render_pass, array)

    monkeypatch.setattr(stipple.version, 'fill_pass', note)
    return found
