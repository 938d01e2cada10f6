"""Files from elsewhere: what they may ask for stands in one place and in the docs, and JSON is parsed in one place."""
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LIMITS = ROOT / 'native' / 'io' / 'bytes' / 'limits.h'
MEBIBYTE = 1 << 20

#: Whoever parses JSON by itself has no limit of depth; a loader that parses needs requireSmallScene before it.
PARSES = re.compile(r'(?:[Jj]son|json_sax\w*)\s*::\s*(?:parse|accept|sax_parse|from_\w+)\b|basic_json<')
LOADS = re.compile(r'\bLoad(?:ASCII|Binary)From\w+')


def code_of(path):
    return '\n'.join(line.split('//')[0] for line in path.read_text().splitlines())


def matches(pattern):
    return {path.relative_to(ROOT).as_posix() for path in (ROOT / 'native').rglob('*') if path.suffix in ('.cpp', '.h')
            if pattern.search(code_of(path))}


def test_json_is_parsed_in_one_place():
    assert matches(PARSES) == {'native/io/bytes/json_text.cpp'}


def test_a_gltf_file_is_loaded_in_one_place_behind_the_limits_of_its_json():
    assert matches(LOADS) == {'native/io/media/gltf_scene.cpp'}
    code = code_of(ROOT / 'native/io/media/gltf_scene.cpp')
    assert len(re.findall(r'^\s+requireSmallScene\(', code, re.M)) == len(LOADS.findall(code))


def whole(text):
    """The value of a constant expression of limits.h."""
    text = re.sub(r'uint64_t\{(\d+)\}', r'\1', text).replace('kMebibyte', str(MEBIBYTE))
    assert re.fullmatch(r'[\d\s*<]+', text), text
    return eval(text)  # noqa: S307


def test_the_docs_name_every_limit_with_its_number():
    header = LIMITS.read_text()
    pairs = re.findall(r'^constexpr Allowance (\w+) = \{(.+), (\d+)\};', header, re.M)
    numbers = re.findall(r'^constexpr (?:uint64_t|size_t) (kMax\w+) = (.+);', header, re.M)
    expected = {name: f'{whole(always) // MEBIBYTE} MiB, and {int(per_byte)} bytes per byte of' for name, always,
                per_byte in pairs}
    for name, text in numbers:
        value = whole(text)
        expected[name] = f'{value // MEBIBYTE} MiB' if name.endswith('Bytes') else str(value)
    rows = {re.search(r'`(k\w+)`', row).group(1): row.split('|')[2].strip()
            for row in (ROOT / 'docs' / 'formats.md').read_text().splitlines()
            if re.match(r'\| .*`k(Max\w+|\w+Allowance)`', row)}
    assert len(expected) >= 8 and rows.keys() == expected.keys()
    for name, text in expected.items():
        assert rows[name].startswith(text), (name, rows[name], text)
