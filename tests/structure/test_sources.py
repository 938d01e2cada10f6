"""The tree keeps the project's structure; each rule is also shown a tree that breaks it."""
import os
import pathlib
import shutil
import subprocess

import pytest
import rules

ROOT = pathlib.Path(__file__).resolve().parents[2]
TABLE = ROOT / 'docs' / 'architecture.md'
HEADER = ROOT / 'native' / 'include' / 'stipple' / 'stipple.h'


def plant(root, files):
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding='utf-8')
    return root


def test_top_level_has_only_the_agreed_entries():
    assert rules.top_level_violations(ROOT) == []


def test_another_top_level_entry_is_found(tmp_path):
    plant(tmp_path, {'README.md': '', 'native/a.cpp': '', 'scripts/build.sh': '', 'notes.txt': ''})
    assert [line.split(':')[0] for line in rules.top_level_violations(tmp_path)] == ['notes.txt', 'scripts']


def test_top_level_is_read_from_git_where_there_is_git(tmp_path):
    plant(tmp_path, {'.gitignore': '/build/\n', 'build/x.o': '', 'extra/y': ''})
    subprocess.run(['git', 'init', '-q', str(tmp_path)], check=True)
    assert [line.split(':')[0] for line in rules.top_level_violations(tmp_path)] == ['extra']


def test_the_table_names_every_native_folder():
    table = rules.include_table(TABLE)
    assert {'base', 'math', 'data', 'density', 'splat', 'mesh', 'decode', 'io', 'api', 'cli'} <= set(table)
    assert table['data'] == ({'base', 'math'}, set())
    assert table['cli'] == ({'stipple.h'}, {'CLI11'})


def test_native_includes_follow_the_table():
    assert rules.include_violations(ROOT, rules.include_table(TABLE)) == []


def test_native_targets_link_what_the_table_allows():
    assert rules.link_violations(ROOT / 'native' / 'CMakeLists.txt', rules.include_table(TABLE)) == []


@pytest.mark.parametrize('name, line, reason', [
    ('native/base/a.cpp', '#include "math/vec.h"', 'base may not include math'),
    ('native/math/a.h', '#include "data/images/image.h"', 'math may not include data'),
    ('native/density/a.cpp', '#include "io/splats/splat_file.h"', 'density may not include io'),
    ('native/io/a.cpp', '#include "decode/decoder.h"', 'io may not include decode'),
    ('native/cli/a.cpp', '#include "api/handles.h"', 'cli may not include api'),
    ('native/splat/a.cpp', '#include "stipple/stipple.h"', 'splat may not include the public header'),
    ('native/data/a.cpp', '#include <tbb/parallel_for.h>', 'data may not include oneTBB'),
    ('native/splat/a.cpp', '  #  include <Eigen/Core>', 'splat may not include Eigen'),
    ('native/api/a.cpp', '#include <openvdb/openvdb.h>', 'api may not include OpenVDB'),
    ('native/splat/a.cpp', '#include <windows.h>', 'nor a known system header'),
    ('native/io/a.cpp', '#include <sys/mman.h>', 'nor a known system header'),
    ('native/base/platform/windows/a.cpp', '#include <unistd.h>', 'nor a known system header'),
    ('native/tools/a.cpp', '#include <vector>', 'native/tools is not in the table'),
])
def test_an_include_against_the_table_is_found(tmp_path, name, line, reason):
    plant(tmp_path, {name: f'#include <vector>\n{line}\n'})
    found = rules.include_violations(tmp_path, rules.include_table(TABLE))
    assert len(found) == 1 and reason in found[0]


def test_a_third_party_header_in_a_header_of_another_folder_is_found(tmp_path):
    plant(tmp_path, {'native/math/solve.h': '#include <Eigen/Core>\n',
                     'native/math/inside.cpp': '#include "math/solve.h"\n'})
    table = rules.include_table(TABLE)
    assert rules.include_violations(tmp_path, table) == []
    plant(tmp_path, {'native/splat/outside.cpp': '#include "math/solve.h"\n'})
    assert rules.include_violations(tmp_path, table) == ["math/solve.h: carries ['Eigen'] into ['splat']"]


def test_a_format_library_outside_its_format_is_found(tmp_path):
    plant(tmp_path, {'native/io/media/volume_media.cpp': '#include <openvdb/openvdb.h>\n'})
    table = rules.include_table(TABLE)
    assert rules.include_violations(tmp_path, table) == []
    plant(tmp_path, {'native/io/splats/splat_file.cpp': '#include <openvdb/openvdb.h>\n'})
    assert rules.include_violations(tmp_path, table) == [
        'native/io/splats/splat_file.cpp:1: openvdb/openvdb.h: OpenVDB belongs in the files of its format']


def test_a_link_against_the_table_is_found(tmp_path):
    plant(tmp_path, {'CMakeLists.txt': 'stipple_module(base THIRD_PARTY TBB::tbb)\n'
                                       'stipple_module(data MODULES base math io)\n'})
    found = rules.link_violations(tmp_path / 'CMakeLists.txt', rules.include_table(TABLE))
    assert len(found) == 1 and "stipple_data links ['io']" in found[0]


def test_the_binding_does_not_know_blender():
    assert list((ROOT / 'addon' / 'stipple' / 'binding').glob('*.py')), 'the binding is where it should be'
    assert rules.blender_import_violations(ROOT / 'addon' / 'stipple' / 'binding') == []


@pytest.mark.parametrize('line', ['import bpy', 'import numpy, bpy.types', 'from bpy.props import IntProperty',
                                  'def f():\n    import mathutils', 'm = __import__("bpy")',
                                  'import importlib\nm = importlib.import_module("gpu.state")'])
def test_an_import_of_blender_is_found(tmp_path, line):
    plant(tmp_path, {'library.py': f'"""import bpy in a text is no import."""\n{line}\n'})
    assert len(rules.blender_import_violations(tmp_path)) == 1


def test_no_file_is_too_long():
    assert rules.length_violations(ROOT) == []


def test_a_file_that_is_too_long_is_found(tmp_path):
    plant(tmp_path, {'native/splat/long.cpp': '\n' * 601, 'native/splat/right.cpp': '\n' * 600,
                     'native/include/stipple/stipple.h': '\n' * 2000})
    assert rules.length_violations(tmp_path) == ['native/splat/long.cpp: 601 lines, at most 600 are allowed']


def test_no_folder_is_crowded():
    assert rules.crowded_folders(ROOT) == []


def test_a_crowded_folder_is_found(tmp_path):
    plant(tmp_path, {f'native/splat/file{i}.cpp': '' for i in range(41)} | {f'native/data/file{i}.cpp': ''
                                                                            for i in range(40)})
    assert rules.crowded_folders(tmp_path) == ['native/splat: 41 files, at most 40 are allowed']


def test_the_boundary_is_marshalling():
    assert rules.boundary_violations(ROOT) == []


_LONG = 'StippleStatus stipple_long(const StippleCloud* cloud) {\n' + '  cloud;\n' * 39 + '}\n'


@pytest.mark.parametrize('text, reason', [
    ('double entropyOf(const OctreeDensity& density) { return 0; }',
     'entropyOf is neither an exported function nor a conversion'),
    ('namespace {\nclass Timing {\n public:\n  void run() { go(); }\n};\n}',
     'run is neither an exported function nor a conversion'),
    ('#include <chrono>', 'chrono: a conversion has no use for it'),
    (_LONG, 'stipple_long has 41 lines, at most 40 are allowed'),
    ('StippleStatus stipple_f(void) { return guarded([&] { for (auto& row : rows) row.f(); }); }',
     'stipple_f is exported and has a loop'),
    ('StippleStatus stipple_f(void) { while (next()) {} }', 'stipple_f is exported and has a loop'),
    ('Cloud from(const StippleCloud& c) { for (size_t i = 0; i < splats.size(); ++i) f(i); }', 'from has a loop over'),
    ('void give(const std::vector<float>& pixels, float* to) { for (float p : pixels) *to++ = p; }',
     'give has a loop over'),
    ('Cloud from(const StippleCloud& c) { parallelFor(n, 1, f); }', 'from calls parallelFor'),
    ('Rows rowsFrom(const StippleRow* rows) { std::sort(rows, rows + 3); }', 'rowsFrom calls sort'),
])
def test_more_than_marshalling_is_found(tmp_path, text, reason):
    plant(tmp_path, {'native/api/some.cpp': text + '\n'})
    found = rules.boundary_violations(tmp_path)
    assert len(found) == 1 and reason in found[0], found


def test_marshalling_is_accepted(tmp_path):
    plant(tmp_path, {'native/api/some.cpp': """
        // for (auto& pixel : pixels) in a comment, and std::sort( in another.
        namespace { struct Kept { std::vector<int> list; };
        constexpr float* StippleRow::*kMembers[] = {&StippleRow::x};
        Row rowFrom(const StippleRow& row, const char* name) { for (auto m : kMembers) copy(row.*m); return {}; }
        void requireSides(uint32_t width) { if (width < 1) fail("for (pixel)"); }
        template <typename T> void copyTo(const std::vector<T>& values, T* out) {
          std::copy(values.begin(), values.end(), out); } }
        extern "C" { StippleStatus stipple_row(const StippleRow* row) {
          return guarded([&] { rowFrom(*row, "row"); }); } }
        """, 'native/api/guard.h': 'inline void anything() { work(); }\n',
                     'native/shot/elsewhere.cpp': 'void work() { for (auto& pixel : pixels) f(pixel); }\n'})
    assert rules.boundary_violations(tmp_path) == []


def test_the_public_header_is_c99(tmp_path):
    assert rules.c99_violations(HEADER, tmp_path) == []


@pytest.mark.parametrize('text', ['int stipple_f(int& x);', 'enum E : unsigned { A };',
                                  'typedef struct S { bool yes; } S;', 'uint32_t stipple_g(void);'])
def test_a_header_that_is_not_c99_is_found(tmp_path, text):
    header = tmp_path / 'header.h'
    header.write_text(text + '\n', encoding='utf-8')
    assert rules.c99_violations(header, tmp_path)


def test_continuous_integration_runs_the_suite(tmp_path):
    (tmp_path / '.ci').mkdir()
    shutil.copy(ROOT / '.ci' / 'run', tmp_path / '.ci' / 'run')
    plant(tmp_path, {'tests/run.sh': 'echo "the suite, $# arguments"; exit 7\n'})
    ci = subprocess.run(['bash', '.ci/run'], cwd=tmp_path, env={'PATH': os.environ['PATH'], 'CI': 'true'},
                        stdin=subprocess.DEVNULL, capture_output=True, text=True)
    assert (ci.returncode, ci.stdout) == (7, 'the suite, 0 arguments\n')


def test_links_between_pages_lead_somewhere():
    assert rules.broken_links(ROOT) == []


def test_a_broken_link_is_found(tmp_path):
    plant(tmp_path, {'docs/a.md': '[b](b.md) [c](c.md#part) ![p](p.png) [web](https://example.org) [here](#top)\n',
                     'docs/b.md': ''})
    assert rules.broken_links(tmp_path) == ['docs/a.md: c.md#part', 'docs/a.md: p.png']


def test_lines_of_documentation_fit_a_window():
    assert rules.wide_prose(ROOT) == []


def test_a_wide_line_of_documentation_is_found(tmp_path):
    wide, table, link = 'word ' * 30, f'| {"x" * 150} | y |', 'https://example.org/' + 'x' * 150
    plant(tmp_path, {'docs/deep/a.md': f'# A\n\n{wide}\n{table}\n{link}\n', 'README.md': f'{"x " * 61}\n',
                     'tests/notes.md': wide, 'tests/peers/README.md': wide, 'docs/b.md': 'x' * 60 + ' ' + 'y' * 59})
    assert [line.split(': ')[0] for line in rules.wide_prose(tmp_path)] == ['README.md:1', 'docs/deep/a.md:3',
                                                                            'tests/peers/README.md:1']
