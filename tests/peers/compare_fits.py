#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits one data set with OpenSplat and with Stipple, for as many iterations, and prints time and held-out PSNR and SSIM.

    compare_fits.py OPENSPLAT STIPPLE DATASET [ITERATIONS ...]

Every eighth view by name is held out of both. Both results are drawn by `stipple render`, and compared with the
photographs in their 8 bits. Seconds an iteration are what the longest run takes more than the shortest, over the
iterations between; for them Stipple runs once more with no more splats than the peer has (Level).
"""

import json
import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from make_scene import Context, Image, library
from stipple.binding.gradients import image_loss

HOLDOUT = 8
ITERATIONS = (200, 500)
GOAL, AIM = 25, 40     # times as fast, an iteration
QUALITY_SECONDS = 15   # in which the peer's last PSNR is to be reached


def split(dataset, folder):
    """Writes transforms.json of training and of held-out views, in folders of their own; returns both."""
    scene = json.loads((dataset / 'transforms.json').read_text())
    frames = sorted(scene['frames'], key=lambda frame: frame['file_path'])
    parts = {}
    for part, chosen in (('training', [f for i, f in enumerate(frames) if i % HOLDOUT]),
                         ('held_out', frames[::HOLDOUT])):
        parts[part] = folder / part
        parts[part].mkdir()
        files = [frame['file_path'] for frame in chosen]
        if 'ply_file_path' in scene:
            files.append(scene['ply_file_path'])
        for file in files:
            link = parts[part] / file
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to((dataset / file).resolve())
        (parts[part] / 'transforms.json').write_text(json.dumps({**scene, 'frames': chosen}))
    return parts['training'], parts['held_out']


def run(*command):
    """Seconds of a program."""
    start = time.perf_counter()
    subprocess.run([str(part) for part in command], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


def pixels(context, path):
    """[H,W,3] as the file has them, alpha left out."""
    return Image.load(context, path).read()[..., :3]


def judge(stipple, context, splats, held_out, folder):
    """Mean PSNR over the held-out views, dB, and mean SSIM."""
    frames = json.loads((held_out / 'transforms.json').read_text())['frames']
    psnr, ssim = [], []
    for view, frame in enumerate(frames):
        picture = folder / 'picture.png'
        run(stipple, 'render', splats, '--camera', held_out / 'transforms.json', '--view', view, '--background',
            '0', '0', '0', '-o', picture)
        drawn, photo = pixels(context, picture), pixels(context, held_out / frame['file_path'])
        psnr.append(-10 * math.log10(np.mean((drawn - photo).astype(np.float64) ** 2)))
        ssim.append(image_loss(context, drawn, photo, with_gradient=False)[2])
    return np.mean(psnr), np.mean(ssim)


def fit_peer(program, training, iterations, result):
    return run(program, training, '--cpu', '--keep-crs', '--num-downscales', '0', '-n', iterations, '-o', result)


def fit_ours(program, dataset, iterations, result, *most):
    return run(program, 'fit', dataset, result, '--iterations', iterations, '--holdout', HOLDOUT,
               '--strategy', 'adaptive', *most)  # which is what the peer does


def splat_count(path):
    """Of a PLY file."""
    with path.open('rb') as file:
        return next(int(line.split()[2]) for line in file if line.startswith(b'element vertex'))


def main():
    opensplat, stipple, dataset, *counts = sys.argv[1:]
    dataset = Path(dataset)
    counts = sorted(int(count) for count in counts) or ITERATIONS
    context = Context(library.load(Path(stipple).resolve().parents[1] / 'lib' / 'libstipple.so'))
    seconds, psnr, ssim = {}, {}, {}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        training, held_out = split(dataset, folder)
        most = {}  # splats of the peer
        fits = {'OpenSplat': lambda count, to: fit_peer(opensplat, training, count, to),
                'Stipple': lambda count, to: fit_ours(stipple, dataset, count, to),
                'Level': lambda count, to: fit_ours(stipple, dataset, count, to, '--gaussians', most[count])}
        for name, fit in fits.items():
            for count in counts:
                result = folder / f'{name}_{count}.ply'
                seconds[name, count] = fit(count, result)
                psnr[name, count], ssim[name, count] = judge(stipple, context, result, held_out, folder)
                if name == 'OpenSplat':
                    most[count] = splat_count(result)
                print(f'{name:9} {count:5} iterations: {seconds[name, count]:7.1f} s, held out '
                      f'{psnr[name, count]:.2f} dB, SSIM {ssim[name, count]:.4f}, {splat_count(result)} splats',
                      flush=True)
    if len(counts) > 1:
        step = {name: (seconds[name, counts[-1]] - seconds[name, counts[0]]) / (counts[-1] - counts[0])
                for name in fits}
        print(f"An iteration at equal count: Stipple {1e3 * step['Level']:.1f} ms, OpenSplat "
              f"{1e3 * step['OpenSplat']:.1f} ms: {step['OpenSplat'] / step['Level']:.0f} times as fast; goal {GOAL}, "
              f"aim {AIM}")
    for count in counts:
        print(f"PSNR at {count}: {psnr['Stipple', count] - psnr['OpenSplat', count]:+.2f} dB; goal: not lower")
    print(f"{counts[-1]} iterations: {seconds['Stipple', counts[-1]]:.1f} s; goal: the peer's PSNR in less than "
          f'{QUALITY_SECONDS} s')


if __name__ == '__main__':
    main()
