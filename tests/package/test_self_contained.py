# SPDX-License-Identifier: GPL-3.0-or-later
"""The libraries in a release's zip need a C library of version 2.28 or newer and nothing else."""

import re
import subprocess

import licences
import pytest
import rules
from stipple.binding import library

SYSTEM = re.compile(r'lib(c|m)\.so\.6|libpthread\.so\.0|libdl\.so\.2|ld-linux-x86-64\.so\.2')
FLOOR = (2, 28)
MEGABYTES = 30
HEADER = 'native/include/stipple/stipple.h'


def other_needs(file):
    return [name for name in rules.needed(file) if not SYSTEM.fullmatch(name)]


def undefined(file):
    """[(name, version or '')] of what a library looks for in others."""
    rows = subprocess.run(['nm', '-D', '--undefined-only', file], check=True, capture_output=True, text=True).stdout
    return [tuple((row.split()[-1] + '@').split('@')[:2]) for row in rows.splitlines()]


def unfit_names(file):
    """Names without a version, which another library of the process could fill, and those of a later C library."""
    found = []
    for name, version in undefined(file):
        numbers = re.fullmatch(r'GLIBC_([\d.]+)', version)
        if numbers is None or tuple(int(part) for part in numbers.group(1).split('.')) > FLOOR:
            found.append(f'{name}@{version}')
    return found


@pytest.fixture(scope='module')
def files(release):
    found = sorted((release / 'lib').glob('*.so'))
    assert release / 'lib' / 'libstipple.so' in found
    return found


def test_the_zip_is_small(release_zip):
    print(f'{release_zip.name}: {release_zip.stat().st_size / 1e6:.1f} MB')
    assert release_zip.stat().st_size <= MEGABYTES * 1e6


def test_nothing_is_needed_but_the_c_library(files):
    assert {file.name: other_needs(file) for file in files} == {file.name: [] for file in files}


def test_no_name_is_of_a_later_c_library_or_open_to_others(files):
    assert {file.name: unfit_names(file) for file in files} == {file.name: [] for file in files}
    assert all(len(undefined(file)) > 20 for file in files)


def test_only_own_names_are_exported(files, root):
    for file in files:
        assert rules.export_violations(file) == []
    assert rules.missing_exports(root / HEADER, files[0].with_name('libstipple.so')) == []


def test_no_folder_of_the_build_is_inside(files, root):
    for file in files:
        assert str(root).encode() not in file.read_bytes()


def test_an_ordinary_library_breaks_the_rules(tmp_path):
    (tmp_path / 'a.cpp').write_text('#include <iostream>\nextern int other(); extern "C" double stipple_x(double x)\n'
                                    '{ std::cout << other(); return __builtin_exp(x); }\n')
    file = tmp_path / 'liba.so'
    subprocess.run(['g++', '-shared', '-fPIC', tmp_path / 'a.cpp', '-o', file], check=True)
    assert any(name.startswith('libstdc++') for name in other_needs(file))
    assert 'exp@GLIBC_2.29' in unfit_names(file) and '_Z5otherv@' in unfit_names(file)


def test_every_licence_is_in_the_zip(release):
    named = re.findall(r'^([\w.-]+\.txt) ', (release / 'licences' / 'README.txt').read_text(), re.M)
    there = {file.name for file in (release / 'licences').iterdir()} - {'README.txt'}
    assert set(named) == there
    needed = {f'{folder}.txt' for folder, _ in licences.COMPILED.values()}
    assert needed <= there and {f'{name}.txt' for name in licences.FROM_PACKAGES | licences.FROM_GCC} <= there


def test_the_release_loads_as_it_came_and_not_when_a_byte_is_changed(release, tmp_path):
    assert library.load(release / 'lib' / 'libstipple.so').stipple_version_string()
    copy = tmp_path / 'stipple'
    (copy / 'lib').mkdir(parents=True)
    for file in (release / 'lib').iterdir():
        (copy / 'lib' / file.name).write_bytes(file.read_bytes())
    target = copy / 'lib' / 'libstipple.so'
    data = bytearray(target.read_bytes())
    data[len(data) // 3] ^= 0x10
    target.write_bytes(data)
    with pytest.raises(library.LibraryError, match='is damaged'):
        library.load(target)
