# SPDX-License-Identifier: GPL-3.0-or-later
"""Imports addon/stipple/binding without the add-on's own __init__ (which needs Blender)."""

import os
import sys
import types
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / 'addon' / 'stipple'

# A bare package named `stipple`, so that the relative imports of the binding find each other.
_package = types.ModuleType('stipple')
_package.__path__ = [str(PACKAGE)]
sys.modules.setdefault('stipple', _package)


@pytest.fixture(scope='session')
def root():
    return ROOT


@pytest.fixture(scope='session')
def library():
    """The built library; STIPPLE_LIBRARY names it where it is not in build/release."""
    from stipple.binding import library as module
    path = os.environ.get('STIPPLE_LIBRARY') or ROOT / 'build' / 'release' / 'lib' / 'libstipple.so'
    if not Path(path).is_file():
        pytest.skip(f'{path} is not built')
    return module.load(path)


@pytest.fixture(scope='session')
def context(library):
    from stipple.binding.context import Context
    return Context(library, threads=2)
