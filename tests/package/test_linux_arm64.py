# SPDX-License-Identifier: GPL-3.0-or-later
"""The zip for Linux on ARM: what its library asks of a machine and, run by qemu, whether a program that loads it gets
what one on x86-64 gets. The same compiler and the same library of C++ make the zip for macOS."""

import json
import os
import shlex
import shutil
import subprocess
import time
import zipfile
from pathlib import Path

import bare_systems
import licences
import numpy as np
import pytest
import rules
import test_self_contained
import test_windows

HERE = Path(__file__).resolve().parent
ROOT_OF_ARM = Path('/usr/aarch64-linux-gnu')
HEADER = test_windows.HEADER
# Kernels of every instruction set add up in an order of their own, and NEON's fuse a product with its sum, as AVX2's do
# and the plain ones do not. So the measure of what is seen, and what the tree over the splats mixes by it, differ by
# the last bit. On x86-64 alone splats that are decoded by AVX2 and by AVX-512 differ by 6e-6, which is the logarithm
# that stands for an opacity of almost one; NEON's differ from those of AVX-512 by 2e-6.
DECODED_ROUNDING = 1e-5
# Numbers of the tree are at most one here, colours beyond it aside: two steps of float32.
TREE_ROUNDING = 1.2e-7
# What is written in steps that are coarser than that.
QUANTISED = ('part.compressed.ply', 'part.spz', 'again.ply')
MODEL = 'model.stipple.safetensors'
# What of a fit's numbers differs after 20 steps: a step is as large where a derivative is nothing but rounding.
PIXEL_ROUNDING = 1e-5
FIT_ROUNDING = 1e-3
PICTURE_STEP = 1.01 / 255


@pytest.fixture(scope='session')
def run_arm():
    """run(program, arguments..., cwd=...): a program of Linux on ARM by qemu."""
    qemu = shutil.which('qemu-aarch64')
    if qemu is None or not (ROOT_OF_ARM / 'lib' / 'libc.so.6').is_file():
        pytest.skip("qemu-user and libc6-arm64-cross, which run ARM's programs here, are not installed")

    def run(program, *arguments, cwd=None, check=False, env=None):
        return subprocess.run([qemu, '-L', ROOT_OF_ARM, program, *map(str, arguments)], cwd=cwd, capture_output=True,
                              text=True, timeout=1200, check=check, env=env)
    return run


@pytest.fixture(scope='session')
def arm_library(arm_zip, tmp_path_factory):
    """libstipple.so as it lies in the zip."""
    with zipfile.ZipFile(arm_zip) as archive:
        return Path(archive.extract('stipple/lib/libstipple.so', tmp_path_factory.mktemp('arm')))


@pytest.fixture(scope='session')
def arm_tool(arm_library, root):
    """The tool as it is built beside the zip's library, which it finds there."""
    built = root / 'build' / 'linux_arm64' / 'bin' / 'stipple'
    assert built.is_file(), f'{built} is missing; bash native/package/make_release.sh --linux-arm64 makes it'
    folder = arm_library.parent.parent / 'bin'
    folder.mkdir(exist_ok=True)
    return Path(shutil.copy(built, folder))


def test_the_zip_is_small_and_for_linux_on_arm(arm_zip):
    print(f'{arm_zip.name}: {arm_zip.stat().st_size / 1e6:.1f} MB')
    assert arm_zip.stat().st_size <= test_windows.MEGABYTES * 1e6
    assert arm_zip.name.endswith('-linux_arm64.zip')
    with zipfile.ZipFile(arm_zip) as archive:
        assert 'platforms = ["linux-arm64"]' in archive.read('stipple/blender_manifest.toml').decode()
        listed = json.loads(archive.read('stipple/lib/contents.json'))
        assert listed['platform'] == 'linux-arm64' and list(listed['files']) == ['libstipple.so']
        zig = licences.FROM_ZIG | licences.FROM_ZIG_ON_LINUX
        for name in [folder for folder, _ in licences.COMPILED.values()] + list(zig):
            assert f'stipple/licences/{name}.txt' in archive.namelist()


def test_nothing_is_needed_but_the_c_library(arm_library):
    allowed = {'libc.so.6', 'libm.so.6', 'libpthread.so.0', 'libdl.so.2', 'librt.so.1', 'ld-linux-aarch64.so.1'}
    needed = set(rules.needed(arm_library))
    assert 'libc.so.6' in needed and needed <= allowed
    assert test_self_contained.unfit_names(arm_library) == []
    assert len(test_self_contained.undefined(arm_library)) > 20


def test_functions_of_the_c_library_are_the_ones_called(arm_library):
    # zig brings its own, which round otherwise.
    called = {name for name, _ in test_self_contained.undefined(arm_library)}
    assert {'exp', 'log', 'sin', 'cos', 'expf', 'exp2f', 'memcpy', 'memmove', 'memset'} <= called


def test_only_own_names_are_exported(arm_library, root):
    assert rules.export_violations(arm_library) == []
    assert rules.missing_exports(root / HEADER, arm_library) == []


def test_no_folder_of_the_build_is_inside(arm_library, root):
    assert str(root).encode() not in arm_library.read_bytes()


@pytest.fixture(scope='module')
def works(root, arm_library, run_arm, linux_library, tmp_path_factory):
    """{'x64': folder, 'arm64': folder} in which library_driver.c did its work with either library, and 'x64 plain' and
    'arm64 plain' with the kernels that take one number after another."""
    around = tmp_path_factory.mktemp('driver')
    flags = ['-O1', '-I', root / 'native' / 'include', HERE / 'library_driver.c', '-ldl', '-o']
    subprocess.run(['gcc', '-std=gnu99', *flags, around / 'x64'], check=True)
    zig = root / 'build' / 'package' / 'zig' / 'zig'
    subprocess.run([zig, 'cc', '-target', 'aarch64-linux-gnu.2.28', '-std=gnu99', *flags, around / 'arm64'], check=True)
    folders = {}
    for name, library in (('x64', linux_library), ('arm64', arm_library)):
        for kernels, forced in (('', {}), (' plain', {'STIPPLE_FORCE_TARGET': 'scalar'})):
            folders[name + kernels] = folder = test_windows.scene(around / f'Größe {name}{kernels}')
            call = [around / name, library, folder, folder / 'pixels.raw']
            environment = {**os.environ, **forced}
            started = time.perf_counter()
            result = (subprocess.run(call, capture_output=True, text=True, env=environment) if name == 'x64' else
                      run_arm(*call, env=environment))
            print(f'{name}{kernels}: {time.perf_counter() - started:.2f} s')
            assert result.returncode == 0, (result.stdout, result.stderr[-3000:])
            folders[f'{name}{kernels} said'] = result.stdout.splitlines()
    return folders


@pytest.mark.parametrize('name', [*test_windows.IDENTICAL, 'pixels.raw'])
def test_plain_kernels_give_the_bytes_that_x64_gives(works, name):
    assert (works['arm64 plain'] / name).read_bytes() == (works['x64 plain'] / name).read_bytes()


@pytest.mark.parametrize('name', QUANTISED)
def test_files_of_coarse_steps_have_the_bytes_that_x64_writes(works, name):
    assert (works['arm64'] / name).read_bytes() == (works['x64'] / name).read_bytes()


def numbers_of(file):
    """The names that a PLY's header has, and its numbers, a row for each splat."""
    data = file.read_bytes()
    end = data.index(b'end_header\n') + 11
    names = [line.split()[-1] for line in data[:end].decode().splitlines() if line.startswith('property float ')]
    return names, np.frombuffer(data[end:], np.float32).reshape(-1, len(names))


@pytest.mark.parametrize('name', sorted(set(test_windows.IDENTICAL) - set(QUANTISED) - {MODEL}))
def test_files_hold_what_x64_writes_but_for_rounding(works, name, linux_tool, tmp_path):
    (names, first), (same_names, second) = (
        read_back(linux_tool, works[kind] / name, tmp_path / f'{kind}.ply') for kind in ('x64', 'arm64'))
    assert first.shape == (150, len(names)) and names == same_names and np.ptp(first, axis=0)[:3].min() > 0.1
    print(f'{name}: {np.count_nonzero(first != second)} of {first.size} differ, by {np.abs(first - second).max():.2g}')
    np.testing.assert_allclose(second, first, rtol=0, atol=DECODED_ROUNDING)


def read_back(tool, file, to):
    """The numbers of splats in a file of any format, as the tool of x86-64 reads them."""
    subprocess.run([tool, 'convert', file, to], check=True, capture_output=True)
    return numbers_of(to)


def test_a_model_has_the_tensors_that_x64_writes_but_for_rounding(works):
    (header, first), (same_header, second) = (tensors_of(works[kind] / MODEL) for kind in ('x64', 'arm64'))
    assert same_header == header
    floats = [name for name, values in first.items() if values.dtype == np.float32]
    assert len(floats) > 6 and len(floats) < len(first)
    for name, values in first.items():
        if name in floats:
            np.testing.assert_allclose(second[name], values, rtol=TREE_ROUNDING, atol=TREE_ROUNDING, err_msg=name)
        else:
            assert np.array_equal(second[name], values), name


def tensors_of(file):
    """The header of a file of tensors, and the tensors; what is no float32 as the bytes that it has."""
    data = file.read_bytes()
    start = 8 + int.from_bytes(data[:8], 'little')
    header = json.loads(data[8:start])
    tensors = {}
    for name, entry in header.items():
        if name != '__metadata__':
            begin, end = entry['data_offsets']
            kind = np.float32 if entry['dtype'] == 'F32' else np.uint8
            tensors[name] = np.frombuffer(data[start + begin:start + end], kind)
    return header, tensors


def test_pixels_differ_by_their_last_bits_at_most(works):
    first, second = (np.fromfile(works[name] / 'pixels.raw', np.float32) for name in ('x64', 'arm64'))
    assert first.size > 1000 and np.ptp(first) > 0.1
    print(f'{np.count_nonzero(first != second)} of {first.size} values differ, by {np.abs(first - second).max():.2g}')
    np.testing.assert_allclose(first, second, atol=PIXEL_ROUNDING)


def test_a_fit_comes_to_the_same(works):
    numbers = []
    for name in ('x64', 'arm64'):
        data = (works[name] / 'fitted.ply').read_bytes()
        numbers.append(np.frombuffer(data[data.index(b'end_header\n') + 11:], np.float32))
    print(f'a fit differs by {np.abs(numbers[0] - numbers[1]).max():.2g}')
    np.testing.assert_allclose(*numbers, atol=FIT_ROUNDING)


def test_errors_are_the_same_sentences(works):
    expected = [line.format(works['arm64']) for line in test_windows.SAID]
    # Who may do everything writes what is read-only, too: what is said of it depends on who runs this. An ordinary
    # build reads images by OpenImageIO, which has words of its own.
    expected[1] = works['x64 said'][1].replace(str(works['x64']), str(works['arm64']))
    assert works['arm64 said'] == expected


@pytest.fixture(scope='module')
def tools(arm_tool, run_arm, linux_tool, tmp_path_factory):
    """{processor: run(command)}, each in its own folder, `run.folder`, in which the steps of bare systems were done."""
    def on_x64(command):
        return subprocess.run([linux_tool, *shlex.split(command)], cwd=on_x64.folder, capture_output=True, text=True)

    def on_arm64(command):
        return run_arm(arm_tool, *shlex.split(command), cwd=on_arm64.folder)

    for name, run in (('x64', on_x64), ('arm64', on_arm64)):
        run.folder = test_windows.scene(tmp_path_factory.mktemp(name) / 'work')
        started = time.perf_counter()
        for command in bare_systems.STEPS:
            result = run(command)
            assert result.returncode == 0, (name, command, result.stdout, result.stderr)
        print(f'{name}: {len(bare_systems.STEPS)} commands, {time.perf_counter() - started:.1f} s')
    return {'x64': on_x64, 'arm64': on_arm64}


@pytest.mark.parametrize('name', [*(f'packed.{form}' for form in ('spz', 'sog', 'glb', 'splat', 'usda', 'usdz')),
                                  'surface.ply', 'proxy.glb'])
def test_the_tools_files_have_the_same_bytes(tools, name):
    first, second = ((tools[kind].folder / name).read_bytes() for kind in ('x64', 'arm64'))
    assert len(first) > 500 and first == second


@pytest.mark.parametrize('name', [*(f'images/{view:02}.png' for view in range(bare_systems.VIEWS)), 'picture.exr'])
def test_pictures_differ_by_one_step_at_most(tools, name):
    other = shlex.quote(str(tools['arm64'].folder / name))
    figures = json.loads(tools['x64'](f'compare {name} {other} --json').stdout)
    print(f'{name}: {figures["max_error"]:.2g}')
    assert figures['max_error'] <= PICTURE_STEP


@pytest.mark.parametrize('command', ['info volume.vdb --json', 'info proxy.glb --json', 'formats --json', '--help',
                                     'info packed.sog --json'])
def test_answers_are_the_same(tools, command):
    first, second = (tools[kind](command) for kind in ('x64', 'arm64'))
    assert (first.returncode, second.returncode) == (0, 0), second.stderr
    assert len(first.stdout) > 4 and first.stdout == second.stdout


@pytest.mark.parametrize('command', ['info "nicht da ä.ply"', 'convert truth.ply 日本.xyz', 'info images', 'nonsense'])
def test_refusals_are_the_same_sentences(tools, command):
    first, second = (tools[kind](command) for kind in ('x64', 'arm64'))
    assert first.returncode in (1, 2) and first.returncode == second.returncode
    assert first.stderr == second.stderr


@pytest.mark.parametrize('kernel', ['scalar', 'neon'])
def test_every_kernel_draws_the_same(tools, kernel, run_arm, arm_tool, monkeypatch):
    monkeypatch.setenv('STIPPLE_FORCE_TARGET', kernel)
    result = tools['arm64'](f'render truth.ply --camera transforms.json -o {kernel}.png --colour display')
    assert result.returncode == 0, result.stderr
    other = shlex.quote(str(tools['arm64'].folder / f'{kernel}.png'))
    monkeypatch.delenv('STIPPLE_FORCE_TARGET')
    figures = json.loads(tools['x64'](f'compare images/00.png {other} --json').stdout)
    assert figures['max_error'] <= PICTURE_STEP
