# SPDX-License-Identifier: GPL-3.0-or-later
"""Imports the scripts of native/package and addon/make_zip.py, and the binding without the add-on's own __init__."""

import os
import shutil
import subprocess
import sys
import types
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BUILDS = ('portable', 'release')
sys.path[:0] = [str(ROOT / 'native' / 'package'), str(ROOT / 'addon'), str(ROOT / 'tests' / 'structure')]

_package = types.ModuleType('stipple')
_package.__path__ = [str(ROOT / 'addon' / 'stipple')]
sys.modules.setdefault('stipple', _package)


def _named_zip(variable, command):
    named = os.environ.get(variable)
    if not named:
        pytest.skip(f'no zip is named in {variable}; {command} makes one and runs this')
    assert Path(named).is_file(), f'{named} is not there'
    return Path(named)


@pytest.fixture(scope='session')
def root():
    return ROOT


@pytest.fixture(scope='session')
def release_zip():
    """The zip that native/package/make_release.sh has made and hands to these tests."""
    return _named_zip('STIPPLE_ZIP', 'bash native/package/make_release.sh')


@pytest.fixture(scope='session')
def release(release_zip, tmp_path_factory):
    """The unpacked zip: the folder stipple in it."""
    folder = tmp_path_factory.mktemp('release')
    with zipfile.ZipFile(release_zip) as archive:
        archive.extractall(folder)
    return folder / 'stipple'


@pytest.fixture(scope='session')
def windows_zip():
    """The zip for Windows that native/package/make_release.sh --windows has made and hands to these tests."""
    return _named_zip('STIPPLE_WINDOWS_ZIP', 'bash native/package/make_release.sh --windows')


@pytest.fixture(scope='session')
def macos_zip():
    """The zip that native/package/make_release.sh --macos-arm64 or --macos-x64 has made and hands to these tests."""
    return _named_zip('STIPPLE_MACOS_ZIP', 'bash native/package/make_release.sh --macos-arm64')


@pytest.fixture(scope='session')
def arm_zip():
    """The zip that native/package/make_release.sh --linux-arm64 has made and hands to these tests."""
    return _named_zip('STIPPLE_ARM_ZIP', 'bash native/package/make_release.sh --linux-arm64')


@pytest.fixture(scope='session')
def windows_library(windows_zip, tmp_path_factory):
    """stipple.dll as it lies in the zip."""
    folder = tmp_path_factory.mktemp('dll')
    with zipfile.ZipFile(windows_zip) as archive:
        return Path(archive.extract('stipple/lib/stipple.dll', folder))


@pytest.fixture(scope='session')
def windows_tool(windows_library, tmp_path_factory):
    """stipple.exe, as it is built beside the zip's library, and that library, in a folder with letters of any kind."""
    built = ROOT / 'build' / 'windows' / 'bin' / 'stipple.exe'
    assert built.is_file(), f'{built} is missing; bash native/package/make_release.sh --windows makes it'
    folder = tmp_path_factory.mktemp('exe') / 'Programme für 日本'
    folder.mkdir()
    for file in (built, windows_library):
        shutil.copy(file, folder)
    return folder / built.name


@pytest.fixture(scope='session')
def wine(tmp_path_factory):
    """run(program, arguments..., cwd=...): a program of Windows under Wine; returns what it printed and its status."""
    launcher = shutil.which('wine')
    if launcher is None:
        pytest.skip("Wine is not installed, which runs Windows' programs here")
    environment = os.environ | {'WINEPREFIX': str(tmp_path_factory.mktemp('wine')), 'WINEDEBUG': '-all',
                                'WINEDLLOVERRIDES': 'mscoree,mshtml,winemenubuilder.exe='}
    environment.pop('DISPLAY', None)

    def run(program, *arguments, cwd=None, debug='-all'):
        return subprocess.run([launcher, program, *map(str, arguments)], cwd=cwd, env=environment | {'WINEDEBUG': debug},
                              capture_output=True, text=True, timeout=600, errors='replace')
    run.environment, run.launcher = environment, launcher
    subprocess.run([launcher, 'wineboot', '--init'], env=environment, capture_output=True, timeout=300, check=True)
    yield run
    server = shutil.which('wineserver') or '/usr/lib/wine/wineserver'
    subprocess.run([server, '-k'], env=environment, capture_output=True, timeout=60)


@pytest.fixture(scope='session')
def linux_library():
    """libstipple.so of a build for Linux, whose results those of Windows are compared with."""
    named = os.environ.get('STIPPLE_LIBRARY')
    for file in ([Path(named)] if named else [ROOT / 'build' / name / 'lib' / 'libstipple.so' for name in BUILDS]):
        if file.is_file():
            return file
    pytest.skip('there is no build for Linux in build/portable or build/release to compare with')


@pytest.fixture(scope='session')
def linux_tool(linux_library):
    """The tool of the same build."""
    file = linux_library.parent.parent / 'bin' / 'stipple'
    if not file.is_file():
        pytest.skip(f'{file} is not built, which the tool for Windows is compared with')
    return file
