"""Kinds of models are known in few places: another kind is a file, a row in the table and a number in the header."""
import ast
import pathlib
import re

ROOT = pathlib.Path(__file__).parents[2]
ADDON = ROOT / 'addon' / 'stipple'

# How the add-on can name a kind of source: the stored property and its values, the library's enumeration.
PROPERTY = 'source_kind'
STORED = {'MODEL', 'CLOUD', 'TREE'}
ENUMERATION = 'ModelKind'
FILES_ALLOWED = 2
# In C++: classes and functions of a kind, and the header's numbers.
CPP_KIND = re.compile(r'(Surface|Hierarchy|Field|Latent|Motion)(Model|Splats|Decoder|Source|Asset)|'
                      r'STIPPLE_MODEL_(SURFACE|HIERARCHY|FIELD|LATENT|MOTION)'
                      r'|"(surface|hierarchy|field|latent|motion)"')


def names_a_kind(text):
    """Whether Python code names a kind of source; comments may."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Attribute) and node.attr in {PROPERTY, ENUMERATION}:
            return True
        if isinstance(node, ast.Name) and node.id in {PROPERTY, ENUMERATION}:
            return True
        if isinstance(node, ast.Constant) and node.value in STORED | {PROPERTY}:
            return True
    return False


def test_code_that_names_a_kind_is_found():
    for text in ('if data.source_kind: pass', 'kind = "TREE"', 'class A:\n  source_kind: int', 'x = s.ModelKind.FIELD'):
        assert names_a_kind(text), text
    assert not names_a_kind('# of a TREE\nx = settings.counts_splats')


def test_few_files_of_the_addon_name_a_kind():
    found = sorted(str(path.relative_to(ADDON)) for path in ADDON.rglob('*.py')
                   if names_a_kind(path.read_text(encoding='utf-8')))
    assert len(found) <= FILES_ALLOWED, found
    assert found  # or the names above are out of date


def test_what_all_kinds_share_names_none():
    for name in ('native/api/handles.h', 'native/api/job.h', 'native/api/model.cpp',
                 'native/model/splat_model.h', 'native/model/splat_model.cpp', 'native/model/model_reading.cpp',
                 'native/cli/info.cpp', 'native/cli/decode.cpp', 'native/cli/convert.cpp'):
        code = re.sub(r'//.*', '', (ROOT / name).read_text(encoding='utf-8'))
        assert not CPP_KIND.search(code), (name, CPP_KIND.search(code))


def test_the_table_has_a_row_for_every_kind_of_the_header():
    header = (ROOT / 'native/include/stipple/stipple.h').read_text(encoding='utf-8')
    body = re.search(r'typedef enum StippleModelKind \{(.*?)\}', header, re.S).group(1)
    numbers = sorted(int(number) for number in re.findall(r'STIPPLE_MODEL_\w+\s*=\s*(\d+)', body))
    table = (ROOT / 'native/model/model_kinds.cpp').read_text(encoding='utf-8')
    assert sorted(int(n) for n in re.findall(r'ModelKind\{"\w+",\s*"[^"]+",\s*(\d+)', table)) == numbers
