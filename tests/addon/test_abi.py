# SPDX-License-Identifier: GPL-3.0-or-later
"""Every ctypes declaration, enumeration and struct against native/include/stipple/stipple.h."""

import ctypes
import re
import subprocess
from ctypes import POINTER, c_char_p, c_double, c_float, c_int, c_uint32, c_uint64, c_uint8, c_void_p

import pytest

from stipple.binding import declarations, structs


@pytest.fixture(scope='module')
def header(root):
    text = (root / 'native/include/stipple/stipple.h').read_text()
    text = re.sub(r'/\*.*?\*/', '', text, flags=re.S)
    return re.sub(r'^\s*#.*$', '', text, flags=re.M).replace('extern "C" {', '')


@pytest.fixture(scope='module')
def c_layout(root, header, tmp_path_factory):
    """sizes, offsets and enum values as the C compiler sees them."""
    lines = []
    for name, fields in c_structs(header).items():
        lines.append(f'printf("size {name} %zu\\n", sizeof({name}));')
        for field in fields:
            lines.append(f'printf("field {name}.{field} %zu %zu\\n", offsetof({name}, {field}), '
                         f'sizeof((({name}*)0)->{field}));')
    for name, values in c_enums(header).items():
        for value in values:
            lines.append(f'printf("enum {name}.{value} %d\\n", (int){value});')
    lines.append('printf("constant ABI_VERSION %u\\n", (unsigned)STIPPLE_ABI_VERSION);')
    lines.append('printf("constant MAX_ANCHORS %u\\n", (unsigned)STIPPLE_MAX_ANCHORS);')
    lines.append('printf("constant NO_INDEX %u\\n", (unsigned)STIPPLE_NO_INDEX);')
    for name in ('DRAW_GEOMETRY_FLOATS', 'DRAW_ROW_FLOATS', 'MAX_DRAW_ROWS'):
        lines.append(f'printf("constant {name} %u\\n", (unsigned)STIPPLE_{name});')
    folder = tmp_path_factory.mktemp('abi')
    (folder / 'layout.c').write_text('#include <stddef.h>\n#include <stdio.h>\n#include <stipple/stipple.h>\n'
                                     'int main(void) {\n' + '\n'.join(lines) + '\nreturn 0;\n}\n')
    subprocess.run(['gcc', '-std=c99', '-Wall', '-Wextra', '-Wpedantic', '-Werror', '-I', str(root / 'native/include'),
                    str(folder / 'layout.c'), '-o', str(folder / 'layout')], check=True, timeout=60)
    output = subprocess.run([str(folder / 'layout')], check=True, capture_output=True, text=True, timeout=10).stdout
    return [line.split() for line in output.splitlines()]


def c_structs(header):
    """{struct: [field names]} in order, of structs with a body."""
    found = {}
    for name, body in re.findall(r'typedef struct (\w+) \{(.*?)\}', header, flags=re.S):
        fields = []
        for statement in body.split(';'):
            names = re.sub(r'^\s*(const\s+)?\w+\s*(\*(\s*const\b)?\s*)*', '', statement.strip())
            fields += [re.sub(r'\[.*\]', '', part).strip() for part in names.split(',') if part.strip()]
        found[name] = fields
    return found


def c_enums(header):
    return {name: re.findall(r'(STIPPLE_\w+)\s*=', body)
            for name, body in re.findall(r'typedef enum (\w+) \{(.*?)\}', header, flags=re.S)}


def c_functions(header):
    """{function: (result, [parameter types])} with types as C text without names."""
    body = re.sub(r'typedef (struct|enum) \w+ \{.*?\} \w+;', '', header, flags=re.S)
    body = re.sub(r'typedef .*?;', '', body)
    found = {}
    for result, name, parameters in re.findall(r'([\w\s*]+?)\b(stipple_\w+)\s*\(([^)]*)\)\s*;', body):
        types = []
        for parameter in parameters.split(','):
            parameter = ' '.join(parameter.split())
            if parameter == 'void':
                continue
            array = '[' in parameter
            kind = re.sub(r'\b\w+(\[\d+\])?$', '', parameter).replace(' ', '')
            types.append(kind + ('*' if array else ''))
        found[name] = (''.join(result.split()), types)
    return found


def ctype_of(text, enums):
    """The ctypes type that a C type of the header must have."""
    plain = {'void': None, 'constchar*': c_char_p, 'constchar**': POINTER(c_char_p), 'uint32_t': c_uint32,
             'uint64_t': c_uint64, 'constfloat*': POINTER(c_float), 'float*': POINTER(c_float),
             'constdouble*': POINTER(c_double), 'double*': POINTER(c_double), 'double': c_double, 'float': c_float,
             'uint32_t*': POINTER(c_uint32), 'constuint32_t*': POINTER(c_uint32),
             'uint64_t*': POINTER(c_uint64), 'uint8_t*': POINTER(c_uint8),
             'constuint8_t*': POINTER(c_uint8), 'constuint64_t*': POINTER(c_uint64)}
    if text in plain:
        return plain[text]
    if text in enums:
        return c_int
    name = text.removeprefix('const').rstrip('*')
    stars = text.count('*')
    if name in structs.STRUCTS:
        assert stars == 1, text
        return POINTER(structs.STRUCTS[name])
    assert name.startswith('Stipple'), text
    return c_void_p if stars == 1 else POINTER(c_void_p)


def test_parser_sees_the_whole_header(header):
    """Guards the other tests: a parser that misses things would let them pass."""
    assert len(c_structs(header)) == header.count('typedef struct') - len(
        re.findall(r'typedef struct \w+ \w+;', header))
    assert set(re.findall(r'\b(stipple_\w+)\s*\(', header)) == set(c_functions(header))
    assert len(c_functions(header)) > 50


def test_functions_match(header):
    enums = c_enums(header)
    expected = {name: (ctype_of(result, enums), [ctype_of(t, enums) for t in parameters])
                for name, (result, parameters) in c_functions(header).items()}
    assert set(declarations.FUNCTIONS) == set(expected)
    for name, types in expected.items():
        assert declarations.FUNCTIONS[name] == types, name


def test_every_free_accepts_null(library):
    """One that does not ends the process."""
    frees = [name for name in declarations.FUNCTIONS if name.endswith('_free')]
    assert len(frees) == 18
    for name in frees:
        assert getattr(library, name)(None) is None


def test_structs_match(header, c_layout):
    assert set(structs.STRUCTS) == set(c_structs(header))
    sizes = {line[1]: int(line[2]) for line in c_layout if line[0] == 'size'}
    fields = {line[1]: (int(line[2]), int(line[3])) for line in c_layout if line[0] == 'field'}
    for name, struct in structs.STRUCTS.items():
        assert ctypes.sizeof(struct) == sizes[name], name
        mine = {f'{name}.{field[0]}': (getattr(struct, field[0]).offset, getattr(struct, field[0]).size)
                for field in struct._fields_}
        assert mine == {key: value for key, value in fields.items() if key.startswith(name + '.')}


def test_field_kinds_match(header):
    """Sizes alone do not tell a float from an integer, or what a pointer points to."""
    kinds = {'uint32_t': c_uint32, 'uint64_t': c_uint64, 'int64_t': ctypes.c_int64, 'double': c_double,
             'float': c_float, 'char': ctypes.c_char,
             'const float*': POINTER(c_float), 'float*': POINTER(c_float), 'const uint32_t*': POINTER(c_uint32),
             'const uint8_t*': POINTER(c_uint8),
             'uint32_t*': POINTER(c_uint32), 'uint64_t*': POINTER(c_uint64), 'const uint64_t*': POINTER(c_uint64),
             'const StippleCloud*': c_void_p, 'const StippleCloud* const*': POINTER(c_void_p),
             'const StippleGrade*': POINTER(structs.StippleGrade),
             'const StippleMesh*': c_void_p, 'const StippleJob*': c_void_p, 'const StippleViews*': c_void_p,
             'const char*': c_char_p,
             'const double*': POINTER(c_double), 'const StippleAperture*': POINTER(structs.StippleAperture),
             'const StippleShutter*': POINTER(structs.StippleShutter),
             'const StippleAccuracy*': POINTER(structs.StippleAccuracy),
             'const StippleEffectsSurvey*': POINTER(structs.StippleEffectsSurvey),
             'StippleAccuracy': structs.StippleAccuracy}
    for name, body in re.findall(r'typedef struct (\w+) \{(.*?)\}', header, flags=re.S):
        mine = dict(structs.STRUCTS[name]._fields_)
        for statement in filter(None, (' '.join(part.split()) for part in body.split(';'))):
            kind, names = re.match(r'((?:const )?\w+\*?(?: const\*)?) (.*)', statement).groups()
            for field in names.split(','):
                field, _, length = field.strip().partition('[')
                expected = kinds[kind] * int(length.rstrip(']')) if length else kinds[kind]
                assert mine[field] == expected, f'{name}.{field}'


def test_enums_match(header, c_layout):
    # The add-on asks for a model's settings and knows no kinds, so that another kind asks nothing of it.
    unknown = 'StippleModelKind'
    assert set(structs.ENUMS) == set(c_enums(header)) - {unknown}
    expected = {line[1]: int(line[2]) for line in c_layout
                if line[0] == 'enum' and not line[1].startswith(unknown + '.')}
    mine = {f'{name}.{prefix}{value.name}': int(value) for name, (enum, prefix) in structs.ENUMS.items()
            for value in enum}
    assert mine == expected


def test_constants_match(c_layout):
    constants = {line[1]: int(line[2]) for line in c_layout if line[0] == 'constant'}
    assert constants == {'ABI_VERSION': structs.ABI_VERSION, 'MAX_ANCHORS': structs.MAX_ANCHORS,
                         'NO_INDEX': structs.NO_INDEX, 'DRAW_GEOMETRY_FLOATS': structs.DRAW_GEOMETRY_FLOATS,
                         'DRAW_ROW_FLOATS': structs.DRAW_ROW_FLOATS, 'MAX_DRAW_ROWS': structs.MAX_DRAW_ROWS}
