# SPDX-License-Identifier: GPL-3.0-or-later
"""The scripts of native/package: fetching with checked sums, and stubs of an older C library."""

import hashlib
import re

import fetch
import glibc_stubs
import licences
import pytest

LISTING = '''
    36: 00000000000107d0   119 FUNC    GLOBAL DEFAULT   14 exp@GLIBC_2.2.5
    37: 0000000000040100   100 FUNC    GLOBAL DEFAULT   14 exp@@GLIBC_2.29
    38: 0000000000040100   100 FUNC    WEAK   DEFAULT   14 expf@@GLIBC_2.27
    39: 0000000000040000   100 FUNC    GLOBAL DEFAULT   14 expf@GLIBC_2.2.5
    40: 0000000000040100   100 FUNC    GLOBAL DEFAULT   14 pthread_cond_clockwait@@GLIBC_2.30
    41: 0000000000040100   100 FUNC    GLOBAL DEFAULT   14 gone@GLIBC_2.2.5
    42: 0000000000000000     0 FUNC    GLOBAL DEFAULT  UND wanted@@GLIBC_2.2.5
    43: 0000000000000000     0 OBJECT  GLOBAL DEFAULT  ABS GLIBC_2.4@@GLIBC_2.4
    44: 0000000000040100     8 OBJECT  GLOBAL DEFAULT   32 stdout@@GLIBC_2.2.5
    45: 0000000000040100     8 FUNC    GLOBAL DEFAULT   14 inner@@GLIBC_PRIVATE
'''


def test_stubs_have_the_newest_version_that_is_old_enough():
    found = glibc_stubs.symbols(LISTING)
    assert {name: row[2] for name, row in found.items()} == {
        'exp': 'GLIBC_2.2.5', 'expf': 'GLIBC_2.27', 'stdout': 'GLIBC_2.2.5'}
    assert found['stdout'][:2] == ('OBJECT', 8)


def test_every_package_and_source_is_pinned(root):
    rows = fetch.entries((root / 'native/package/sources.txt').read_text())
    assert len(rows) > 10
    assert all(re.fullmatch('[0-9a-f]{64}', digest) for _, digest, _ in rows)
    assert all(path.endswith('.deb') == (not folder) for path, _, folder in rows)


def test_a_file_with_another_sum_is_refused(tmp_path):
    (tmp_path / 'mirror').mkdir()
    (tmp_path / 'mirror' / 'a.dsc').write_bytes(b'text')
    mirror, digest = (tmp_path / 'mirror').as_uri(), hashlib.sha256(b'text').hexdigest()
    assert fetch.fetch(mirror, 'a.dsc', digest, tmp_path).read_bytes() == b'text'
    (tmp_path / 'mirror' / 'a.dsc').write_bytes(b'TEXT')
    assert fetch.fetch(mirror, 'a.dsc', digest, tmp_path).read_bytes() == b'text'  # kept
    (tmp_path / 'a.dsc').unlink()
    with pytest.raises(OSError, match=f'sources.txt asks for {digest}'):
        fetch.fetch(mirror, 'a.dsc', digest, tmp_path)
    with pytest.raises(OSError, match='cannot be fetched'):
        fetch.fetch(mirror, 'b.dsc', digest, tmp_path)


def test_a_source_names_its_parts_with_sums():
    text = ('Checksums-Sha1:\n 11 5 a.tar.xz\nChecksums-Sha256:\n 22 5 a.tar.xz\n 33 7 b.tar.xz\n'
            'Files:\n 44 5 a.tar.xz\n')
    assert fetch.parts_of(text) == [('a.tar.xz', '22'), ('b.tar.xz', '33')]


def test_all_that_is_compiled_in_has_its_licence_listed(root):
    package = root / 'native' / 'package'
    parts = [part for file in ('parts/CMakeLists.txt', 'make_parts.sh')
             for part in licences.compiled_parts((package / file).read_text())]
    assert len(parts) >= 13 and {'tbb', 'openexr'} <= set(parts)
    assert set(parts) <= set(licences.COMPILED)
