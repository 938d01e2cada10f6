# SPDX-License-Identifier: GPL-3.0-or-later
"""The tool for Windows under Wine: the same commands as on Linux, in a folder with letters of several scripts, give the
same files; it answers and refuses with the same words; and the tool's own tests pass."""

import json
import re
import shlex
import subprocess
import sys
import time

import bare_systems
import numpy as np
import pytest
import test_windows
from test_images_alike import made  # noqa: F401

FOLDER = 'Größe und Пример 日本語 🙂'
SPLATS = 'Wolke für 日本.ply'
PACKED = ('spz', 'sog', 'glb', 'splat', 'usda', 'usdz')
# What is made beside the steps of a bare system.
MORE = (
    f'convert truth.ply "{SPLATS}"',
    'convert truth.ply text.ply --ascii',
    'convert truth.ply packed.compressed.ply',
    f'decode "{SPLATS}" Baum.stipple.safetensors',
    'decode Baum.stipple.safetensors third.ply --ratio 0.3',
    *(f'convert packed.{form} "zurück aus {form}.ply"' for form in PACKED),
    'mesh volume.vdb "aus dem Volumen.glb" --threshold 0.05',
)
IDENTICAL = (SPLATS, 'text.ply', 'Baum.stipple.safetensors', 'third.ply', 'surface.ply', 'proxy.glb',
             'aus dem Volumen.glb', 'packed.compressed.ply', *(f'packed.{form}' for form in PACKED),
             *(f'zurück aus {form}.ply' for form in PACKED))
PICTURES = (*(f'images/{view:02}.png' for view in range(bare_systems.VIEWS)), 'picture.exr')
# One of 255 steps, where a colour lies between two: functions of the C libraries round otherwise.
PICTURE_STEP = 1.01 / 255
# A step of Adam is as large where a derivative is nothing but rounding: of a fit's numbers a few go other ways by that.
FIT_ROUNDING = 1e-3
FIT_STEPS = 1e-2
FIT_SHARE = 0.02
ASKS = (f'info "{SPLATS}" --json', 'info third.ply --json', 'info Baum.stipple.safetensors --json', 'info . --json',
        'info proxy.glb --json', 'info volume.vdb --json', 'info images/00.png --json', 'info packed.sog --json',
        f'compare "{SPLATS}" third.ply --json', 'formats --json', 'formats', '--version', '--help', 'fit --help')
# Each fails with one sentence.
REFUSED = ('info "nicht da ä.ply"', 'convert truth.ply "kein Ordner/日本.ply"', 'convert truth.ply 日本.xyz',
           'decode truth.ply never.ply --ratio 1.5', 'info images', 'render truth.ply', 'nonsense')
# Pictures as oiiotool makes them (test_images_alike.py), and what is compared with each.
ALIKE = (('rgb.jpg', 'rgb.png'), ('rgb16.png', 'rgb.png'), ('grey.jpg', 'grey.png'), ('lossy.exr', 'half.exr'),
         ('tiled.exr', 'float.exr'))


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
        for command in (*bare_systems.STEPS, *MORE):
            result = run(command)
            assert result.returncode == 0, (name, command, result.stdout, result.stderr)
        print(f'{name}: {len(bare_systems.STEPS) + len(MORE)} commands, {time.perf_counter() - started:.1f} s')
    return {'linux': on_linux, 'windows': on_windows}


def test_it_needs_windows_and_its_library(windows_tool):
    assert 'stipple.dll' in test_windows.imported(windows_tool)
    assert test_windows.imported(windows_tool) <= test_windows.SYSTEM | {'stipple.dll'}


@pytest.mark.parametrize('name', IDENTICAL)
def test_files_have_the_bytes_that_linux_writes(tools, name):
    first, second = ((tools[system].folder / name).read_bytes() for system in ('linux', 'windows'))
    assert len(first) > 500 and first == second


@pytest.mark.parametrize('name', PICTURES)
def test_pictures_differ_by_one_step_at_most(tools, name):
    linux = tools['linux']
    result = linux(f'compare {name} {shlex.quote(str(tools["windows"].folder / name))} --json')
    figures = json.loads(result.stdout)
    print(f'{name}: {figures["max_error"]:.2g}')
    assert figures['max_error'] <= PICTURE_STEP
    other = json.loads(linux('compare images/00.png images/04.png --json').stdout)
    assert other['max_error'] > 10 * PICTURE_STEP


def test_a_fit_comes_to_the_same(tools):
    values = []
    for system in ('linux', 'windows'):
        data = (tools[system].folder / 'fitted.ply').read_bytes()
        values.append(np.frombuffer(data[data.index(b'end_header\n') + 11:], np.float32))
    assert values[0].size >= 300 * 14
    differences = np.abs(values[0] - values[1])
    share = np.count_nonzero(differences > FIT_ROUNDING) / differences.size
    print(f'a fit differs by {differences.max():.2g}; {share:.2%} of its numbers by more than {FIT_ROUNDING}')
    assert differences.max() <= FIT_STEPS and share <= FIT_SHARE


def test_volumes_hold_the_same(tools):
    """Of a file's bytes OpenVDB draws some by chance."""
    first, second = (json.loads(tools[system]('info volume.vdb --json').stdout) for system in ('linux', 'windows'))
    assert first == second and first['active_voxels'] > 1000


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


@pytest.mark.parametrize('pair', ALIKE)
def test_pictures_of_others_are_read_as_on_linux(tools, made, pair):  # noqa: F811
    figures = []
    for run in tools.values():
        result = run('compare ' + ' '.join(shlex.quote(str(made / name)) for name in pair) + ' --json')
        assert result.returncode == 0, result.stderr
        figures.append(json.loads(result.stdout))
    assert figures[0]['max_error'] > 0
    assert figures[0] == pytest.approx(figures[1], rel=1e-4, abs=1e-6)


def test_the_tools_own_tests_pass(windows_tool, wine, root, tmp_path):
    program = tmp_path / 'bin' / 'stipple'
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {shlex.quote(wine.launcher)} {shlex.quote(str(windows_tool))} "$@"\n')
    program.chmod(0o755)
    environment = wine.environment | {'STIPPLE_BUILD_DIR': str(tmp_path)}
    result = subprocess.run([sys.executable, '-m', 'pytest', '-q', '-p', 'no:cacheprovider', '--basetemp',
                             tmp_path / 'work', root / 'tests' / 'cli' / 'test_tool.py'], env=environment,
                            capture_output=True, text=True, timeout=3600)
    assert result.returncode == 0, result.stdout[-6000:]
    passed = int(re.search(r'(\d+) passed', result.stdout).group(1))
    print(f'{passed} tests of the tool passed')
    assert passed > 20
