"""What the shared libraries need and export; each rule is also shown a library that breaks it."""
import os
import pathlib
import subprocess

import pytest
import rules

ROOT = pathlib.Path(__file__).resolve().parents[2]
HEADER = ROOT / 'native' / 'include' / 'stipple' / 'stipple.h'
BUILD = pathlib.Path(os.environ.get('STIPPLE_BUILD_DIR', ROOT / 'build' / 'release'))
LIBRARY = BUILD / 'lib' / 'libstipple.so'
MEDIA_LIBRARY = BUILD / 'lib' / 'libstipple_media.so'
PACKING_LIBRARY = BUILD / 'lib' / 'libstipple_packing.so'
NN_LIBRARY = BUILD / 'lib' / 'libstipple_nn.so'  # built where oneDNN is


def build_library(folder, source, *link):
    """A small shared library, to show the rules something to find."""
    (folder / 'small.c').write_text(source, encoding='utf-8')
    library = folder / 'libsmall.so'
    subprocess.run(['cc', '-shared', '-fPIC', '-o', str(library), str(folder / 'small.c'), '-Wl,--no-as-needed', *link],
                   check=True)
    return library


# The sanitizers add libraries of their own, and code that is not ours to name.
needs_plain_build = pytest.mark.skipif(os.environ.get('STIPPLE_SANITIZE') == 'ON',
                                       reason='the sanitizers change what the libraries need and export')


@needs_plain_build
def test_the_library_needs_only_what_every_blender_has():
    assert rules.needed_violations(LIBRARY) == []


def test_another_need_is_found(tmp_path):
    library = build_library(tmp_path, 'int stipple_x(void) { return 1; }', '-ltinygltf', '-lm')
    found = rules.needed_violations(library)
    assert len(found) == 1 and 'needs libtinygltf.so' in found[0]


@pytest.mark.parametrize('file', [LIBRARY, MEDIA_LIBRARY, PACKING_LIBRARY, NN_LIBRARY, BUILD / 'bin' / 'stipple'],
                         ids=lambda path: path.name)
def test_mpi_is_linked_by_a_program_of_its_own_alone(file):
    if file == NN_LIBRARY and not file.exists():
        pytest.skip('oneDNN is not on this machine, so libstipple_nn.so is not built')
    assert rules.mpi_violations(file) == []


def test_a_link_with_mpi_is_found(tmp_path):
    (tmp_path / 'mpi').mkdir()
    stand_in = build_library(tmp_path / 'mpi', 'int MPI_Init(void) { return 0; }', '-Wl,-soname,libmpi.so.40')
    found = rules.mpi_violations(build_library(tmp_path, 'int stipple_x(void) { return 1; }', str(stand_in)))
    assert len(found) == 1 and 'needs libmpi.so.40' in found[0]


@needs_plain_build
@pytest.mark.parametrize('library', [LIBRARY, MEDIA_LIBRARY, PACKING_LIBRARY, NN_LIBRARY], ids=lambda path: path.name)
def test_the_libraries_export_only_their_own_names(library):
    if library == NN_LIBRARY and not library.exists():
        pytest.skip('oneDNN is not on this machine, so libstipple_nn.so is not built')
    assert rules.exported_symbols(library), 'the library exports something'
    assert rules.export_violations(library) == []


@needs_plain_build
def test_the_library_of_networks_exports_its_table_alone():
    if not NN_LIBRARY.exists():
        pytest.skip('oneDNN is not on this machine, so libstipple_nn.so is not built')
    assert rules.exported_symbols(NN_LIBRARY) == {'stipple_nn_table'}


def test_another_exported_name_is_found(tmp_path):
    library = build_library(tmp_path, 'int stipple_x(void) { return 1; } int helper(void) { return 2; }')
    found = rules.export_violations(library)
    assert len(found) == 1 and found[0].endswith('exports helper')


def test_every_function_of_the_header_is_exported():
    assert len(rules.declared_functions(HEADER)) > 60
    assert rules.missing_exports(HEADER, LIBRARY) == []


def test_a_function_that_is_only_declared_is_found(tmp_path):
    header = tmp_path / 'header.h'
    header.write_text('/* stipple_old(int) is gone */\nint stipple_x(void);\nconst char* stipple_y(int a,\n   int '
                      'b);\n')
    library = build_library(tmp_path, 'int stipple_x(void) { return 1; }')
    assert rules.declared_functions(header) == {'stipple_x', 'stipple_y'}
    assert [line.split()[0] for line in rules.missing_exports(header, library)] == ['stipple_y']
