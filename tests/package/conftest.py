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
    """The zip that native/package/make_release.sh has made and hands to these tests."""
    named = os.environ.get('STIPPLE_ZIP')
    if not named:
        pytest.skip('no zip is named in STIPPLE_ZIP; bash native/package/make_release.sh makes one and runs this')
    assert Path(named).is_file(), f'{named} is not there'
    return Path(named)


@pytest.fixture(scope='session')
def release(release_zip, tmp_path_factory):
    """The unpacked zip: the folder stipple in it."""
    folder = tmp_path_factory.mktemp('release')
    with zipfile.ZipFile(release_zip) as archive:
        archive.extractall(folder)
    return folder / 'stipple'
