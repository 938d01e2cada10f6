#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits a clip as one model that moves, as chunks of such models, and as key frames of anchors, and prints what each
brings.

    compare_relay.py STIPPLE FOLDER [--scenes walker,crossing] [--seeds 1] [--iterations 6000] [--spacing 0.5]
        [--anchors 6000] [--start 0] [--arms "chunks;linear"] [--stretch 48] [--table]

FOLDER holds a folder of make_moving.py for each scene, and relay.jsonl: a line for each fit that is done, from which a
run goes on. Judged are cameras that no fit learns from. Every arm takes the same steps in all: chunks share them. The
models that move may have as many splats as anchors become at most. A part is a chunk, a key frame, or the one model.
"""

import argparse
import math
import os
import statistics
from pathlib import Path

from compare_moving import Judge, fit
from compare_strategies import Results
from make_scene import Context, DecodeSettings, Model, library

SPLATS_PER_ANCHOR = 10
FRAME_RATE = 24
ARMS = {'one model': None, 'chunks': None,
        'no blending': ['--key-frame-blend', 'none', '--no-growth-by-level'],
        'linear': ['--key-frame-blend', 'linear', '--no-growth-by-level'],
        'learned': ['--no-growth-by-level'], 'levels': []}
FIGURES = {'psnr': ('{:.2f}', 'PSNR'), 'ssim': ('{:.4f}', 'SSIM'), 'masked_psnr': ('{:.2f}', 'masked PSNR'),
           'flicker': ('{:.3f}', 'flicker'), 'flow': ('{:.3f}', 'flow'),
           'masked_flow': ('{:.3f}', 'masked flow'), 'splats': ('{:,.0f}', 'splats at once'),
           'bytes_of_part': ('{:,.0f}', 'bytes of a part'), 'frame_seconds': ('{:.3f}', 'seconds of a frame'),
           'megabytes': ('{:,.0f}', 'peak of training, MiB'),
           'processor_seconds': ('{:,.0f}', 'processor seconds')}


class Whole:
    """One model at any time."""

    def __init__(self, context, path):
        self._model = Model.load(context, path)
        self._count = self._model.settings().maximum_budget

    def at(self, seconds):
        return self._model.decode(DecodeSettings(self._count, time=seconds))


class Chunks:
    """Models of spans of time, each from its first frame on."""

    def __init__(self, context, paths, starts):
        self._parts = [Whole(context, path) for path in paths]
        self._starts = starts

    def at(self, seconds):
        number = max(i for i, start in enumerate(self._starts) if start <= seconds + 1e-9)
        return self._parts[number].at(seconds)


def frames_of(folder):
    return len(list((folder / 'cam00').glob('*.png')))


def parts_of(folder, spacing):
    """How many chunks, or key frames, a clip has."""
    return max(1, math.ceil((frames_of(folder) - 1) / round(spacing * FRAME_RATE)))


def measure(context, judge, given, scene, arm, seed):
    dataset, result = given.folder / scene, given.folder / f'{scene}.relay.stipple.safetensors'
    shared = {'dataset': dataset, 'iterations': given.iterations, 'seed': seed}
    most = ['--max-splats', SPLATS_PER_ANCHOR * given.anchors]
    if arm == 'one model':
        costs = fit(given.stipple, result=result, options=['--model', 'motion', *most], **shared)
        clip, size = Whole(context, result), result.stat().st_size
    elif arm == 'chunks':
        every = round(given.spacing * FRAME_RATE)
        starts = [number * every for number in range(parts_of(dataset, given.spacing))]
        paths, all_costs = [], []
        for number, start in enumerate(starts):
            last = frames_of(dataset) - 1 if number + 1 == len(starts) else start + every
            path = given.folder / f'{scene}.chunk{number}.stipple.safetensors'
            all_costs.append(fit(given.stipple, result=path, options=[
                '--model', 'motion', *most, '--frames', f'{start}:{last}'],
                **{**shared, 'iterations': given.iterations // len(starts)}))
            paths.append(path)
        costs = {key: (max if key == 'megabytes' else sum)(row[key] for row in all_costs) for key in all_costs[0]}
        clip = Chunks(context, paths, [start / FRAME_RATE for start in starts])
        size = sum(path.stat().st_size for path in paths)
    else:
        costs = fit(given.stipple, result=result, options=[
            '--model', 'relay', '--max-anchors', given.anchors, '--start-splats', given.start, '--key-frame-spacing',
            given.spacing, *ARMS[arm]],
            **shared)
        clip, size = Whole(context, result), result.stat().st_size
    parts = 1 if arm == 'one model' else parts_of(dataset, given.spacing)
    return {'scene': scene, 'arm': arm, 'seed': seed, 'iterations': given.iterations, 'anchors': given.anchors,
            'start': given.start, 'spacing': given.spacing, **judge.of(clip.at, FRAME_RATE), **costs, 'bytes': size, 'bytes_of_part': size / parts,
            'load': os.getloadavg()[0]}


def table(results, given):
    lines = ['| scene | | ' + ' | '.join(name for _, name in FIGURES.values()) + ' |', '|---|---|' + '---|' * len(FIGURES)]
    for scene in given.scenes:
        for arm in ARMS:
            rows = results.find(scene=scene, arm=arm, iterations=given.iterations, anchors=given.anchors,
                                start=given.start, spacing=given.spacing)
            if rows:
                cells = (form.format(statistics.mean(row[key] for row in rows)) if all(key in row for row in rows)
                         else '–' for key, (form, _) in FIGURES.items())
                lines.append(f'| {scene} | {arm} | ' + ' | '.join(cells) + ' |')
    return '\n'.join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('stipple', type=Path)
    parser.add_argument('folder', type=Path)
    parser.add_argument('--scenes', type=lambda text: text.split(','), default=['walker'])
    parser.add_argument('--arms', type=lambda text: text.split(';'), default=list(ARMS))
    parser.add_argument('--seeds', type=int, default=1)
    parser.add_argument('--iterations', type=int, default=6000)
    parser.add_argument('--anchors', type=int, default=6000)
    parser.add_argument('--start', type=int, default=0, help='anchors that a relay begins with; 0: as many as there may be')
    parser.add_argument('--spacing', type=float, default=0.5)
    parser.add_argument('--stretch', type=int, default=0, help='frames after which another camera judges; 0: all do')
    parser.add_argument('--table', action='store_true', help='print what is there, and fit nothing')
    given = parser.parse_args()
    results = Results(given.folder / 'relay.jsonl')
    if not given.table:
        context = Context(library.load(given.stipple.resolve().parents[1] / 'lib' / 'libstipple.so'))
        for seed in range(given.seeds):
            for scene in given.scenes:
                judge = Judge(context, given.folder / scene, given.stretch)
                for arm in given.arms:
                    if results.find(scene=scene, arm=arm, seed=seed, iterations=given.iterations,
                                    anchors=given.anchors, start=given.start, spacing=given.spacing):
                        continue
                    row = measure(context, judge, given, scene, arm, seed)
                    results.add(row)
                    print(f'{scene}, {arm}, seed {seed}: {row["psnr"]:.2f} dB, {row["masked_psnr"]:.2f} dB masked, flicker '
                          f'{row["flicker"]:.3f}, {row["bytes"]:,} bytes, {row["seconds"]:.0f} s', flush=True)
    print(table(results, given))


if __name__ == '__main__':
    main()
