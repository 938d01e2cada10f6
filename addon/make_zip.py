#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the add-on's zip: one top folder, so that it installs as a legacy add-on and as an extension.

    make_zip.py [--libraries build/release/lib] [--output build/stipple.zip]
"""

import argparse
import sys
import zipfile
from pathlib import Path

PROJECT = Path(__file__).resolve().parent.parent
LIBRARIES = ('libstipple.so', 'libstipple_media.so')
# Where oneDNN was there when the library was built; without it networks run on Stipple's own kernels.
OPTIONAL_LIBRARIES = ('libstipple_nn.so',)
# A fixed time, so that equal content gives an equal zip.
TIME = (2026, 1, 1, 0, 0, 0)


def make(libraries, output):
    """Writes the zip and returns the names in it. Raises FileNotFoundError for a missing library."""
    package = PROJECT / 'addon' / 'stipple'
    files = {f'stipple/{p.relative_to(package).as_posix()}': p for p in package.rglob('*')
             if p.is_file() and '__pycache__' not in p.parts and 'lib' not in p.relative_to(package).parts[:1]}
    files['stipple/LICENSE'] = PROJECT / 'LICENSE'
    optional = tuple(name for name in OPTIONAL_LIBRARIES if (libraries / name).is_file())
    for name in LIBRARIES + optional:
        if not (libraries / name).is_file():
            raise FileNotFoundError(f"The library '{libraries / name}' is missing; build the target stipple first.")
        # Follows version links: the zip holds one plain file per library.
        files[f'stipple/lib/{name}'] = (libraries / name).resolve()
    output.parent.mkdir(parents=True, exist_ok=True)
    temporary = output.with_suffix('.tmp')
    with zipfile.ZipFile(temporary, 'w', zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(files):
            info = zipfile.ZipInfo(name, TIME)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            archive.writestr(info, files[name].read_bytes())
    temporary.replace(output)
    return sorted(files)


def main():
    parser = argparse.ArgumentParser(description='Make the zip of the Blender add-on.')
    parser.add_argument('--libraries', type=Path, default=PROJECT / 'build' / 'release' / 'lib')
    parser.add_argument('--output', type=Path, default=PROJECT / 'build' / 'stipple.zip')
    arguments = parser.parse_args()
    try:
        names = make(arguments.libraries, arguments.output)
    except OSError as error:
        print(error, file=sys.stderr)
        return 1
    print(f'{arguments.output}: {len(names)} files, {arguments.output.stat().st_size / 1e6:.1f} MB')
    return 0


if __name__ == '__main__':
    sys.exit(main())
