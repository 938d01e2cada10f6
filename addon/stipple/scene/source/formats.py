# SPDX-License-Identifier: GPL-3.0-or-later
"""Splat file formats for file dialogs, as the library lists them."""

from ...binding import formats as native
from ...binding.errors import LibraryError
from . import sources

# Blender asks which files may be dropped into its windows while it registers, before any library is loaded; a test
# compares these with the library's.
DROPPED_EXTENSIONS = (
    '.ply', '.compressed.ply', '.spz', '.splat', '.ksplat', '.glb', '.gltf', '.usda', '.usd', '.usdz', '.sog',
)
# Of dialogs, until a name is typed.
USUAL_EXTENSION = '.ply'
_known = {}


def all_formats():
    """The formats of the library; none where it cannot be loaded."""
    try:
        library = sources.context().library
    except LibraryError:
        return []
    if library not in _known:
        _known[library] = native.splat_formats(library)
    return _known[library]


def read_extensions():
    """Of file names that can be read, in lower case."""
    return [extension for form in all_formats() if form.can_read for extension in form.extensions]


def write_extensions():
    return [extension for form in all_formats() if form.can_write for extension in form.extensions]


def of_path(path):
    """The format whose extension a path has (the longest that fits), or None."""
    fits = [(len(extension), form) for form in all_formats() for extension in form.extensions
            if path.lower().endswith(extension)]
    return max(fits, key=lambda fit: fit[0])[1] if fits else None


def glob(extensions):
    """What file dialogs filter by."""
    return ';'.join('*' + extension for extension in extensions)


def estimated_bytes(form, count, degree, **options):
    """About how large a file of this many splats is; options as Cloud.save has them."""
    return native.estimated_bytes(sources.context().library, form, count, degree, **options)
