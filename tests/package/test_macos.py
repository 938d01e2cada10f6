# SPDX-License-Identifier: GPL-3.0-or-later
"""The zip for macOS, of which nothing can run here: what its library asks of a Mac, what it exports, and whether its
signature holds its bytes. docs/packages.md says what to run on a Mac."""

import json
import re
import subprocess
import zipfile

import licences
import mach_o
import pytest
import rules

MEGABYTES = 30
OLDEST_SYSTEM = (11, 0)
SYSTEM = ['/usr/lib/libSystem.B.dylib']
HEADER = 'native/include/stipple/stipple.h'
NAME = 'libstipple.dylib'
TARGETS = {'arm64': 'arm64-macos', 'x64': 'x86_64-macos'}
WRITE, EXECUTE = 2, 4
# Some that every system's C library has and that the library calls.
COPYING = {'memcpy', 'memmove', 'memset', 'memcmp'}
PLAIN_FUNCTIONS = {'exp', 'exp2', 'log', 'log10', 'sin', 'cos', 'tan', 'expf', 'exp2f', 'log2', 'logf'} | COPYING


def symbols(file, kind):
    """Names of a file as C has them, without the line in front that macOS adds: those that llvm-nm gives for a kind."""
    listed = subprocess.run(['llvm-nm', '--just-symbol-name', *kind, file], check=True, capture_output=True, text=True)
    return {line.strip().removeprefix('_') for line in listed.stdout.splitlines() if line.strip()}


def processor_of(zip_file):
    return re.search(r'-macos_(\w+)\.zip$', zip_file.name).group(1)


@pytest.fixture(scope='module')
def library(macos_zip, tmp_path_factory):
    """libstipple.dylib as it lies in the zip."""
    folder = tmp_path_factory.mktemp('dylib')
    with zipfile.ZipFile(macos_zip) as archive:
        return type(macos_zip)(archive.extract(f'stipple/lib/{NAME}', folder))


@pytest.fixture(scope='module')
def tool(macos_zip, root):
    """The tool, as it is built beside the zip's library."""
    file = root / 'build' / f'macos_{processor_of(macos_zip)}' / 'bin' / 'stipple'
    assert file.is_file(), f'{file} is missing; native/package/make_release.sh makes it'
    return file


def test_the_zip_is_small_and_for_this_kind_of_mac(macos_zip):
    print(f'{macos_zip.name}: {macos_zip.stat().st_size / 1e6:.1f} MB')
    assert macos_zip.stat().st_size <= MEGABYTES * 1e6
    platform = f'macos-{processor_of(macos_zip)}'
    with zipfile.ZipFile(macos_zip) as archive:
        assert f'platforms = ["{platform}"]' in archive.read('stipple/blender_manifest.toml').decode()
        listed = json.loads(archive.read('stipple/lib/contents.json'))
        assert listed['platform'] == platform and list(listed['files']) == [NAME]
        assert not [name for name in archive.namelist() if name.endswith(('.so', '.dll'))]
        for folder in [folder for folder, _ in licences.COMPILED.values()] + list(licences.FROM_ZIG):
            assert f'stipple/licences/{folder}.txt' in archive.namelist()
        # Nothing of GCC and nothing of zig's own is inside.
        for name in ('gcc', 'zig'):
            assert f'stipple/licences/{name}.txt' not in archive.namelist()


def test_the_library_is_for_this_kind_of_mac_from_macos_11_on(macos_zip, library):
    file = mach_o.File(library.read_bytes())
    assert (file.kind, file.processor) == ('library', processor_of(macos_zip))
    assert file.oldest_system() == OLDEST_SYSTEM


def test_nothing_is_needed_but_the_system(library):
    file = mach_o.File(library.read_bytes())
    assert file.names(mach_o.LOAD_LIBRARY) == SYSTEM
    # Found beside whoever loads it by its path, which the binding does.
    assert file.names(mach_o.LIBRARY_NAME) == [f'@rpath/{NAME}']


def test_the_system_of_that_age_has_every_name_that_is_asked_for(macos_zip, library, root):
    stub = root / 'build' / 'package' / 'zig' / 'lib' / 'libc' / 'darwin' / f'libSystem.{OLDEST_SYSTEM[0]}.tbd'
    known = mach_o.system_symbols(stub.read_text(), TARGETS[processor_of(macos_zip)])
    asked = symbols(library, ['--undefined-only'])
    assert len(asked) > 100 and 'malloc' in asked and 'stipple_version_string' not in asked
    # C names have an underscore before them; that by which the loader finds others has none.
    assert sorted(name for name in asked if f'_{name}' not in known and name not in known) == []


def test_functions_of_the_system_are_the_ones_called(library, tool):
    # zig brings its own, which round otherwise. What is linked in is not looked for in the system.
    assert PLAIN_FUNCTIONS - symbols(library, ['--undefined-only']) == set()
    assert COPYING - symbols(tool, ['--undefined-only']) == set()


def test_no_name_is_shared_with_what_else_blender_has_loaded(library):
    """Names are looked for in the system alone, and those that many libraries of C++ have stay each library's own."""
    flags = mach_o.File(library.read_bytes()).flags
    assert flags & mach_o.TWO_LEVELS
    assert not flags & (mach_o.HAS_SHARED_NAMES | mach_o.LOOKS_FOR_SHARED_NAMES)


def test_names_would_be_shared_without_a_list(tool):
    """The tool, which nothing else loads, has no such list: what the test above looks for is there."""
    assert mach_o.File(tool.read_bytes()).flags & mach_o.HAS_SHARED_NAMES


def test_only_the_functions_of_the_header_are_exported(library, root):
    assert symbols(library, ['--defined-only', '--extern-only']) == set(rules.declared_functions(root / HEADER))


def test_no_folder_of_the_build_is_inside(library, tool, root):
    for file in (library, tool):
        assert str(root).encode() not in file.read_bytes()


def test_nothing_can_be_written_and_run(library, tool):
    for file in (library, tool):
        segments = mach_o.File(file.read_bytes()).segments()
        assert segments['__TEXT'][1] & EXECUTE
        assert [name for name, (_, first, _, _) in segments.items() if first & WRITE and first & EXECUTE] == []


def test_the_signature_holds_every_byte(library, tool):
    for file in (library, tool):
        assert mach_o.signature_problems(file.read_bytes()) == []


@pytest.mark.parametrize('share', [0.01, 0.5, 0.9])
def test_a_changed_byte_breaks_the_signature(library, share):
    data = bytearray(library.read_bytes())
    start, _ = mach_o.code_directory(bytes(data))
    data[int(start * share)] ^= 0x10
    (problem,) = mach_o.signature_problems(bytes(data))
    assert problem.endswith('has other bytes than were signed')


def test_the_tool_needs_the_system_and_the_library_beside_it(macos_zip, tool):
    file = mach_o.File(tool.read_bytes())
    assert (file.kind, file.processor) == ('program', processor_of(macos_zip))
    assert sorted(file.names(mach_o.LOAD_LIBRARY)) == sorted([*SYSTEM, f'@rpath/{NAME}'])
    assert file.names(mach_o.RUN_PATH) == ['@executable_path/../lib']
    assert file.oldest_system() == OLDEST_SYSTEM
