#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures what Blender's start waits for, and what the first use of the add-on waits for instead.

    python3 tests/blender/run.py tests/blender/bench_start.py -s

Not a test of the suite: its name keeps it out. Medians of Blenders that each start anew, with modules that Python has
compiled before. NumPy is imported first and stands apart: Blender's own add-ons import it too.
"""

import json
import os
import statistics
import subprocess

import bpy

RUNS = 20
TIMED = '''
import json, sys, time
import bpy
found = {}
def timed(name, action):
    wall, work = time.perf_counter(), time.process_time()
    action()
    found[name] = [time.perf_counter() - wall, time.process_time() - work]
timed('NumPy', lambda: __import__('numpy'))
'''
# Each in a Blender of its own.
STEPS = (
    '''
timed('importing the add-on', lambda: __import__('stipple'))
''', '''
timed('enabling it', lambda: bpy.ops.preferences.addon_enable(module='stipple'))
found['modules'] = sum(name.partition('.')[0] == 'stipple' for name in sys.modules)
timed('opening an empty file after that', lambda: bpy.ops.wm.read_homefile(use_factory_startup=True))
timed('the same again', lambda: bpy.ops.wm.read_homefile(use_factory_startup=True))
timed('the first operator, Splats from Mesh', lambda: bpy.ops.stipple.splats_from_mesh(anchors=1000))
bpy.ops.wm.read_homefile(use_factory_startup=True)
timed('the next', lambda: bpy.ops.stipple.splats_from_mesh(anchors=1000))
scene = bpy.context.scene
scene.render.engine, scene.render.resolution_x, scene.render.resolution_y = 'STIPPLE', 64, 64
timed('the first render by Stipple after that', lambda: bpy.ops.render.render())
timed('the next render', lambda: bpy.ops.render.render())
''')
TARGETS = {'importing the add-on': 0.05}


def measure(steps):
    environment = {name: value for name, value in os.environ.items() if name != 'PYTHONDONTWRITEBYTECODE'}
    result = subprocess.run([bpy.app.binary_path, '--background', '--factory-startup', '--python-exit-code', '70',
                             '--python-expr', TIMED + steps + "print('FOUND', json.dumps(found), flush=True)\n"],
                            env=environment, capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stdout + result.stderr
    return json.loads(next(line for line in result.stdout.splitlines() if line.startswith('FOUND'))[len('FOUND'):])


def test_start():
    print()
    for steps in STEPS:
        measure(steps)  # Python compiles what it has not compiled yet
        runs = [measure(steps) for _ in range(RUNS)]
        for name, value in runs[0].items():
            if name == 'modules':
                print(f'{value} of its modules are imported then')
                continue
            wall, work = (statistics.median(run[name][i] for run in runs) * 1e3 for i in (0, 1))
            target = f', target {TARGETS[name] * 1e3:.0f} ms' if name in TARGETS else ''
            print(f'{name}: {wall:.1f} ms ({work:.1f} ms of processor time){target}', flush=True)
