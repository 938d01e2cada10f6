# SPDX-License-Identifier: GPL-3.0-or-later
"""The zip's bytes, and what the add-on says of libraries that are not the ones it came with."""

import json
import re
import subprocess
import zipfile

import make_zip
import pytest
from stipple.binding import contents, library
from stipple.binding.errors import LibraryError
from stipple.binding.structs import ABI_VERSION

SOURCE = f'unsigned stipple_abi_version(void) {{ return {ABI_VERSION}u; }}\n'


@pytest.fixture(scope='module')
def libraries(tmp_path_factory):
    """Small libraries under the names of the real ones: what is looked at comes before what is called."""
    folder = tmp_path_factory.mktemp('lib')
    (folder / 'small.c').write_text(SOURCE)
    for name in make_zip.LIBRARIES + make_zip.OPTIONAL_LIBRARIES:
        subprocess.run(['gcc', '-shared', '-fPIC', str(folder / 'small.c'), '-o', str(folder / name)], check=True)
    return folder


@pytest.fixture
def installed(libraries, tmp_path):
    """The add-on as a zip installs it."""
    make_zip.make(libraries, tmp_path / 'stipple.zip')
    with zipfile.ZipFile(tmp_path / 'stipple.zip') as archive:
        archive.extractall(tmp_path)
    return tmp_path / 'stipple'


def said(installed):
    """What loading the library of an installed add-on is refused with."""
    with pytest.raises(LibraryError) as refused:
        library.load(installed / 'lib' / 'libstipple.so')
    message = str(refused.value)
    assert '\n' not in message and len(re.findall(r'[.;!?](?:\s|$)', message)) <= 2
    # The panels say the same from then on, without looking again.
    assert library.problem(installed / 'lib' / 'libstipple.so') == message
    return message


def edit_contents(installed, **changes):
    file = installed / 'lib' / contents.FILE_NAME
    file.write_text(json.dumps(json.loads(file.read_text()) | changes))


def test_two_runs_give_the_same_bytes(libraries, tmp_path):
    make_zip.make(libraries, tmp_path / 'a.zip', licences=libraries)
    make_zip.make(libraries, tmp_path / 'b.zip', licences=libraries)
    assert (tmp_path / 'a.zip').read_bytes() == (tmp_path / 'b.zip').read_bytes()
    other = zipfile.ZipFile(tmp_path / 'a.zip').namelist()
    assert other == sorted(other) and len(other) == len(set(other))


def test_the_zip_is_named_and_split_as_blender_does_it(libraries, tmp_path):
    assert re.fullmatch(r'stipple-\d+\.\d+\.\d+-linux_x64\.zip', make_zip.split_name())
    make_zip.make(libraries, tmp_path / 'arm.zip', platform='linux-arm64')
    manifest = zipfile.ZipFile(tmp_path / 'arm.zip').read('stipple/blender_manifest.toml').decode()
    assert re.findall(r'^platforms.*', manifest, re.M) == ['platforms = ["linux-arm64"]']


def test_libraries_as_they_came_are_loaded(installed):
    # The small library passes what is looked at and has none of the functions.
    assert 'lacks a function' in said(installed)


def test_a_library_of_a_build_has_no_list_and_is_let_be(libraries):
    with pytest.raises(LibraryError, match='lacks a function'):
        library.load(libraries / 'libstipple.so')


@pytest.mark.parametrize('name', make_zip.LIBRARIES + make_zip.OPTIONAL_LIBRARIES)
def test_one_changed_byte_in_any_library_is_refused(installed, name):
    file = installed / 'lib' / name
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(data)
    assert f"{name}' is damaged" in said(installed)


def test_a_missing_library_is_named(installed):
    (installed / 'lib' / 'libstipple_media.so').unlink()
    assert "libstipple_media.so' is missing; install the add-on again" in said(installed)


def test_another_platforms_zip_is_refused(installed):
    edit_contents(installed, platform='windows-x64')
    assert said(installed) == (f'This is the download of Stipple for windows-x64; this machine needs the one for '
                               f'{contents.this_platform()}.')


@pytest.mark.parametrize('platform', sorted(set(make_zip.SELF_CONTAINED_LIBRARIES) - {contents.this_platform()}))
def test_the_zip_of_any_other_platform_is_refused_as_it_is(libraries, tmp_path, platform):
    """Where its library has another name than this system's, that one is missing: the same sentence."""
    (name,) = make_zip.SELF_CONTAINED_LIBRARIES[platform]
    (tmp_path / name).write_bytes((libraries / 'libstipple.so').read_bytes())
    make_zip.make(tmp_path, tmp_path / 'other.zip', (name,), platform=platform)
    with zipfile.ZipFile(tmp_path / 'other.zip') as archive:
        archive.extractall(tmp_path)
    assert said(tmp_path / 'stipple') == (f'This is the download of Stipple for {platform}; this machine needs the one '
                                          f'for {contents.this_platform()}.')


def test_another_version_of_the_addon_is_refused(installed):
    edit_contents(installed, version='9.8.7')
    assert f'are of version 9.8.7 and the add-on is of version {make_zip.version()}' in said(installed)


@pytest.mark.parametrize('text', ['', '{', '[]', '{"platform": 1}', '{"platform": "a", "version": "1", "files": 3}'])
def test_a_damaged_list_is_refused(installed, text):
    (installed / 'lib' / contents.FILE_NAME).write_text(text)
    assert 'is damaged (' in said(installed)


def test_a_missing_library_stops_the_zip(tmp_path):
    with pytest.raises(FileNotFoundError, match='libstipple.so'):
        make_zip.make(tmp_path, tmp_path / 'stipple.zip')
    assert not (tmp_path / 'stipple.zip').exists()


def test_every_platform_has_the_library_that_the_addon_looks_for():
    systems = {name: key for key, name in contents.SYSTEMS.items()}
    for platform, names in make_zip.SELF_CONTAINED_LIBRARIES.items():
        assert names == (library.FILE_NAMES.get(systems[platform.split('-')[0]], 'libstipple.so'),)
    listed = re.search(r'^platforms = \[(.*)\]', make_zip.manifest(), re.M).group(1)
    assert set(re.findall(r'"([^"]+)"', listed)) == set(make_zip.SELF_CONTAINED_LIBRARIES)
