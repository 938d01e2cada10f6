#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits objects of a collection from nothing, from coarse splats, and from what a trained network makes of those.

    detail_start.py STIPPLE COLLECTION WEIGHTS [--every 12] [--steps 50,100,200,400] [--coarse 1024] [--splats 4096]

COLLECTION: of make_families.py and stipple.collect_for_training; WEIGHTS: detail.safetensors. Of each object that was
held out every eighth image is kept from the network and from all fits, and measured. Coarse splats are a fit of 150
steps. Prints mean PSNR and seconds; those of the network and of the coarse fit are listed by themselves.
"""

import argparse
import json
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

HOLDOUT = 8
COARSE_STEPS = 150


def run(*command):
    """(what a command says, as a dictionary, and its seconds)."""
    begin = time.perf_counter()
    said = subprocess.run([str(part) for part in command], check=True, capture_output=True, text=True).stdout
    return dict(line.split(None, 1) for line in said.splitlines() if ' ' in line), time.perf_counter() - begin


def told(dataset, folder):
    """A data set of the images that are not held out."""
    scene = json.loads((dataset / 'transforms.json').read_text())
    frames = sorted(scene['frames'], key=lambda frame: frame['file_path'])
    scene['frames'] = [{**frame, 'file_path': str((dataset / frame['file_path']).resolve())}
                       for i, frame in enumerate(frames) if i % HOLDOUT]
    scene.pop('ply_file_path', None)
    (folder / 'transforms.json').write_text(json.dumps(scene))
    return folder


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('stipple', type=Path)
    parser.add_argument('collection', type=Path)
    parser.add_argument('weights', type=Path)
    parser.add_argument('--every', type=int, default=12)
    parser.add_argument('--steps', type=lambda text: [int(part) for part in text.split(',')], default=[50, 100, 200, 400])
    parser.add_argument('--coarse', type=int, default=1024)
    parser.add_argument('--splats', type=int, default=4096)
    given = parser.parse_args()
    rows, costs = {}, {'coarse fit': [], 'detail': []}
    objects = sorted(path for path in given.collection.iterdir() if (path / 'transforms.json').exists())
    for dataset in objects[given.every - 1::given.every]:
        with tempfile.TemporaryDirectory() as text:
            folder = Path(text)
            coarse, fine, out = folder / 'coarse.ply', folder / 'fine.ply', folder / 'out.ply'
            fit = given.stipple, 'fit', dataset
            same = '--holdout', HOLDOUT, '--sh-degree', 0, '--strategy', 'adaptive'
            costs['coarse fit'].append(run(*fit, coarse, '--iterations', COARSE_STEPS, '--gaussians', given.coarse,
                                           '--start', given.coarse // 2, *same)[1])
            costs['detail'].append(run(given.stipple, 'detail', coarse, told(dataset, folder), fine, '--weights',
                                       given.weights, '--splats', given.splats)[1])
            starts = {'nothing': ('--start', given.splats // 2), 'coarse splats': ('--start-from', coarse),
                      'detail': ('--start-from', fine)}
            for name, start in starts.items():
                for steps in given.steps:
                    said, seconds = run(*fit, out, '--iterations', steps, '--gaussians', given.splats, *same, *start)
                    rows.setdefault((name, steps), []).append((float(said['held_out_psnr']), seconds))
        print(dataset.name, {f'{name} {steps}': f'{found[-1][0]:.2f}' for (name, steps), found in rows.items()}, flush=True)
    print('| start | ' + ' | '.join(f'{steps} steps' for steps in given.steps) + ' |')
    print('|---|' + '---|' * len(given.steps))
    for name in ('nothing', 'coarse splats', 'detail'):
        cells = ((statistics.mean(value[k] for value in rows[name, steps]) for k in (0, 1)) for steps in given.steps)
        print(f'| {name} | ' + ' | '.join('{:.2f} dB, {:.1f} s'.format(*cell) for cell in cells) + ' |')
    print(', '.join(f'{name} {statistics.mean(seconds):.1f} s' for name, seconds in costs.items()))


if __name__ == '__main__':
    main()
