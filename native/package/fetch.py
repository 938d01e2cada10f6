#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fetches what sources.txt names from a Debian mirror, checks every file's SHA-256, and unpacks it.

    fetch.py FOLDER [--mirror http://deb.debian.org/debian] [--zig]

FOLDER/downloads keeps the files, FOLDER/debs gets the packages and FOLDER/source one folder for each source, with
Debian's patches; with --zig FOLDER/zig gets the compiler for other systems, by npm. What is there already, and right,
is left alone.
"""

import argparse
import hashlib
import re
import shutil
import subprocess
import sys
import urllib.error
import urllib.request
from pathlib import Path

HERE = Path(__file__).resolve().parent
MIRROR = 'http://deb.debian.org/debian'
FROM_NPM = 'npm:'


def entries(text):
    """[(path, sum, folder or '')] of sources.txt."""
    rows = [line.split() for line in text.splitlines() if line.strip() and not line.startswith('#')]
    return [(row[0], row[1], row[2] if len(row) > 2 else '') for row in rows]


def sum_of(file):
    with file.open('rb') as stream:
        return hashlib.file_digest(stream, 'sha256').hexdigest()


def parts_of(dsc):
    """[(name, sum)] of the archives that a source's .dsc names; signatures beside them are not needed."""
    listed = re.search(r'^Checksums-Sha256:\n((?: .*\n)+)', dsc, re.M).group(1)
    rows = [line.split() for line in listed.splitlines()]
    return [(name, digest) for digest, _, name in rows]


def fetch(mirror, path, digest, downloads):
    """The checked file. Errors: OSError where the mirror has it not, or has another."""
    file = downloads / Path(path).name
    if file.is_file() and sum_of(file) == digest:
        return file
    temporary = file.with_suffix('.part')
    try:
        with urllib.request.urlopen(f'{mirror}/{path}', timeout=120) as answer, temporary.open('wb') as out:
            shutil.copyfileobj(answer, out)
    except urllib.error.URLError as error:
        raise OSError(f'{mirror}/{path} cannot be fetched: {error}; a newer point release may have taken its place, '
                      f'then native/package/sources.txt needs its name and sum') from None
    found = sum_of(temporary)
    if found != digest:
        raise OSError(f'{mirror}/{path} has the SHA-256 {found}; sources.txt asks for {digest}')
    temporary.replace(file)
    return file


def fetch_by_npm(package, digest, downloads):
    """The checked file of 'npm:NAME@VERSION'. Errors: OSError where the registry has it not, or has another."""
    name = package.removeprefix(FROM_NPM)
    file = downloads / (name.lstrip('@').replace('/', '-').replace('@', '-') + '.tgz')
    if not file.is_file() or sum_of(file) != digest:
        subprocess.run(['npm', 'pack', '--silent', '--pack-destination', str(downloads), name], check=True,
                       stdout=subprocess.DEVNULL)
    found = sum_of(file)
    if found != digest:
        raise OSError(f'{package} has the SHA-256 {found}; sources.txt asks for {digest}')
    return file


def unpack(file, digest, target, command):
    """Runs the command, which makes `target`, unless that was made of the same file."""
    mark = target.parent / f'.{target.name}.made'
    if target.is_dir() and mark.is_file() and mark.read_text() == digest:
        return
    shutil.rmtree(target, ignore_errors=True)
    if command[0] == 'tar':
        target.mkdir()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    mark.write_text(digest)


def unpack_tar(file, digest, target):
    unpack(file, digest, target, ['tar', '-x', '--strip-components=1', '-f', str(file), '-C', str(target)])


def main():
    parser = argparse.ArgumentParser(description='Fetch what the packages are made of.')
    parser.add_argument('folder', type=Path)
    parser.add_argument('--mirror', default=MIRROR)
    parser.add_argument('--zig', action='store_true', help='also the compiler for macOS and for Linux on ARM')
    arguments = parser.parse_args()
    folder = arguments.folder.resolve()
    downloads = folder / 'downloads'
    downloads.mkdir(parents=True, exist_ok=True)
    (folder / 'source').mkdir(exist_ok=True)
    try:
        for path, digest, name in entries((HERE / 'sources.txt').read_text()):
            if path.startswith(FROM_NPM):
                if arguments.zig:
                    unpack_tar(fetch_by_npm(path, digest, downloads), digest, folder / name)
                continue
            file = fetch(arguments.mirror, path, digest, downloads)
            if not name:
                target = folder / 'debs' / file.stem.partition('_')[0]
                target.parent.mkdir(exist_ok=True)
                unpack(file, digest, target, ['dpkg-deb', '-x', str(file), str(target)])
                continue
            target = folder / 'source' / name
            if '.orig.tar.' in path:
                unpack_tar(file, digest, target)
                continue
            for part, part_digest in parts_of(file.read_text(errors='replace')):
                fetch(arguments.mirror, f'{Path(path).parent}/{part}', part_digest, downloads)
            # The sums are pinned here; whose key signed them is another question than which files they are.
            unpack(file, digest, target, ['dpkg-source', '--no-check', '--no-copy', '-x', str(file), str(target)])
    except (OSError, subprocess.CalledProcessError) as error:
        print(f'fetch.py: {error}', file=sys.stderr)
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main())
