# SPDX-License-Identifier: GPL-3.0-or-later
"""What test_macos.py reads files of macOS by, on small files that are made here: each fault is found."""

import shutil
import subprocess

import mach_o
import pytest

LINKER = 'ld64.lld-16'
SOURCE = 'extern int puts(const char*); int shown(void) { return puts("x"); } int other(void) { return 2; }\n'
STUB = """--- !tapi-tbd
tbd-version: 4
targets: [ x86_64-macos, arm64-macos ]
install-name: '/usr/lib/libSystem.B.dylib'
exports:
  - targets: [ x86_64-macos, arm64-macos ]
    symbols: [ _puts, dyld_stub_binder, '$ld$hide$os10.10$_old' ]
  - targets: [ x86_64-macos ]
    symbols: [ _of_intel ]
...
"""


@pytest.fixture(scope='module')
def link(tmp_path_factory):
    """link(options...): the bytes of a small library of macOS."""
    for program in ('clang', LINKER):
        if shutil.which(program) is None:
            pytest.skip(f'{program} is not installed, which makes files of macOS')
    folder = tmp_path_factory.mktemp('mach')
    (folder / 'small.c').write_text(SOURCE)
    (folder / 'system.tbd').write_text(STUB)
    subprocess.run(['clang', '-target', 'arm64-apple-macos11.0', '-O1', '-c', folder / 'small.c', '-o',
                    folder / 'small.o'], check=True)

    def run(*options):
        subprocess.run([LINKER, '-arch', 'arm64', '-platform_version', 'macos', '11.0', '11.0', '-dylib', *options,
                        '-install_name', '@rpath/small.dylib', '-o', folder / 'small.dylib', folder / 'small.o',
                        folder / 'system.tbd'], check=True)
        return (folder / 'small.dylib').read_bytes()
    return run


def test_the_head_tells_what_it_is_for(link):
    file = mach_o.File(link())
    assert (file.kind, file.processor, file.oldest_system()) == ('library', 'arm64', (11, 0))
    assert file.names(mach_o.LIBRARY_NAME) == ['@rpath/small.dylib']
    assert file.names(mach_o.LOAD_LIBRARY) == ['/usr/lib/libSystem.B.dylib']
    assert file.flags & mach_o.TWO_LEVELS and '__TEXT' in file.segments()


def test_a_signature_holds_every_page(link):
    data = link('-adhoc_codesign')
    assert mach_o.signature_problems(data) == []
    start, _ = mach_o.code_directory(data)
    for at in (0xff0, 0x1000, start // 2, start - 1):
        changed = bytearray(data)
        changed[at] ^= 1
        assert mach_o.signature_problems(bytes(changed)) == [f'page {at >> 12} has other bytes than were signed']


def test_a_file_without_a_signature_is_refused(link):
    with pytest.raises(AssertionError, match='is not signed'):
        mach_o.signature_problems(link('-no_adhoc_codesign'))


def test_names_of_the_system_are_told_apart_by_processor():
    assert {'_puts', 'dyld_stub_binder'} <= mach_o.system_symbols(STUB, 'arm64-macos')
    assert '_of_intel' not in mach_o.system_symbols(STUB, 'arm64-macos')
    assert '_of_intel' in mach_o.system_symbols(STUB, 'x86_64-macos')
