#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the libraries of a release in Debian suites that have a C library and no more: loads them, decodes, fits 20
steps, renders, and writes and reads every kind of file. Needs root; not a test of the suite.

    bare_systems.py [--folder build/bare] [--libraries build/portable] [bullseye bookworm trixie sid]
"""

import argparse
import json
import math
import random
import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SUITES = ('bullseye', 'bookworm', 'trixie', 'sid')
MIRROR = 'http://deb.debian.org/debian'
VIEWS = 8
# What a bare system must be able to do: a line each, with the tool beside the library of the release.
STEPS = (
    'info truth.ply',
    *(f'render truth.ply --camera transforms.json --view {i} --colour display -o images/{i:02}.png'
      for i in range(VIEWS)),
    'render truth.ply --camera transforms.json -o picture.exr',
    'fit . fitted.ply --iterations 20 --gaussians 300 --sh-degree 0',
    'fit . model.stipple.safetensors --model field --iterations 20 --max-anchors 2048',
    'decode model.stipple.safetensors many.ply --anchors 1500',
    'render many.ply --camera transforms.json -o many.png',
    'compare images/00.png many.png',
    'voxelize truth.ply volume.vdb --resolution 48',
    'info volume.vdb',
    'mesh truth.ply proxy.glb --resolution 48 --threshold 0.05',
    'decode proxy.glb surface.ply --anchors 500',
    *(f'convert truth.ply packed.{form}' for form in ('spz', 'sog', 'glb', 'splat', 'usda', 'usdz')),
    *(f'info packed.{form}' for form in ('spz', 'sog', 'glb', 'splat', 'usda', 'usdz')),
)


def make_scene(folder):
    """Splats in a ball, and cameras on a ring around it."""
    numbers = random.Random(7)
    names = ['x', 'y', 'z', 'f_dc_0', 'f_dc_1', 'f_dc_2', 'opacity', 'scale_0', 'scale_1', 'scale_2', 'rot_0', 'rot_1',
             'rot_2', 'rot_3']
    rows = []
    while len(rows) < 400:
        at = [numbers.uniform(-1, 1) for _ in range(3)]
        if sum(x * x for x in at) < 1:
            rows.append(at + [numbers.uniform(-1, 1) for _ in range(3)] + [2.0, -2.0, -2.0, -2.3, 1.0, 0.0, 0.0, 0.0])
    head = ['ply', 'format ascii 1.0', f'element vertex {len(rows)}', *(f'property float {name}' for name in names)]
    body = [' '.join(map(str, row)) for row in rows]
    (folder / 'truth.ply').write_text('\n'.join([*head, 'end_header', *body]) + '\n')
    frames = []
    for i in range(VIEWS):
        c, s = math.cos(math.tau * i / VIEWS), math.sin(math.tau * i / VIEWS)
        frames.append({'file_path': f'images/{i:02}.png', 'transform_matrix': [
            [c, 0, s, 4 * s], [0, 1, 0, 0], [-s, 0, c, 4 * c], [0, 0, 0, 1]]})
    camera = {'camera_angle_x': 0.7, 'w': 64, 'h': 48, 'fl_x': 88, 'fl_y': 88, 'cx': 32, 'cy': 24, 'frames': frames}
    (folder / 'transforms.json').write_text(json.dumps(camera))
    (folder / 'images').mkdir()


def run_inside(root, command):
    """A command in a bare system, which has /proc for as long as it runs."""
    script = 'mount -t proc proc "$1/proc" && exec chroot "$1" env -i PATH=/usr/bin:/bin sh -c "$2"'
    return subprocess.run(['unshare', '--mount', 'sh', '-c', script, 'sh', root, command], capture_output=True,
                          text=True, timeout=600)


def prove(suite, folder, libraries):
    root = folder / suite
    if not (root / 'usr' / 'bin' / 'ldd').is_file():
        subprocess.run(['debootstrap', '--variant=minbase', suite, root, MIRROR], check=True, stdout=subprocess.DEVNULL)
    work = root / 'stipple'
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir()
    for part in ('bin', 'lib'):
        shutil.copytree(libraries / part, work / part)
    make_scene(work)
    c_library = run_inside(root, 'ldd --version').stdout.splitlines()[0].split()[-1]
    for step in STEPS:
        started = time.perf_counter()
        result = run_inside(root, f'cd /stipple && bin/stipple {step}')
        if result.returncode != 0:
            print(f'{suite} (glibc {c_library}): stipple {step}\n{result.stdout}{result.stderr}', file=sys.stderr)
            return False
        if step.startswith(('fit', 'voxelize', 'decode model')):
            print(f'{suite}: {step.split(" --")[0]}: {time.perf_counter() - started:.2f} s')
    print(f'{suite} (glibc {c_library}): {len(STEPS)} commands ran')
    return True


def main():
    parser = argparse.ArgumentParser(description="Run a release's libraries where there is a C library alone.")
    parser.add_argument('suites', nargs='*', default=SUITES)
    parser.add_argument('--folder', type=Path, default=ROOT / 'build' / 'bare')
    parser.add_argument('--libraries', type=Path, default=ROOT / 'build' / 'portable')
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    results = [prove(suite, arguments.folder.resolve(), arguments.libraries.resolve()) for suite in arguments.suites]
    return 0 if all(results) else 1


if __name__ == '__main__':
    sys.exit(main())
