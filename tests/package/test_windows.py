# SPDX-License-Identifier: GPL-3.0-or-later
"""The zip for Windows: what its library asks of a machine and, under Wine, whether a program that loads it gets what one
on Linux gets, from folders with names of any letters and any length."""

import json
import os
import re
import subprocess
import time
import zipfile
from pathlib import Path

import bare_systems
import licences
import numpy as np
import pytest
import rules

HERE = Path(__file__).resolve().parent
OBJDUMP = 'x86_64-w64-mingw32-objdump'
MEGABYTES = 30
# What every Windows has.
SYSTEM = {'KERNEL32.dll', 'msvcrt.dll', 'ADVAPI32.dll', 'SHELL32.dll', 'USER32.dll'}
HEADER = 'native/include/stipple/stipple.h'
# What library_driver.c writes.
IDENTICAL = ('model.stipple.safetensors', 'part.ply', 'part.splat', 'part.compressed.ply', 'part.usda', 'part.glb',
             'part.spz', 'part.sog', 'part.usdz', 'again.ply')
# Functions of the C library round otherwise: a pixel by its last bit, and a fit by what 20 steps make of that.
PIXEL_ROUNDING = 1e-6
FIT_ROUNDING = 1e-3
SAID = ["STIPPLE_ERROR_IO: nicht da ä.ply cannot be opened: No such file or directory",
        "STIPPLE_ERROR_IO: {}/read only.ply cannot be written: Permission denied",
        "STIPPLE_ERROR_FORMAT: {}/truth.ply is not an image that can be read: this build reads PNG, JPEG, WebP and "
        "OpenEXR"]
FOLDERS = {'plain': ('work',), 'letters': ('Größe und Maß', 'Пример 日本語 🙂'), 'long': ('tief ' + 'ä' * 90,) * 4}
# What Wine prints of the names that it is asked for, and how one begins that may be longer than 260 letters.
ASKED = re.compile(r'trace:file:(?:CreateFileW|MoveFileWithProgressW|DeleteFileW|FindFirstFileExW|GetFileAttributesW) '
                   r'L?"([^"]*)"')
UNLIMITED = r'\\\\?\\'
SHORT = 260


def table_of(file):
    return subprocess.run([OBJDUMP, '-p', file], check=True, capture_output=True, text=True).stdout


def imported(file):
    """Names of the libraries that a file of Windows asks for."""
    return set(re.findall(r'^\s*DLL Name: (\S+)', table_of(file), re.M))


def exported(file):
    text = table_of(file)
    return set(re.findall(r'^\s*\[ *\d+\] (?:\+base\[ *\d+\] +\w+ )?(\w+)$', text[text.index('[Ordinal/Name'):], re.M))


def test_the_zip_is_small_and_for_windows(windows_zip):
    print(f'{windows_zip.name}: {windows_zip.stat().st_size / 1e6:.1f} MB')
    assert windows_zip.stat().st_size <= MEGABYTES * 1e6
    assert windows_zip.name.endswith('-windows_x64.zip')
    with zipfile.ZipFile(windows_zip) as archive:
        assert 'platforms = ["windows-x64"]' in archive.read('stipple/blender_manifest.toml').decode()
        listed = json.loads(archive.read('stipple/lib/contents.json'))
        assert listed['platform'] == 'windows-x64' and list(listed['files']) == ['stipple.dll']
        assert not [name for name in archive.namelist() if name.endswith('.so')]
        assert 'stipple/licences/mingw-w64.txt' in archive.namelist()
        for folder, _ in licences.COMPILED.values():
            assert f'stipple/licences/{folder}.txt' in archive.namelist()


def test_nothing_is_needed_but_windows(windows_library):
    assert 'KERNEL32.dll' in imported(windows_library) and imported(windows_library) <= SYSTEM


def test_only_the_functions_of_the_header_are_exported(windows_library, root):
    assert exported(windows_library) == set(rules.declared_functions(root / HEADER))


def test_no_folder_of_the_build_is_inside(windows_library, root):
    assert str(root).encode() not in windows_library.read_bytes()


@pytest.fixture(scope='module')
def driver(root, tmp_path_factory):
    """{'linux': program, 'windows': program} of library_driver.c."""
    folder = tmp_path_factory.mktemp('driver')
    flags = ['-std=gnu99', '-O1', '-I', root / 'native' / 'include', HERE / 'library_driver.c']
    subprocess.run(['gcc', *flags, '-o', folder / 'driver', '-ldl'], check=True)
    subprocess.run(['x86_64-w64-mingw32-gcc-posix', *flags, '-static', '-o', folder / 'driver.exe'], check=True)
    return {'linux': folder / 'driver', 'windows': folder / 'driver.exe'}


def scene(folder):
    folder.mkdir(parents=True)
    bare_systems.make_scene(folder)
    (folder / 'read only.ply').write_bytes((folder / 'truth.ply').read_bytes())
    (folder / 'read only.ply').chmod(0o444)
    # What a process that has ended left, and what is none of ours.
    for name in ('.stipple-99999996-0.ply', '.stipple-notes.txt'):
        (folder / name).write_text('x')
    return folder


@pytest.fixture(scope='module')
def linux(driver, linux_library, tmp_path_factory):
    """The folder in which the library of Linux did the work."""
    folder = scene(tmp_path_factory.mktemp('linux') / 'work')
    started = time.perf_counter()
    subprocess.run([driver['linux'], linux_library, folder, folder / 'pixels.raw'], check=True, capture_output=True)
    print(f'Linux: {time.perf_counter() - started:.2f} s')
    return folder


@pytest.fixture(scope='module', params=FOLDERS)
def work(request, driver, windows_library, wine, tmp_path_factory):
    """(folder, what was printed, what Wine was asked for) of the same work on Windows."""
    around = tmp_path_factory.mktemp('windows')
    folder = scene(around.joinpath(*FOLDERS[request.param]))
    assert (len(str(folder)) > SHORT) == (request.param == 'long')
    library = around / 'Add-on für 日本' / 'stipple.dll'
    library.parent.mkdir()
    library.write_bytes(windows_library.read_bytes())
    started = time.perf_counter()
    result = wine(driver['windows'], library, folder, around / 'pixels.raw', debug='-all,+file')
    print(f'Windows, {request.param}: {time.perf_counter() - started:.2f} s')
    assert result.returncode == 0, (result.stdout, result.stderr[-3000:])
    (around / 'pixels.raw').rename(folder / 'pixels.raw')
    return folder, result.stdout.splitlines(), result.stderr


def test_files_have_the_bytes_that_linux_writes(work, linux):
    assert [name for name in IDENTICAL if (work[0] / name).read_bytes() != (linux / name).read_bytes()] == []


def test_pixels_differ_by_their_last_bits_at_most(work, linux):
    first, second = (np.fromfile(folder / 'pixels.raw', np.float32) for folder in (linux, work[0]))
    assert first.size > 1000 and np.ptp(first) > 0.1
    print(f'{np.count_nonzero(first != second)} of {first.size} values differ, by {np.abs(first - second).max():.2g}')
    np.testing.assert_allclose(first, second, atol=PIXEL_ROUNDING)


def test_a_fit_comes_to_the_same(work, linux):
    numbers = []
    for folder in (linux, work[0]):
        data = (folder / 'fitted.ply').read_bytes()
        numbers.append(np.frombuffer(data[data.index(b'end_header\n') + 11:], np.float32))
    start = (linux / 'part.ply').read_bytes()
    before = np.frombuffer(start[start.index(b'end_header\n') + 11:], np.float32)
    print(f'a fit differs by {np.abs(numbers[0] - numbers[1]).max():.2g}')
    assert np.abs(numbers[0] - before).max() > 10 * FIT_ROUNDING
    np.testing.assert_allclose(*numbers, atol=FIT_ROUNDING)


def test_errors_are_sentences_with_names_in_utf8(work):
    assert work[1] == [line.format(work[0]) for line in SAID]


def test_only_what_ended_processes_left_is_removed(work):
    names = set(os.listdir(work[0]))
    assert '.stipple-notes.txt' in names
    assert not [name for name in names if name.startswith('.stipple-') and name.endswith(('.ply', '.old'))]


def test_long_names_are_asked_for_without_a_limit(work):
    """Wine takes them in any case, Windows does not. Its trace cuts names, so that the folder tells which are long."""
    if len(str(work[0])) <= SHORT:
        pytest.skip('names are short there')
    asked = [row for row in ASKED.findall(work[2]) if f'\\\\{FOLDERS["long"][0][:5]}' in row]
    assert len(asked) > 20
    assert [row for row in asked if not row.startswith(UNLIMITED)] == []
