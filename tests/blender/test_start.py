# SPDX-License-Identifier: GPL-3.0-or-later
"""What enabling the add-on costs, once and a hundred times."""

import subprocess
import sys
from pathlib import Path

import addon_utils
import bpy
import pytest

ROUNDS = 100
# Of the first rounds the allocator and Blender keep something; a round that keeps 50 KB is a leak.
FIRST_ROUNDS = 20
ALLOWED_KIB = (ROUNDS - FIRST_ROUNDS) * 50

FRESH = '''
import time, bpy, addon_utils, numpy
start, work = time.perf_counter(), time.process_time()
addon_utils.enable('stipple')
took = time.perf_counter() - start, time.process_time() - work
print('STARTED %.0f ms, %.0f ms of processor time' % (took[0] * 1e3, took[1] * 1e3), 'libstipple' in maps(), flush=True)
'''
MAPS = "def maps():\n    return open('/proc/self/maps').read()\n"

linux_only = pytest.mark.skipif(not sys.platform.startswith('linux'), reason='/proc tells what is loaded')


def loaded():
    """The files of the library that are in memory."""
    return {line.split()[-1] for line in Path('/proc/self/maps').read_text().splitlines()
            if 'libstipple.so' in line}


def resident_kib():
    for line in Path('/proc/self/status').read_text().splitlines():
        if line.startswith('VmRSS:'):
            return int(line.split()[1])
    raise AssertionError('/proc/self/status has no VmRSS')


def make_splats(anchors):
    bpy.ops.mesh.primitive_cube_add()
    assert bpy.ops.stipple.splats_from_mesh(anchors=anchors) == {'FINISHED'}


@linux_only
def test_enabling_loads_no_library(tmp_path):
    result = subprocess.run([bpy.app.binary_path, '--background', '--factory-startup', '--python-exit-code', '70',
                             '--python-expr', MAPS + FRESH], capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stdout + result.stderr
    line = next(line for line in result.stdout.splitlines() if line.startswith('STARTED'))
    print(line)
    assert line.endswith(' False'), line


@linux_only
def test_a_hundred_times_off_and_on_keep_one_library_and_its_memory(stipple):
    name = stipple.__name__
    make_splats(200)
    files = loaded()
    assert len(files) == 1
    for i in range(ROUNDS):
        addon_utils.disable(name)
        addon_utils.enable(name)
        if i + 1 == FIRST_ROUNDS:
            before = resident_kib()
    grown = resident_kib() - before
    print(f'{ROUNDS - FIRST_ROUNDS} times off and on: {grown} KiB more')
    assert loaded() == files
    assert grown < ALLOWED_KIB
    make_splats(300)
