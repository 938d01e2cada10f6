# SPDX-License-Identifier: GPL-3.0-or-later
"""What enabling the add-on costs, once and a hundred times."""

import json
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
# What registering needs of the rooms whose modules are imported late (addon/stipple/late.py): callbacks and handlers,
# and what operators and properties say and offer. Another module here costs everybody who starts Blender.
AT_START = {
    'binding': {'errors'},
    'scene': {'fit.fit_proposal', 'fit.strategies', 'handlers', 'selection_settings', 'source.exporting',
              'source.formats', 'source.mesh_models', 'source.proxies', 'source.setting_paths', 'source.source_paths',
              'source.source_settings', 'source.source_travel', 'source.sync', 'view.photo_cameras', 'view.picking',
              'view.quality', 'view.splat_engines', 'view.steady_effects', 'view.viewed'},
    'viewport': {'drawing', 'selected_points', 'stroke_preparation', 'view_world'},
}
# What an empty file adds, when it is opened, edited, played and saved: whether an object is of splats.
IN_AN_EMPTY_FILE = {'limits', 'source.source_packing', 'source.splat_data'}
# Modules of Python's own that take milliseconds.
SLOW = {'logging', 'shutil', 'statistics', 'subprocess', 'tempfile'}
IMPORTED = '''
import json, os, sys, bpy, numpy
def modules():  # but not packages of the add-on: their modules may all be still to come
    return {{name for name, module in sys.modules.items()
            if not (name.startswith('stipple') and hasattr(module, '__path__'))}}
before = modules()
bpy.ops.preferences.addon_enable(module='stipple')
enabled = modules() - before
bpy.ops.wm.read_homefile(use_factory_startup=True)
bpy.data.objects['Cube'].location.x += 1
bpy.context.view_layer.update()
bpy.context.scene.frame_set(5)
bpy.ops.wm.save_as_mainfile(filepath=os.path.join({folder!r}, 'empty.blend'))
worked = modules() - before
print('IMPORTED', json.dumps([sorted(enabled), sorted(worked)]), flush=True)
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


def line_of(steps, word):
    """The line that begins with a word, of what a fresh Blender says."""
    result = subprocess.run([bpy.app.binary_path, '--background', '--factory-startup', '--python-exit-code', '70',
                             '--python-expr', steps], capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stdout + result.stderr
    return next(line for line in result.stdout.splitlines() if line.startswith(word))


def modules_of(imported, room):
    """Modules of a room by their names in it."""
    start = f'stipple.{room}.'
    return {name[len(start):] for name in imported if name.startswith(start)}


def test_registering_imports_what_it_needs_and_nothing_else(tmp_path):
    line = line_of(IMPORTED.format(folder=str(tmp_path)), 'IMPORTED')
    enabled, worked = (set(names) for names in json.loads(line[len('IMPORTED'):]))
    for room, allowed in AT_START.items():
        assert modules_of(enabled, room) == allowed
        assert modules_of(worked, room) - allowed <= IN_AN_EMPTY_FILE
    assert not SLOW & worked


@linux_only
def test_enabling_loads_no_library(tmp_path):
    line = line_of(MAPS + FRESH, 'STARTED')
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
