# SPDX-License-Identifier: GPL-3.0-or-later
"""Splat file formats for file dialogs: which endings there are, and what a splat takes in each."""

from ...binding.errors import LibraryError
from ...binding.formats import splat_formats
from . import sources

# Bytes that one splat of degree 0 and each further coefficient (three numbers) take, about, where packing and
# entropy coding leave it to the data.
_BYTES = {'ply': (68, 12), 'compressed_ply': (16, 3), 'spz': (16, 2), 'splat': (32, 0), 'sog': (12, 0.5),
          'sog_levels': (12, 0.5), 'gltf': (56, 12)}
# Registering loads no library, so file handlers and dialogs have these; a test compares them with the library's.
READ_ENDINGS = ('.ply', '.compressed.ply', '.spz', '.splat', '.ksplat', '.glb', '.gltf', '.sog', 'meta.json',
                 'lod-meta.json')
WRITE_ENDINGS = ('.ply', '.compressed.ply', '.spz', '.splat', '.glb', '.gltf', '.sog', 'meta.json',
                  'lod-meta.json')
_known = {}


def all_formats():
    """The formats of the library; none where it cannot be loaded."""
    try:
        library = sources.context().library
    except LibraryError:
        return []
    if library not in _known:
        _known[library] = splat_formats(library)
    return _known[library]


def of_path(path):
    """The format whose ending a path has (the longest that fits), or None."""
    fits = [(len(ending), form) for form in all_formats() for ending in form.endings if path.lower().endswith(ending)]
    return max(fits, key=lambda fit: fit[0])[1] if fits else None


def glob(endings):
    """What file dialogs filter by."""
    return ';'.join('*' + ending for ending in endings)


def estimated_bytes(form, count, degree):
    """About how large a file of this many splats is."""
    base, each = _BYTES.get(form.name, _BYTES['ply'])
    degree = min(degree, form.max_sh_degree)
    return count * (base + each * ((degree + 1) ** 2 - 1))
