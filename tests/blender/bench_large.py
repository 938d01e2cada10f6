#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures scans of 3 M and 6 M splats of degree 3, each step in a Blender of its own, and prints a table.

    STIPPLE_BENCH_FOLDER=/somewhere python3 tests/blender/run.py tests/blender/bench_large.py -s [-k '3 and not 6']

Not a test of the suite: its name keeps it out. It takes about 10 GiB on disk, 12 GiB of main memory and a quarter of an
hour. Files that are in the folder already are used again; without a folder they go with the end of the run.
"""

import json
import os
import re
import subprocess
import time
from pathlib import Path

import bpy
import numpy as np
import pytest

import large_steps
import screen

HERE = Path(__file__).resolve().parent
TIMEOUT = 1200
DEGREE = 3
# Splats that are made at a time.
CHUNK = 500_000


def scan(stipple, count):
    """Splats with the sizes, shapes and opacities of a captured scan, on hilly ground of 20 m with balls, in haze.

    Quantiles of a scan of a motorcyclist (150,000 splats): opacity 0.04, 0.17, 0.85 at 10, 50, 90 %; longest axis 1.4 of the
    distance to the sixth neighbour, times e^(0.7 normal); middle axis 0.24 and shortest 0.05 of the longest.
    """
    arrays = stipple.binding.cloud.SplatArrays(
        np.empty((count, 3), np.float32), np.empty((count, 4), np.float32), np.empty((count, 3), np.float32),
        np.empty(count, np.float32), np.empty((count, (DEGREE + 1) ** 2, 3), np.float32))
    random = np.random.default_rng(5)
    for first in range(0, count, CHUNK):
        part = slice(first, min(first + CHUNK, count))
        n = part.stop - part.start
        arrays.positions[part], normal, spread = _places(random, n)
        spacing = np.sqrt(560.0 / count) * spread  # the surfaces have some 560 m^2
        longest = 1.9 * spacing * np.exp(0.7 * random.standard_normal(n))
        share = np.minimum(np.exp(random.standard_normal((n, 2)) * (0.95, 1.05) + np.log((0.24, 0.05))), 1)
        arrays.scales[part] = longest[:, None] * np.stack([np.ones(n), *np.sort(share, axis=1).T[::-1]], -1)
        arrays.rotations[part] = _facing(random, normal)
        faint = np.where(spread > 1, 2.0, 0.0)
        arrays.opacities[part] = np.clip(1 / (1 + np.exp(faint - random.normal(-1.6, 1.9, n))), 0.01, 0.99)
        fall = np.repeat([1.0, 0.12, 0.08, 0.05], [1, 3, 5, 7])
        arrays.sh[part] = random.standard_normal((n, 16, 3), np.float32) * 0.15 * fall[:, None]
        arrays.sh[part, 0] += np.sin(arrays.positions[part] * 1.5) * 0.7
    return arrays


def _places(random, n):
    """Positions [n,3], normals [n,3], and sizes beside those on the ground: 72 % ground, 27 % balls, 1 % haze."""
    kind = random.random(n)[:, None]
    flat = random.uniform(-10, 10, (n, 2))
    ground = np.stack([*flat.T, 0.4 * np.sin(flat[:, 0]) * np.cos(0.8 * flat[:, 1])], -1)
    slope = np.stack([-0.4 * np.cos(flat[:, 0]) * np.cos(0.8 * flat[:, 1]),
                      0.32 * np.sin(flat[:, 0]) * np.sin(0.8 * flat[:, 1]), np.ones(n)], -1)
    direction = random.standard_normal((n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    balls = np.float64([(-4, 2, 1.6), (3, 4, 2.2), (5, -2, 1.0), (-1, -3, 0.8), (-6, -5, 1.2)])
    ball = balls[random.integers(len(balls), size=n)]
    on_ball = ball * (1, 1, 1) + direction * (0.2 + ball[:, 2:])
    haze = random.uniform((-10, -10, 0), (10, 10, 5), (n, 3))
    positions = np.where(kind < 0.72, ground, np.where(kind < 0.99, on_ball, haze))
    normals = np.where(kind < 0.72, slope / np.linalg.norm(slope, axis=1, keepdims=True), direction)
    return positions, normals, np.where(kind[:, 0] < 0.99, 1.0, 2.0)


def _facing(random, normals):
    """Rotations w,x,y,z [n,4] that turn the shortest axis, z, along the normals, and anything about them."""
    half = np.concatenate([1 + normals[:, 2:], -normals[:, 1:2], normals[:, :1], np.zeros((len(normals), 1))], 1)
    half[np.linalg.norm(half, axis=1) < 1e-6] = (0, 1, 0, 0)
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    angle = random.uniform(0, np.pi, len(normals))
    w, x, y, z = half.T
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s], -1)


def run(folder, name, step, again=(), **arguments):
    """Runs a step of large_steps.py unless what it makes is there; returns its results, with the process's own peak."""
    result, given = folder / f'{name}.json', folder / f'{name}_arguments.json'
    if result.exists() and all(Path(path).exists() for path in again):
        return json.loads(result.read_text())
    given.write_text(json.dumps(arguments))
    if step == 'window':
        screen_folder = folder / f'{name}_screen'
        screen_folder.mkdir()
        screen.run_steps(Path(large_steps.__file__), screen_folder, bpy.app.binary_path, TIMEOUT, large_steps.SIZE,
                         [str(result), str(given)])
    else:
        wait([bpy.app.binary_path, '--background', '--factory-startup', '--python-exit-code', '70', '--python',
              str(HERE / 'large_steps.py'), '--', step, str(result), str(given)])
    print(f'{name}: {json.loads(result.read_text())}', flush=True)
    return json.loads(result.read_text())


def animate(folder, name, blend, engine):
    """What `blender -b FILE -E ENGINE -a` takes, start and reading included, and each frame."""
    result = folder / f'{name}.json'
    if result.exists():
        return json.loads(result.read_text())
    begin = time.perf_counter()
    text, work, peak = wait([bpy.app.binary_path, '--background', '--factory-startup', '--addons', 'stipple', blend, '-E', engine,
                       '-o', str(folder / f'{name}_####'), '-s', '1', '-e', str(large_steps.FRAMES), '-a'])
    seconds = time.perf_counter() - begin
    times = [60 * float(m) + float(s) for m, s in re.findall(r'^ ?Time: (\d+):([\d.]+) \(Saving', text, re.MULTILINE)]
    assert len(times) == large_steps.FRAMES, text
    values = {': all frames': (seconds, work, peak), 'frames': times}
    result.write_text(json.dumps(values))
    print(f'{name}: {values}', flush=True)
    return json.loads(result.read_text())


def wait(command):
    """(what a command has written, its processor seconds, MiB that it had at most); it must succeed."""
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        text = process.stdout.read()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0, text
    return text, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


@pytest.mark.parametrize('millions', (3, 6))
def test_scan(stipple, tmp_path, millions):
    folder = Path(os.environ.get('STIPPLE_BENCH_FOLDER', tmp_path)) / f'{millions}m'
    folder.mkdir(parents=True, exist_ok=True)
    cloud, blend, reduced = (str(folder / name) for name in ('scan.ply', 'scan.blend', 'budget.blend'))
    if not Path(cloud).exists():
        stipple.binding.cloud.Cloud.create(stipple.scene.sources.context(), scan(stipple, millions * 1_000_000)).save(cloud)
    load = os.getloadavg()[0]
    imported = run(folder, 'import', 'import', (blend,), cloud=cloud, blend=blend)
    tree = run(folder, 'budget', 'budget', (reduced,), blend=blend, reduced=reduced)
    views = {name: run(folder, f'view_{name}', 'window', blend=file, all_ellipses=every)
             for name, file, every in (('points', blend, False), ('ellipses', blend, True), ('budget', reduced, False))}
    renders = {name: run(folder, f'render_{name}', 'render', blend=file, engine=engine, with_splats=name != 'cycles')
               for name, file, engine in (('stipple', blend, 'STIPPLE'), ('budget', reduced, 'STIPPLE'),
                                          ('both', blend, 'STIPPLE_CYCLES'), ('cycles', blend, 'CYCLES'))}
    series = {engine: animate(folder, f'series_{engine}', blend, engine) for engine in ('STIPPLE', 'STIPPLE_CYCLES')}
    print(f'\n{millions} M, load {load:.1f} before and {os.getloadavg()[0]:.1f} after', flush=True)
    print(table(Path(cloud).stat().st_size, imported, tree, views, renders, series))


def table(size, imported, tree, views, renders, series):
    """Markdown, one line a measurement."""
    lines = ['| | seconds | of the processors | main memory at most | of the file |', '|---|---:|---:|---:|---:|']

    def add(what, seconds, work, peak):
        lines.append(f'| {what} | {seconds:.2f} | {work:.2f} | {peak / 1024:.1f} GiB | {peak * 2**20 / size:.1f} |')

    for where, values in (('', imported), ('', tree), *((f'{name}: ', view) for name, view in views.items()),
                          *((f'F12 {name}: ', render) for name, render in renders.items()), *series.items()):
        for name, value in values.items():
            if isinstance(value, list) and len(value) == 3:
                add(where + name, *value)
    lines.append(f'| splat file, .blend with all, .blend with the budget, MiB | {size / 2**20:.0f} '
                 f'| {imported["file"] / 2**20:.0f} | {tree["file"] / 2**20:.0f} | |')
    return '\n'.join(lines)
