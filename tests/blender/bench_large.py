#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures scans of 3 M and 6 M splats of degree 3, each step in a Blender of its own, and prints a table.

    STIPPLE_BENCH_FOLDER=/somewhere python3 tests/blender/run.py tests/blender/bench_large.py -s [-k 3]

Not a test of the suite: its name keeps it out. It takes 8 GiB on disk and 9 GiB of main memory. Clouds and results that
are in the folder already are used again, so remove the folder for new ones; without a folder all go with the end of the
run.
"""

import json
import os
import re
import shutil
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

    Quantiles of a scan of a motorcyclist (150,000 splats): opacity 0.04, 0.17, 0.85 at 10, 50, 90 %; longest axis 1.4
    of the distance to the sixth neighbour, times e^(0.7 normal); middle axis 0.24 and shortest 0.05 of the longest.
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


def run(folder, name, step, makes=(), **arguments):
    """Runs a step of large_steps.py, unless its results and what it makes are there already."""
    result, given = folder / f'{name}.json', folder / f'{name}_arguments.json'
    if result.exists() and all(Path(path).exists() for path in makes):
        return
    given.write_text(json.dumps(arguments))
    if step == 'window':
        screen_folder = folder / f'{name}_screen'
        shutil.rmtree(screen_folder, ignore_errors=True)
        screen_folder.mkdir()
        screen.run_steps(Path(large_steps.__file__), screen_folder, bpy.app.binary_path, TIMEOUT, large_steps.SIZE,
                         [str(result), str(given)])
    else:
        wait([bpy.app.binary_path, '--background', '--factory-startup', '--python-exit-code', '70', '--python',
              str(HERE / 'large_steps.py'), '--', step, str(result), str(given)])
    print(f'{name}: {result.read_text()}', flush=True)


def animate(folder, name, blend, engine):
    """What `blender -b FILE -E ENGINE -a` takes, start and reading included, and each frame."""
    result = folder / f'{name}.json'
    if result.exists():
        return
    begin = time.perf_counter()
    text, work, peak = wait([bpy.app.binary_path, '--background', '--factory-startup', '--addons', 'stipple', blend,
                             '-E', engine,
                       '-o', str(folder / f'{name}_####'), '-s', '1', '-e', str(large_steps.FRAMES), '-a'])
    seconds = time.perf_counter() - begin
    times = [60 * float(m) + float(s) for m, s in re.findall(r'^ ?Time: (\d+):([\d.]+) \(Saving', text, re.MULTILINE)]
    assert len(times) == large_steps.FRAMES, text
    values = {'all': (seconds, work, peak), 'frames': times}
    result.write_text(json.dumps(values))
    print(f'{name}: {values}', flush=True)


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
        stipple.binding.cloud.Cloud.create(stipple.scene.source.sources.context(),
                                           scan(stipple, millions * 1_000_000)).save(cloud)
    load = os.getloadavg()[0]
    run(folder, 'import', 'import', (blend,), cloud=cloud, blend=blend)
    run(folder, 'budget', 'budget', (reduced,), blend=blend, reduced=reduced)
    for name, file, every in (('points', blend, False), ('ellipses', blend, True), ('budget', reduced, False)):
        run(folder, f'view_{name}', 'window', blend=file, all_ellipses=every)
    for name, file, engine in (('stipple', blend, 'STIPPLE'), ('budget', reduced, 'STIPPLE'),
                               ('both', blend, 'STIPPLE_CYCLES'), ('cycles', blend, 'CYCLES')):
        run(folder, f'render_{name}', 'render', blend=file, engine=engine, with_splats=name != 'cycles')
    for engine in ('STIPPLE', 'STIPPLE_CYCLES'):
        animate(folder, f'series_{engine}', blend, engine)
    print(f'\n{millions} M, load {load:.1f} before and {os.getloadavg()[0]:.1f} after', flush=True)
    print(table(sorted(folder.parent.glob('*m'))))


# What the table shows: words, file of results, name in it.
ROWS = (
    ('import', 'import', 'import'), ('save', 'import', 'save'), ('Add Budget', 'budget', 'tree'),
    ('open the file in a window', 'view_points', 'open'), ('first view, points', 'view_points', 'first view'),
    ('first view, ellipses', 'view_ellipses', 'first view'), ('turned view, ellipses', 'view_ellipses', 'turned view'),
    ('first view of 500,000 by budget, ellipses', 'view_budget', 'first view'),
    ('slider, first move', 'view_budget', 'slider begins'), ('slider, each further move', 'view_budget', 'slider'),
    ('redraw of a move', 'view_budget', 'slider drawn'), ('slider rests', 'view_budget', 'slider rests'),
    ('Rendered shading by Stipple, first coarse picture', 'view_points', 'rendered view'),
    ('the fine one after it', 'view_points', 'fine view'), ('F12, Stipple', 'render_stipple', 'first'),
    ('F12, Stipple, all splats by budget', 'render_budget', 'first'), ('F12, Cycles + Stipple', 'render_both', 'first'),
    ('F12, Cycles without the splats', 'render_cycles', 'first'),
    ('ten frames of `-b -a`, Stipple', 'series_STIPPLE', 'all'),
    ('ten frames of `-b -a`, Cycles + Stipple', 'series_STIPPLE_CYCLES', 'all'))


def table(folders):
    """Markdown: seconds, processor seconds of all threads, GiB of main memory at most; two columns for each folder."""
    found = [{path.stem: json.loads(path.read_text()) for path in folder.glob('*.json')} for folder in folders]
    lines = ['| | ' + ' | '.join(f'{folder.name}: s (of processors) | GiB' for folder in folders) + ' |',
             '|---|' + '---:|---:|' * len(folders)]
    for words, file, name in ROWS:
        cells = []
        for results in found:
            seconds, work, peak = results.get(file, {}).get(name, (None, None, None))
            cells.append('| ' if seconds is None else f'{seconds:.2f} ({work:.2f}) | {peak / 1024:.1f}')
        lines.append(f'| {words} | ' + ' | '.join(cells) + ' |')
    for words, path in (('splat file', 'scan.ply'), ('.blend with all splats', 'scan.blend'),
                        ('.blend with a budget of 500,000', 'budget.blend')):
        sizes = [folder / path for folder in folders]
        lines.append(f'| {words} | ' + ' | '.join(
            f'{size.stat().st_size / 2**20:,.0f} MiB | ' if size.exists() else '| ' for size in sizes) + ' |')
    return '\n'.join(lines)
