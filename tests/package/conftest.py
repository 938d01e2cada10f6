# SPDX-License-Identifier: GPL-3.0-or-later
"""Imports the scripts of native/package and addon/make_zip.py, and the binding without the add-on's own __init__."""

import os
import sys
import types
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / 'native' / 'package'), str(ROOT / 'addon'), str(ROOT / 'tests' / 'structure')]

_package = types.ModuleType('stipple')
_package.__path__ = [str(ROOT / 'addon' / 'stipple')]
sys.modules.setdefault('stipple', _package)


@pytest.fixture(scope='session')
def root():
    return ROOT


@pytest.fixture(scope='session')
def release_zip():
    """The zip of native/package/make_release.sh, which hands it to these tests; or the one that it left."""
    import make_zip
    path = Path(os.environ.get('STIPPLE_ZIP') or ROOT / 'build' / make_zip.split_name())
    if not path.is_file():
        pytest.skip(f'{path} is not there; bash native/package/make_release.sh makes it')
    return path


@pytest.fixture(scope='session')
def release(release_zip, tmp_path_factory):
    """The unpacked zip: the folder stipple in it."""
    folder = tmp_path_factory.mktemp('release')
    with zipfile.ZipFile(release_zip) as archive:
        archive.extractall(folder)
    return folder / 'stipple'
