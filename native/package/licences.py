#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Gathers the licences of all that lies inside the packages' libraries.

    licences.py PARTS OUTPUT [--platform linux-x64]

PARTS is the folder that fetch.py filled. OUTPUT gets one file for each library of others, as Debian gives it, the
texts that those refer to, and an index. A licence that cannot be found is an error.
"""

import argparse
import re
import shutil
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
DOCS = Path('/usr/share/doc')
COMMON = Path('/usr/share/common-licenses')

# Compiled from sources: the name in parts/CMakeLists.txt, the folder of the source, what it does here.
COMPILED = {
    'tbb': ('onetbb', 'oneTBB: parallel loops'),
    'hwy': ('highway', 'Highway: vector instructions'),
    'z': ('zlib', 'zlib: compression'),
    'zstd': ('zstd', 'Zstandard: compression'),
    'lz4': ('lz4', 'LZ4: compression'),
    'blosc': ('c-blosc', 'Blosc: compression of volumes'),
    'openvdb': ('openvdb', 'OpenVDB: volumes'),
    'tinygltf': ('tinygltf', 'tinygltf: meshes'),
    'webp': ('webp', 'libwebp: images'),
    'png': ('png', 'libpng: images'),
    'jpeg': ('jpeg', 'libjpeg-turbo: images. This software is based in part on the work of the Independent JPEG '
                     'Group'),
    'imath': ('imath', 'Imath: numbers of half precision'),
    'openexr': ('openexr', 'OpenEXR: images'),
}
# Headers of this machine, and what the compiler adds: the name, the package whose licence it is, what it does here.
FROM_PACKAGES = {
    'eigen': ('libeigen3-dev', 'Eigen: linear algebra'),
    'nanoflann': ('libnanoflann-dev', 'nanoflann: neighbour search'),
    'nlohmann-json': ('nlohmann-json3-dev', 'JSON for Modern C++'),
    'boost': ('libboost1.74-dev', 'Boost: headers that OpenVDB uses'),
    'stb': ('libstb-dev', 'stb: outlines of letters'),
}
FROM_GCC = {
    'gcc': ('libstdc++-12-dev', "GCC's libstdc++ and libgcc, under the GCC Runtime Library Exception"),
}
# On Windows also what stands between the compiler and the system.
FOR_WINDOWS = {
    'mingw-w64': ('mingw-w64-x86-64-dev', 'mingw-w64: the start of programs, functions of C99, threads of POSIX'),
}
# What zig adds instead of GCC: the file in its folder, and what it is. macOS has an unwinder of its own, and the
# functions that the compiler calls.
FROM_ZIG = {
    'libc++': ('lib/libcxx/LICENSE.TXT', "LLVM's libc++"),
    'libc++abi': ('lib/libcxxabi/LICENSE.TXT', "LLVM's libc++abi: exceptions"),
}
FROM_ZIG_ON_LINUX = {
    'zig': ('LICENSE', "zig's compiler-rt: arithmetic that processors lack"),
    'libunwind': ('lib/libunwind/LICENSE.TXT', "LLVM's libunwind: exceptions"),
    'glibc': ('lib/libc/glibc/LICENSES', 'the few functions of the GNU C library that every program holds'),
}
ZIG_PLATFORMS = ('macos-arm64', 'macos-x64', 'linux-arm64')
COMMON_TEXTS = ('Apache-2.0', 'LGPL-2.1', 'MPL-2.0', 'GPL-3')


def compiled_parts(cmake):
    """The names of the libraries that a CMakeLists.txt or make_parts.sh makes of sources."""
    return re.findall(r'^(?:part\(|own_build )(\w+) ', cmake, re.M)


def licence_of_source(folder):
    for name in ('debian/copyright', 'openvdb/openvdb/LICENSE', 'LICENSE'):
        if (folder / name).is_file():
            return folder / name
    raise FileNotFoundError(f"The source '{folder}' has no file of its licence")


def gather(parts, output, platform):
    """Writes the folder and returns {file: what it is about}."""
    shutil.rmtree(output, ignore_errors=True)
    output.mkdir(parents=True)
    index = {}
    is_windows = platform.startswith('windows')
    is_by_zig = platform in ZIG_PLATFORMS
    for folder, about in COMPILED.values():
        shutil.copyfile(licence_of_source(parts / 'source' / folder), output / f'{folder}.txt')
        index[f'{folder}.txt'] = about
    for name, (package, about) in (FROM_PACKAGES | ({} if is_by_zig else FROM_GCC)
                                  | (FOR_WINDOWS if is_windows else {})).items():
        shutil.copyfile(DOCS / package / 'copyright', output / f'{name}.txt')
        index[f'{name}.txt'] = about
    if is_by_zig:
        for name, (file, about) in (FROM_ZIG | (FROM_ZIG_ON_LINUX if platform.startswith('linux') else {})).items():
            shutil.copyfile(parts / 'zig' / file, output / f'{name}.txt')
            index[f'{name}.txt'] = about
    elif not is_windows:
        shutil.copyfile(parts / 'debs/libc6-dev/usr/share/doc/libc6-dev/copyright', output / 'glibc.txt')
        index['glibc.txt'] = 'the few functions of the GNU C library that every program holds'
    font = (HERE.parent / 'plot/font/sans_regular.cpp').read_text(encoding='utf-8')
    comment = [line.removeprefix('//').removeprefix(' ') for line in font.splitlines() if line.startswith('//')]
    (output / 'dejavu-sans.txt').write_text('\n'.join(comment) + '\n', encoding='utf-8')
    index['dejavu-sans.txt'] = 'DejaVu Sans: the letters of plots'
    for text in COMMON_TEXTS:
        shutil.copyfile(COMMON / text, output / f'{text}.txt')
        index[f'{text}.txt'] = f'the text of {text}, which others refer to'
    lines = ['Stipple is under the GNU General Public License, version 3 or later (../LICENSE).',
             'Its libraries hold:', '']
    lines += [f'{name:20} {about}' for name, about in sorted(index.items())]
    (output / 'README.txt').write_text('\n'.join(lines) + '\n', encoding='utf-8')
    return index


def main():
    parser = argparse.ArgumentParser(description='Gather the licences of what the packages hold.')
    parser.add_argument('parts', type=Path)
    parser.add_argument('output', type=Path)
    parser.add_argument('--platform', default='linux-x64')
    arguments = parser.parse_args()
    try:
        gather(arguments.parts, arguments.output, arguments.platform)
    except OSError as error:
        print(f'licences.py: {error}', file=sys.stderr)
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main())
