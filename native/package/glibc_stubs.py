#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes what the packages are linked against in place of this machine's C library: empty libraries with the names of
glibc 2.28 and the versions that those had then. A function that came later, or got a later version, such as exp of
2.29, is not there: what is linked takes the older one, or the link fails.

    glibc_stubs.py FOLDER

FOLDER/debs holds Debian 11's C library and unwinder, as fetch.py unpacks them; FOLDER/stubs gets the libraries.
"""

import argparse
import re
import shutil
import subprocess
import sys
from pathlib import Path

NEWEST = (2, 28)
LIBRARIES = {'libc.so.6': 'libc', 'libm.so.6': 'libm', 'libpthread.so.0': 'libpthread', 'libdl.so.2': 'libdl',
             'ld-linux-x86-64.so.2': 'ld-linux'}
ROW = re.compile(r'^\s*\d+: [0-9a-f]+ +(\S+) (\w+) +(\w+) +\w+ +(\w+) (\S+?)(@@?)(GLIBC_[\d.]+)$')


def version_of(text):
    return tuple(int(part) for part in text.removeprefix('GLIBC_').split('.'))


def symbols(listing, newest=NEWEST):
    """{name: (kind, bytes, version)} of readelf's rows: of each name that programs may still link, the newest version
    that is not newer than `newest`."""
    found, linkable = {}, set()
    for line in listing.splitlines():
        row = ROW.match(line)
        if row is None or row.group(4) == 'UND' or row.group(3) == 'LOCAL':
            continue
        size, kind, _, section, name, at, version = row.groups()
        if section == 'ABS' and name == version:
            continue
        if at == '@@':
            linkable.add(name)
        if version_of(version) > newest:
            continue
        if name not in found or version_of(version) > version_of(found[name][2]):
            found[name] = (kind, int(size, 0), version)
    return {name: found[name] for name in found if name in linkable}


def assembly(table):
    """Assembler text that defines the names of a table."""
    lines = []
    for number, (name, (kind, size, version)) in enumerate(sorted(table.items())):
        stub = f'stub_{number}'
        section = {'OBJECT': '.data', 'TLS': '.section .tdata,"awT",@progbits'}.get(kind, '.text')
        elf_kind = {'OBJECT': '@object', 'TLS': '@tls_object'}.get(kind, '@function')
        lines += [section, f'.globl {stub}', f'.type {stub},{elf_kind}', f'{stub}: .zero {max(size, 1)}',
                  f'.size {stub},{max(size, 1)}', f'.symver {stub},{name}@@{version}']
    return '\n'.join(lines) + '\n.section .note.GNU-stack,"",@progbits\n'


def version_script(table):
    versions = sorted({version for _, _, version in table.values()}, key=version_of)
    return ''.join(f'{version} {{ }};\n' for version in versions) + 'STUBS { local: stub_*; };\n'


def make(folder):
    stubs = folder / 'stubs'
    shutil.rmtree(stubs, ignore_errors=True)
    stubs.mkdir(parents=True)
    real = folder / 'debs' / 'libc6' / 'lib' / 'x86_64-linux-gnu'
    for so_name, name in LIBRARIES.items():
        listing = subprocess.run(['readelf', '--dyn-syms', '-W', real / so_name], check=True, capture_output=True,
                                 text=True).stdout
        table = symbols(listing)
        (stubs / f'{name}.s').write_text(assembly(table))
        (stubs / f'{name}.map').write_text(version_script(table))
        file = stubs / (so_name if name in ('libc', 'ld-linux') else f'{name}.so')
        subprocess.run(['gcc', '-shared', '-nostdlib', f'-Wl,-soname,{so_name}', '-Wl,-z,noexecstack',
                        f'-Wl,--version-script={stubs / name}.map', '-o', file, stubs / f'{name}.s'], check=True)
    # What glibc 2.31 has in every program: stat and its like, by the functions that 2.28 has.
    development = folder / 'debs' / 'libc6-dev' / 'usr' / 'lib' / 'x86_64-linux-gnu'
    shutil.copy(development / 'libc_nonshared.a', stubs)
    # How a program starts: since glibc 2.34 this is done by another function.
    for start in ('Scrt1.o', 'crt1.o', 'crti.o', 'crtn.o'):
        shutil.copy(development / start, stubs)
    (stubs / 'libc.so').write_text(
        f'GROUP ( {stubs}/libc.so.6 {stubs}/libc_nonshared.a AS_NEEDED ( {stubs}/ld-linux-x86-64.so.2 ) )\n')
    # The unwinder of GCC 12 asks for a function of glibc 2.35; that of GCC 10 does the same work without.
    shutil.copy(folder / 'debs' / 'libgcc-10-dev' / 'usr' / 'lib' / 'gcc' / 'x86_64-linux-gnu' / '10' / 'libgcc_eh.a',
                stubs)


def main():
    parser = argparse.ArgumentParser(description='Make libraries to link against, with the names of glibc 2.28.')
    parser.add_argument('folder', type=Path)
    make(parser.parse_args().folder.resolve())
    return 0


if __name__ == '__main__':
    sys.exit(main())
