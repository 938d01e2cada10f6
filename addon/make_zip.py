#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the add-on's zip: one top folder, so that it installs as a legacy add-on and as an extension.

    make_zip.py [--libraries build/release/lib] [--output build/stipple.zip] [--licences FOLDER]
                [--self-contained [--platform linux-x64]]

The zip runs on machines like this one. One for every machine is made by native/package/make_release.sh.
"""

import argparse
import hashlib
import json
import re
import sys
import zipfile
from pathlib import Path

PROJECT = Path(__file__).resolve().parent.parent
PACKAGE = PROJECT / 'addon' / 'stipple'
PLATFORM = 'linux-x64'
LIBRARIES = ('libstipple.so', 'libstipple_media.so', 'libstipple_packing.so')
# Of each platform that a release is made for: the one library, which holds what the others above do.
SELF_CONTAINED_LIBRARIES = {'linux-x64': ('libstipple.so',), 'linux-arm64': ('libstipple.so',),
                            'windows-x64': ('stipple.dll',),
                            'macos-arm64': ('libstipple.dylib',), 'macos-x64': ('libstipple.dylib',)}
# Where oneDNN was there when the library was built; without it networks run on Stipple's own kernels.
OPTIONAL_LIBRARIES = ('libstipple_nn.so',)
# A fixed time, so that equal content gives an equal zip.
TIME = (2026, 1, 1, 0, 0, 0)


def manifest():
    return (PACKAGE / 'blender_manifest.toml').read_text(encoding='utf-8')


def version():
    return re.search(r'^version = "([^"]+)"', manifest(), re.M).group(1)


def manifest_for(platform):
    """The manifest with this platform alone, as Blender's --split-platforms writes it."""
    text, count = re.subn(r'^platforms = .*$', f'platforms = ["{platform}"]', manifest(), flags=re.M)
    assert count == 1, 'the manifest has one line of platforms'
    return text


def split_name(platform=PLATFORM):
    """What Blender's --split-platforms calls the file."""
    return f'stipple-{version()}-{platform.replace("-", "_")}.zip'


def contents_of(libraries, platform):
    """lib/contents.json, which the add-on holds its libraries against (binding/contents.py)."""
    files = {name: hashlib.sha256(data).hexdigest() for name, data in sorted(libraries.items())}
    return json.dumps({'version': version(), 'platform': platform, 'files': files}, indent=2) + '\n'


def make(libraries, output, names=LIBRARIES, licences=None, platform=PLATFORM):
    """Writes the zip and returns {name in it: bytes}. Raises FileNotFoundError for a missing library."""
    files = {f'stipple/{p.relative_to(PACKAGE).as_posix()}': p.read_bytes() for p in PACKAGE.rglob('*')
             if p.is_file() and '__pycache__' not in p.parts and 'lib' not in p.relative_to(PACKAGE).parts[:1]}
    files['stipple/blender_manifest.toml'] = manifest_for(platform).encode()
    files['stipple/LICENSE'] = (PROJECT / 'LICENSE').read_bytes()
    for file in sorted(licences.iterdir()) if licences else ():
        files[f'stipple/licences/{file.name}'] = file.read_bytes()
    found = {}
    for name in names + tuple(name for name in OPTIONAL_LIBRARIES if (libraries / name).is_file()):
        if not (libraries / name).is_file():
            raise FileNotFoundError(f"The library '{libraries / name}' is missing; build the target stipple first.")
        # Follows version links: the zip holds one plain file per library.
        found[name] = (libraries / name).read_bytes()
    files |= {f'stipple/lib/{name}': data for name, data in found.items()}
    files['stipple/lib/contents.json'] = contents_of(found, platform).encode()
    output.parent.mkdir(parents=True, exist_ok=True)
    temporary = output.with_suffix('.tmp')
    with zipfile.ZipFile(temporary, 'w', zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(files):
            info = zipfile.ZipInfo(name, TIME)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            archive.writestr(info, files[name], compresslevel=9)
    temporary.replace(output)
    return files


def main():
    parser = argparse.ArgumentParser(description='Make the zip of the Blender add-on.')
    parser.add_argument('--libraries', type=Path, default=PROJECT / 'build' / 'release' / 'lib')
    parser.add_argument('--output', type=Path, default=PROJECT / 'build' / 'stipple.zip')
    parser.add_argument('--licences', type=Path, help='a folder of licences that go into the zip')
    parser.add_argument('--self-contained', action='store_true', help='the one library holds the media library')
    parser.add_argument('--platform', choices=SELF_CONTAINED_LIBRARIES, default=PLATFORM,
                        help='what self-contained libraries are for')
    arguments = parser.parse_args()
    try:
        names = SELF_CONTAINED_LIBRARIES[arguments.platform] if arguments.self_contained else LIBRARIES
        files = make(arguments.libraries, arguments.output, names, arguments.licences, arguments.platform)
    except OSError as error:
        print(error, file=sys.stderr)
        return 1
    print(f'{arguments.output}: {len(files)} files, {arguments.output.stat().st_size / 1e6:.1f} MB')
    return 0


if __name__ == '__main__':
    sys.exit(main())
