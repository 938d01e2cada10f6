# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding and refusing libraries: each case is one sentence that names the file."""

import subprocess
import sys

import pytest

from stipple.binding import library
from stipple.binding.errors import LibraryError
from stipple.binding.structs import ABI_VERSION


def build(folder, name, source):
    (folder / f'{name}.c').write_text(source)
    subprocess.run(['gcc', '-shared', '-fPIC', str(folder / f'{name}.c'), '-o', str(folder / f'{name}.so')],
                   check=True, timeout=60)
    return folder / f'{name}.so'


def test_missing_library_is_one_clear_sentence(tmp_path):
    with pytest.raises(LibraryError, match=r"nowhere\.so' is missing"):
        library.load(tmp_path / 'nowhere.so')


def test_a_path_that_is_not_absolute_is_refused(tmp_path, monkeypatch):
    """Such a path would load what lies beside a file from elsewhere, or in the working folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'libstipple.so').write_text('not a library')
    for path in ('libstipple.so', './libstipple.so', '../libstipple.so', '~/libstipple.so'):
        with pytest.raises(LibraryError, match='its path must be absolute'):
            library.load(path)
        assert 'its path must be absolute' in library.problem(path)
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, 'libstipple.so')
    assert 'its path must be absolute' in library.problem()


def test_wrong_abi_version_is_refused_with_both_versions(tmp_path):
    file = build(tmp_path, 'old', 'unsigned stipple_abi_version(void) { return 99u; }\n')
    with pytest.raises(LibraryError, match=f'ABI version 99; this add-on needs version {ABI_VERSION}'):
        library.load(file)


def test_another_library_is_refused(tmp_path):
    file = build(tmp_path, 'other', 'int something_else(void) { return 0; }\n')
    with pytest.raises(LibraryError, match='is not a Stipple library'):
        library.load(file)


def test_library_that_lacks_a_function_is_refused(tmp_path):
    file = build(tmp_path, 'partial', f'unsigned stipple_abi_version(void) {{ return {ABI_VERSION}u; }}\n')
    with pytest.raises(LibraryError, match='lacks a function'):
        library.load(file)


def test_file_that_is_no_library_is_refused(tmp_path):
    (tmp_path / 'text.so').write_text('not a library')
    with pytest.raises(LibraryError, match='cannot be loaded'):
        library.load(tmp_path / 'text.so')


def test_environment_names_the_library(monkeypatch, tmp_path):
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, str(tmp_path / 'named.so'))
    assert library.find() == tmp_path / 'named.so'
    assert library.find(tmp_path / 'given.so') == tmp_path / 'given.so'
    monkeypatch.delenv(library.ENVIRONMENT_VARIABLE)
    assert library.find().parts[-2:] == ('lib', 'libstipple.so')


def test_binding_never_imports_blender(root):
    """In a fresh interpreter that has no bpy at all, every module of the binding loads."""
    modules = sorted(p.stem for p in (root / 'addon/stipple/binding').glob('*.py') if p.stem != '__init__')
    code = ("import sys, types\n"
            "sys.modules['bpy'] = None\n"
            "p = types.ModuleType('stipple'); p.__path__ = [%r]; sys.modules['stipple'] = p\n"
            "import importlib\n"
            "for m in %r: importlib.import_module('stipple.binding.' + m)\n" % (str(root / 'addon/stipple'), modules))
    subprocess.run([sys.executable, '-c', code], check=True, timeout=60)
