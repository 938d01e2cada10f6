#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks layers of text, and packages of them, against the rules of USD's schema of Gaussian splats.

    usd_schema.py FILE.usda|FILE.usdz...

It shares no code with the library, which is what is checked. Sources: OpenUSD 26.03, UsdVol,
ParticleField3DGaussianSplat and the schemas that it has built in; the specification of USDZ.
"""

import re
import struct
import sys
import zipfile
from pathlib import Path

import numpy as np

PRIM = 'ParticleField3DGaussianSplat'
# Name: its types in single precision, and in half, where the name ends in h.
ARRAYS = {'positions': ('point3f[]', 'point3h[]', 3), 'orientations': ('quatf[]', 'quath[]', 4),
          'scales': ('float3[]', 'half3[]', 3), 'opacities': ('float[]', 'half[]', 1),
          'radiance:sphericalHarmonicsCoefficients': ('float3[]', 'half3[]', 3)}
DEGREE = 'radiance:sphericalHarmonicsDegree'
HINTS = {'projectionModeHint': {'perspective', 'tangential'},
         'sortingModeHint': {'zDepth', 'cameraDistance'}}
USUAL_DEGREE = 3
ALIGNMENT = 64
# Of a unit quaternion's length: three roundings of a number in half precision, and what is left in single precision.
LENGTH_ERROR = {False: 1e-5, True: 2e-3}
TOKEN = re.compile(r'''\s+|\#[^\n]*|"""(?s:.*?)"""|"(?:\\.|[^"\\\n])*"|@[^@]*@|<[^>]*>|[()\[\]{}=,;]|[^\s()\[\]{}=,;"]+(?:\[\])?''')
ENDS = {'(': ')', '[': ']', '{': '}'}


class Fault(Exception):
    """The text is no layer."""


class Layer:
    """What a layer of text holds: metadata {name: value}, prims."""

    def __init__(self, text):
        if not text.startswith('#usda 1.0'):
            raise Fault("the first line is not '#usda 1.0'")
        self._tokens = [token for token in TOKEN.findall(text) if not token.isspace() and token[0] != '#']
        self._at = 0
        self.metadata = self._metadata() if self._next() == '(' else {}
        self.prims = []
        while self._next() is not None:
            self.prims.append(self._prim())

    def _next(self):
        return self._tokens[self._at] if self._at < len(self._tokens) else None

    def _take(self, wanted=None):
        token = self._next()
        if token is None or wanted is not None and token != wanted:
            raise Fault(f'{wanted or "more"} is expected where {token or "the text ends"} stands')
        self._at += 1
        return token

    def _metadata(self):
        found = {}
        self._take('(')
        while self._next() != ')':
            words = []
            while self._next() not in ('=', ')', None):
                words.append(self._take())
            if self._next() == '=':
                self._take()
                found[words[-1]] = self._value()
        self._take(')')
        return found

    def _value(self):
        """Numbers as float, lists and tuples as list, the rest as text."""
        token = self._take()
        if token in ENDS:
            end, values = ENDS[token], []
            while self._next() != end:
                values.append(self._value() if token != '{' or self._next() in ENDS else self._take())
                if self._next() in (',', ';'):
                    self._take()
            self._take(end)
            return values
        try:
            return float(token)
        except ValueError:
            return token.strip('"')

    def _samples(self):
        found = {}
        self._take('{')
        while self._next() != '}':
            time = self._take()
            if not time.endswith(':'):
                self._take(':')
            found[float(time.rstrip(':'))] = self._value()
            if self._next() == ',':
                self._take()
        self._take('}')
        return found

    def _prim(self):
        prim = {'specifier': self._take(), 'type': '', 'attributes': {}, 'prims': [], 'metadata': {}}
        if prim['specifier'] not in ('def', 'over', 'class'):
            raise Fault(f"'{prim['specifier']}' begins no prim")
        name = self._take()
        if not name.startswith('"'):
            prim['type'], name = name, self._take()
        prim['name'] = name.strip('"')
        if self._next() == '(':
            prim['metadata'] = self._metadata()
        self._take('{')
        while self._next() != '}':
            if self._next() in ('def', 'over', 'class'):
                prim['prims'].append(self._prim())
                continue
            words = []
            while self._next() not in ('=', '}', None):
                words.append(self._take())
            self._take('=')
            name, _, kind = words[-1].partition('.')
            entry = prim['attributes'].setdefault(name, {'type': words[-2], 'uniform': 'uniform' in words})
            if kind == 'timeSamples':
                entry['samples'] = self._samples()
            else:
                entry['value'] = self._value()
            if self._next() == '(':
                self._metadata()
        self._take('}')
        return prim


def splat_prims(prims, path=''):
    for prim in prims:
        here = f'{path}/{prim["name"]}'
        if prim['type'] == PRIM:
            yield here, prim
        yield from splat_prims(prim['prims'], here)


def times_of(attribute):
    return sorted(attribute.get('samples', {}))


def at_time(attribute, time):
    """The value that holds at a time: that of the last sample before it, or the first."""
    times = times_of(attribute)
    if not times:
        return attribute.get('value')
    before = [known for known in times if time is not None and known <= time]
    return attribute['samples'][before[-1] if before else times[0]]


def faults_of_splats(prim):
    """Sentences on what breaks a rule."""
    attributes, found, chosen = prim['attributes'], [], {}
    for name, (single, half, _) in ARRAYS.items():
        for written, wanted in ((name, single), (name + 'h', half)):
            if written in attributes and attributes[written]['type'] != wanted:
                found.append(f"{written} is of type {attributes[written]['type']}, not {wanted}")
        # Single precision is preferred where both are there.
        chosen[name] = name if name in attributes else name + 'h' if name + 'h' in attributes else None
    degree = attributes.get(DEGREE, {'type': 'int', 'uniform': True, 'value': float(USUAL_DEGREE)})
    if degree['type'] != 'int' or not degree['uniform'] or 'samples' in degree:
        found.append(f'{DEGREE} is not a uniform int')
    if not 0 <= degree.get('value', -1.0) <= 8 or degree['value'] % 1:
        return found + [f"{DEGREE} is {degree.get('value')}"]
    for name, allowed in HINTS.items():
        if name in attributes and (attributes[name]['type'] != 'token' or not attributes[name]['uniform']
                                   or attributes[name]['value'] not in allowed):
            found.append(f'{name} is not one of {sorted(allowed)}')
    if chosen['positions'] is None:
        return found + ['there are no positions']
    times = sorted({time for name in [*chosen.values(), 'extent'] if name in attributes
                    for time in times_of(attributes[name])}) or [None]
    for time in times:
        where = '' if time is None else f' at {time:g}'
        found += [fault + where for fault in faults_of_values(attributes, chosen, int(degree['value']), time)]
    return found


def faults_of_values(attributes, chosen, degree, time):
    found, arrays = [], {}
    for name, (_, _, width) in ARRAYS.items():
        if chosen[name] is None:
            continue
        rows = at_time(attributes[chosen[name]], time)
        try:
            arrays[name] = np.array(rows, np.float64).reshape(len(rows), width)
        except (TypeError, ValueError):
            return found + [f'{chosen[name]} does not have {width} numbers in each row']
        if not np.isfinite(arrays[name]).all():
            found.append(f'{chosen[name]} has values that are no numbers')
    count = len(arrays['positions'])
    for name, rows in arrays.items():
        wanted = count * ((degree + 1) ** 2 if name == 'radiance:sphericalHarmonicsCoefficients' else 1)
        if len(rows) != wanted:
            found.append(f'{chosen[name]} has {len(rows)} rows, not {wanted}')
    if (arrays.get('scales', np.ones((1, 3))) < 0).any():
        found.append('a scale is below zero')
    opacities = arrays.get('opacities', np.ones((1, 1)))
    if (opacities < 0).any() or (opacities > 1).any():
        found.append('an opacity lies outside 0 to 1')
    if 'orientations' in arrays and len(arrays['orientations']):
        error = np.abs(np.linalg.norm(arrays['orientations'], axis=1) - 1).max()
        if error > LENGTH_ERROR[chosen['orientations'].endswith('h')]:
            found.append(f'an orientation is no unit quaternion, by {error:.2g}')
    extent = attributes.get('extent')
    if extent is None:
        return found + ['there is no extent']
    if extent['type'] != 'float3[]':
        found.append(f"extent is of type {extent['type']}, not float3[]")
    try:
        corners = np.array(at_time(extent, time), np.float64)
    except (TypeError, ValueError):
        return found + ['extent has values that are no numbers']
    if corners.shape != (2, 3):
        found.append('extent does not have two corners')
    elif count and ((arrays['positions'] < corners[0]).any() or (arrays['positions'] > corners[1]).any()):
        found.append('a position lies outside the extent')
    return found


def faults_of_layer(text):
    try:
        layer = Layer(text)
    except Fault as fault:
        return [str(fault)]
    found, metadata = [], layer.metadata
    if metadata.get('defaultPrim') not in [prim['name'] for prim in layer.prims]:
        found.append(f"the default prim '{metadata.get('defaultPrim')}' is none of the layer's")
    if metadata.get('upAxis') not in ('Y', 'Z'):
        found.append(f"upAxis is {metadata.get('upAxis')}")
    if not metadata.get('metersPerUnit', 0) > 0:
        found.append(f"metersPerUnit is {metadata.get('metersPerUnit')}")
    first, last = metadata.get('startTimeCode'), metadata.get('endTimeCode')
    prims = list(splat_prims(layer.prims))
    if not prims:
        found.append(f'there is no {PRIM}')
    for path, prim in prims:
        found += [f'{path}: {fault}' for fault in faults_of_splats(prim)]
        for name, attribute in prim['attributes'].items():
            times = times_of(attribute)
            if times and (first is None or last is None or times[0] < first or times[-1] > last):
                found.append(f'{path}: {name} has times outside {first} to {last}')
    return found


def faults_of_package(path):
    """Of a .usdz: what a package may be, and its first layer."""
    found = []
    with zipfile.ZipFile(path) as package, path.open('rb') as file:
        entries = package.infolist()
        for entry in entries:
            file.seek(entry.header_offset)
            header = struct.unpack('<4s5H3I2H', file.read(30))
            if entry.compress_type != zipfile.ZIP_STORED or entry.flag_bits & 1:
                found.append(f'{entry.filename} is compressed or encrypted')
            if (entry.header_offset + 30 + header[-2] + header[-1]) % ALIGNMENT:
                found.append(f'the data of {entry.filename} do not begin at a multiple of {ALIGNMENT} bytes')
        if not entries or not entries[0].filename.endswith(('.usda', '.usd')):
            return found + ['the first file is no layer of text']
        return found + faults_of_layer(package.read(entries[0]).decode())


def faults(path):
    """Sentences on what breaks a rule in a file; none for a good one."""
    path = Path(path)
    return faults_of_package(path) if path.suffix == '.usdz' else faults_of_layer(path.read_text())


def main():
    found = [f'{path}: {fault}' for path in sys.argv[1:] for fault in faults(path)]
    print('\n'.join(found) or f'{len(sys.argv) - 1} files keep the rules')
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main())
