# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the libraries in the add-on are the ones that its zip was made with: lib/contents.json names them.

A file that was damaged on its way, or left from another version, crashes Blender at any later time. This finds accidents;
who changes a library on purpose changes the list too.
"""

import hashlib
import json
import platform
import re
import sys

from .errors import LibraryError

FILE_NAME = 'contents.json'
SYSTEMS = {'linux': 'linux', 'win32': 'windows', 'darwin': 'macos'}
PROCESSORS = {'x86_64': 'x64', 'AMD64': 'x64', 'aarch64': 'arm64', 'ARM64': 'arm64', 'arm64': 'arm64'}


def this_platform():
    """This machine as Blender's extensions name it, such as 'linux-x64'."""
    machine = platform.machine()
    return f'{SYSTEMS.get(sys.platform, sys.platform)}-{PROCESSORS.get(machine, machine)}'


def check(library):
    """Looks at the folder of a library that is about to be loaded; one without a list, as of a build, is let be.

    Errors: LibraryError with one sentence where the list is of another platform or another version of the add-on, or
    where a file is not as listed.
    """
    listed = _read(library)
    if listed is None:
        return
    made_for, version, files = listed
    if made_for != this_platform():
        raise LibraryError(_of_another_platform(made_for))
    expected = _addon_version(library.parent.parent)
    if expected and version != expected:
        raise LibraryError(f"The Stipple libraries in '{library.parent}' are of version {version} and the add-on is of "
                           f"version {expected}; install the add-on again and restart Blender.")
    for name, digest in files.items():
        file = library.parent / name
        if not file.is_file():
            raise LibraryError(f"The Stipple library '{file}' is missing; install the add-on again.")
        if sum_of(file) != digest:
            raise LibraryError(f"The Stipple library '{file}' is damaged: it is not the file that this add-on came "
                               "with; install the add-on again and restart Blender.")


def platform_problem(library):
    """A sentence where the folder of a library, which may be missing, is of another platform's zip, else ''."""
    try:
        listed = _read(library)
    except LibraryError as error:
        return str(error)
    return '' if listed is None or listed[0] == this_platform() else _of_another_platform(listed[0])


def _read(library):
    """(platform, version, {name: sum}) of the list beside a library, None where there is none. Errors: LibraryError."""
    listing = library.parent / FILE_NAME
    if not listing.is_file():
        return None
    try:
        contents = json.loads(listing.read_text(encoding='utf-8'))
        return contents['platform'], contents['version'], dict(contents['files'])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise LibraryError(f"'{listing}' is damaged ({error}); install the add-on again.") from None


def _of_another_platform(made_for):
    return f'This is the download of Stipple for {made_for}; this machine needs the one for {this_platform()}.'


def sum_of(file):
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _addon_version(package):
    """The version in the add-on's manifest, '' where there is none."""
    manifest = package / 'blender_manifest.toml'
    if not manifest.is_file():
        return ''
    found = re.search(r'^version = "([^"]+)"', manifest.read_text(encoding='utf-8'), re.M)
    return found.group(1) if found else ''
