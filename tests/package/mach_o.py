# SPDX-License-Identifier: GPL-3.0-or-later
"""What stands in a file of macOS (Mach-O): its load commands, and whether its signature holds its bytes."""

import hashlib
import re
import struct

PROCESSORS = {0x0100000c: 'arm64', 0x01000007: 'x64'}
MAGIC = 0xfeedfacf
KINDS = {2: 'program', 6: 'library'}
TWO_LEVELS, HAS_SHARED_NAMES, LOOKS_FOR_SHARED_NAMES = 0x80, 0x8000, 0x10000
LOAD_LIBRARY, LIBRARY_NAME, SEGMENT, SIGNATURE, RUN_PATH, BUILD_VERSION = 0xc, 0xd, 0x19, 0x1d, 0x8000001c, 0x32
# Of a signature, with the most significant byte first.
SUPER_BLOB, CODE_DIRECTORY, FIRST_SLOT = 0xfade0cc0, 0xfade0c02, 0
AD_HOC, SHA256 = 0x2, 2


class File:
    """The head of a file of one processor: `processor`, `kind`, `flags`, and [(command, bytes)] of what loads it."""

    def __init__(self, data):
        self.data = data
        magic, processor, _, kind, count, _, self.flags, _ = struct.unpack_from('<8I', data)
        assert magic == MAGIC, 'this is not a file of macOS of 64 bits with the least significant byte first'
        self.processor, self.kind = PROCESSORS[processor], KINDS[kind]
        self.commands, at = [], 32
        for _ in range(count):
            command, size = struct.unpack_from('<2I', data, at)
            self.commands.append((command, data[at:at + size]))
            at += size

    def of_kind(self, command):
        return [row for kind, row in self.commands if kind == command]

    def names(self, command):
        """What commands name that begin with the place of their text: libraries, or folders that are looked into."""
        return [row[struct.unpack_from('<I', row, 8)[0]:].split(b'\0')[0].decode() for row in self.of_kind(command)]

    def oldest_system(self):
        (row,) = self.of_kind(BUILD_VERSION)
        platform, version = struct.unpack_from('<2I', row, 8)
        assert platform == 1, 'this is not for macOS'
        return version >> 16, version >> 8 & 0xff

    def segments(self):
        """{name: (largest rights, first rights, offset, size)}."""
        found = {}
        for row in self.of_kind(SEGMENT):
            name = row[8:24].rstrip(b'\0').decode()
            _, _, offset, size = struct.unpack_from('<4Q', row, 24)
            largest, first = struct.unpack_from('<2I', row, 56)
            found[name] = (largest, first, offset, size)
        return found


def code_directory(data):
    """(where the signature begins, its CodeDirectory); AssertionError where there is none."""
    rows = File(data).of_kind(SIGNATURE)
    assert len(rows) == 1, 'the file is not signed'
    start, size = struct.unpack_from('<2I', rows[0], 8)
    blob = data[start:start + size]
    magic, length, count = struct.unpack_from('>3I', blob)
    assert magic == SUPER_BLOB and length <= size == len(blob), 'the signature is cut'
    index = dict(struct.unpack_from('>2I', blob, 12 + 8 * k) for k in range(count))
    directory = blob[index[FIRST_SLOT]:]
    assert struct.unpack_from('>I', directory)[0] == CODE_DIRECTORY
    return start, directory


def signature_problems(data):
    """What of a file its signature does not hold; [] where macOS would take it as it is signed."""
    start, directory = code_directory(data)
    _, _, version, flags, hashes, _, _, count, limit = struct.unpack_from('>9I', directory)
    hash_size, hash_type, _, page_bits = struct.unpack_from('>4B', directory, 36)
    problems = []
    if version < 0x20400:
        problems.append(f'the CodeDirectory is of version {version:#x}')
    if not flags & AD_HOC:
        problems.append('the signature is not an ad-hoc one')
    if (hash_type, hash_size) != (SHA256, 32):
        return [*problems, f'the sums are of kind {hash_type}']
    if limit != start:
        problems.append(f'{limit} bytes are signed and {start} are there')
    page = 1 << page_bits
    if count != -(-limit // page):
        problems.append(f'{count} sums are there for {limit} bytes')
    for k in range(count):
        expected = directory[hashes + 32 * k:hashes + 32 * (k + 1)]
        if hashlib.sha256(data[k * page:min((k + 1) * page, limit)]).digest() != expected:
            problems.append(f'page {k} has other bytes than were signed')
    return problems


def system_symbols(stub, target):
    """Names that a stub of the system (.tbd) says that it has for a target such as 'arm64-macos'."""
    found = set()
    # Words in brackets or in single quotes, behind the targets that they are for.
    for targets, symbols in re.findall(r'- targets: *\[([^\]]*)\]\s+(?:symbols|weak-symbols|thread-local-symbols): *'
                                       r'\[([^\]]*)\]', stub):
        if target in re.split(r'[,\s]+', targets):
            found |= set(re.findall(r"[^\s,']+", symbols))
    return found
