# SPDX-License-Identifier: GPL-3.0-or-later
"""The tool for Windows under Wine: the same commands as on Linux, in a folder with letters of several scripts, give the
same files, and it answers and refuses with the same words."""

import re
import shlex
import subprocess
import time

import pytest
import test_windows

FOLDER = 'Größe und Пример 日本語 🙂'
SPLATS = 'Wolke für 日本.ply'
PACKED = ('splat', 'glb', 'usda')
# Each makes a file.
MAKES = (
    f'convert truth.ply "{SPLATS}"',
    'convert truth.ply text.ply --ascii',
    'convert truth.ply packed.compressed.ply',
    *(f'convert truth.ply packed.{form}' for form in PACKED),
    f'decode "{SPLATS}" Baum.stipple.safetensors',
    'decode Baum.stipple.safetensors third.ply --ratio 0.3',
    *(f'convert packed.{form} "zurück aus {form}.ply"' for form in ('splat', 'usda')),
)
IDENTICAL = (SPLATS, 'text.ply', 'Baum.stipple.safetensors', 'third.ply', 'packed.compressed.ply',
             *(f'packed.{form}' for form in PACKED), *(f'zurück aus {form}.ply' for form in ('splat', 'usda')))
ASKS = (f'info "{SPLATS}" --json', 'info third.ply --json', 'info Baum.stipple.safetensors --json',
        f'compare "{SPLATS}" third.ply --json', 'formats --json', 'formats', '--version', '--help', 'fit --help')
# Each fails with one sentence.
REFUSED = ('info "nicht da ä.ply"', 'convert truth.ply "kein Ordner/日本.ply"', 'convert truth.ply 日本.xyz',
           'decode truth.ply never.ply --ratio 1.5', 'info images', 'render truth.ply', 'nonsense')


@pytest.fixture(scope='module')
def tools(linux_tool, windows_tool, wine, tmp_path_factory):
    """{system: run(command)}, each in its own folder, `run.folder`, in which the same was done."""
    def on_linux(command):
        return subprocess.run([linux_tool, *shlex.split(command)], cwd=on_linux.folder, capture_output=True, text=True,
                              timeout=600)

    def on_windows(command):
        return wine(windows_tool, *shlex.split(command), cwd=on_windows.folder)

    for name, run in (('Linux', on_linux), ('Windows', on_windows)):
        run.folder = test_windows.scene(tmp_path_factory.mktemp(name) / FOLDER)
        started = time.perf_counter()
        for command in MAKES:
            result = run(command)
            assert result.returncode == 0, (name, command, result.stdout, result.stderr)
        print(f'{name}: {len(MAKES)} commands, {time.perf_counter() - started:.1f} s')
    return {'linux': on_linux, 'windows': on_windows}


def test_it_needs_windows_and_its_library(windows_tool):
    assert 'stipple.dll' in test_windows.imported(windows_tool)
    assert test_windows.imported(windows_tool) <= test_windows.SYSTEM | {'stipple.dll'}


@pytest.mark.parametrize('name', IDENTICAL)
def test_files_have_the_bytes_that_linux_writes(tools, name):
    first, second = ((tools[system].folder / name).read_bytes() for system in ('linux', 'windows'))
    assert len(first) > 500 and first == second


@pytest.mark.parametrize('command', ASKS)
def test_answers_are_those_of_linux(tools, command):
    first, second = (tools[system](command) for system in ('linux', 'windows'))
    assert (first.returncode, second.returncode) == (0, 0), second.stderr
    assert len(first.stdout) > 4 and first.stdout == second.stdout


@pytest.mark.parametrize('command', REFUSED)
def test_refusals_are_sentences_and_statuses_of_linux(tools, command):
    first, second = (tools[system](command) for system in ('linux', 'windows'))
    assert first.returncode in (1, 2) and first.returncode == second.returncode
    assert re.fullmatch('stipple: [^\n]+\n', second.stderr), second.stderr
    assert second.stderr == first.stderr


def test_a_file_that_is_read_only_stays(tools):
    result = tools['windows']('convert truth.ply "read only.ply"')
    assert result.returncode == 1
    assert result.stderr == 'stipple: read only.ply cannot be written: Permission denied\n'
