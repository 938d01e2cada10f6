#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits scenes in which something moves by the parts of the strategy temporal, and prints what each brings.

    compare_moving.py STIPPLE FOLDER [--scenes walker,crossing] [--seeds 3] [--iterations 6000] [--most 60000] [--table]

FOLDER holds a folder of make_moving.py for each scene, and moving.jsonl: a line for each fit that is done, from which
a run goes on.

What is compared: the same code with all three parts off, with one more at a time, and once more with all off and a
threshold that makes it grow as many splats as all three do, unless it has as many anyway. The cameras that judge are
those that the data set holds out: no fit learns from them, and its best state is chosen by others. Masked values are of
the pixels in which something moves (moving/). Flicker is the mean change from one frame to the next that the truth does
not have, over the truth's. Flow is how far the optical flow from one render to the next is from that of the truth, in
pixels, on the mean over all pixels and over those in which something moves; it is measured where OpenCV is
(python3-opencv).
"""

import argparse
import math
import os
import shutil
import statistics
import subprocess
import time
from pathlib import Path

import numpy as np

try:
    import cv2
except ModuleNotFoundError:
    cv2 = None
from compare_strategies import Results
from make_scene import Context, DecodeSettings, Model, Renderer, Views, library

from stipple.binding.gradients import image_loss
from stipple.binding.structs import OutputColour

OFF = 'weighted=0,by_lifespan=0,stretched=0'
ARMS = {'off': f'temporal({OFF})', 'score': 'temporal(by_lifespan=0,stretched=0)',
        'score, threshold': 'temporal(stretched=0)', 'all three': 'temporal', 'off, as many': None}
SCENES = 'crossing', 'walker', 'appearing'
THRESHOLD = 2e-4
LIKENESS = 0.05       # of the counts of splats
MOST_TRIES = 3
LEAST_MOVING = 20     # pixels of a frame that are judged alone
FIGURES = {'psnr': ('{:.2f}', 'PSNR'), 'masked_psnr': ('{:.2f}', 'masked PSNR'), 'ssim': ('{:.4f}', 'SSIM'),
           'masked_ssim': ('{:.4f}', 'masked SSIM'), 'flicker': ('{:.3f}', 'flicker'),
           'splats': ('{:,.0f}', 'splats'), 'processor_seconds': ('{:,.0f}', 'processor seconds')}


def costs_of(command):
    """Seconds, processor seconds and the peak of memory of a program."""
    start = time.perf_counter()
    process = subprocess.Popen([str(part) for part in command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    message = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        raise RuntimeError(f'{" ".join(str(part) for part in command)}: {message.decode()}')
    return {'seconds': time.perf_counter() - start, 'processor_seconds': usage.ru_utime + usage.ru_stime,
            'megabytes': usage.ru_maxrss / 1024}


def fit(stipple, dataset, result, options, iterations, seed):
    """What one fit costs."""
    for left in result.parent.glob(result.name + '.checkpoint*'):  # of a run that was stopped
        shutil.rmtree(left) if left.is_dir() else left.unlink()
    return costs_of([stipple, 'fit', dataset, result, '--iterations', iterations, '--seed', seed, *options])


def psnr(error):
    return -10 * math.log10(max(np.mean(np.square(error, dtype=np.float64)), 1e-12))


def optical_flow(before, after):
    """[H,W,2] pixels, by Farneback's method, between pictures [H,W,3] of display values 0..1."""
    grey = [cv2.cvtColor(np.rint(picture * 255).astype(np.uint8), cv2.COLOR_RGB2GRAY) for picture in (before, after)]
    return cv2.calcOpticalFlowFarneback(*grey, None, pyr_scale=0.5, levels=3, winsize=15, iterations=3, poly_n=5,
                                        poly_sigma=1.2, flags=0)


class Judge:
    """The held-out views of one data set. With a stretch of frames cameras take turns: of each stretch one judges, and
    turns change in the middle of two multiples of it, so that steps from one frame to the next count there, too."""

    def __init__(self, context, folder, stretch=0):
        self._context, self._renderer = context, Renderer(context)
        views = Views.open(context, folder)
        self._cameras = {}
        files = sorted((folder / 'moving').glob('*.npy'))
        names = [views.view_info(i).name.decode() for i in range(len(views))]
        for turn, path in enumerate(files):
            of_camera = sorted((name, i) for i, name in enumerate(names) if Path(name).parent.name == path.stem)
            if stretch:
                stretches = [(number, (2 * number + stretch) // (2 * stretch)) for number in range(len(of_camera))]
            else:
                stretches = [(number, turn) for number in range(len(of_camera))]
            masks, judged = np.load(path), {}
            for number, place in stretches:
                if place % len(files) == turn:
                    name, view = of_camera[number]
                    judged.setdefault(place, []).append(
                        ((int(Path(name).stem), views.camera(view), views.read(view)[0][..., :3].copy()), masks[number]))
            for place, found in judged.items():
                self._cameras[path.stem, place] = list(zip(*found))

    def __call__(self, result, frame_rate):
        """Figures of a file, with all of its splats."""
        model = Model.load(self._context, result)
        count = model.settings().maximum_budget
        return self.of(lambda seconds: model.decode(DecodeSettings(count, time=seconds)), frame_rate)

    def of(self, splats_at, frame_rate):
        """Figures of what a function of seconds gives."""
        most, taken, drawn_count = 0, 0, 0
        options = self._renderer.options(output_colour=OutputColour.COMPOSITED, background=(0, 0, 0))
        values = {key: [] for key in ('psnr', 'ssim', 'masked_psnr', 'masked_ssim')}
        changes, truths, flows = [], [], {'flow': [], 'masked_flow': []}
        for frames, masks in self._cameras.values():
            before = None
            for (frame, camera, truth), mask in zip(frames, masks):
                start = time.perf_counter()
                cloud = splats_at(frame / frame_rate)
                most = max(most, cloud.info().count)
                task = self._renderer.start([(cloud, np.eye(4))], camera, options, with_depth=False)
                task.job.wait()
                taken, drawn_count = taken + time.perf_counter() - start, drawn_count + 1
                drawn = np.clip(task.colour[..., :3], 0, 1)
                values['psnr'].append(psnr(drawn - truth))
                values['ssim'].append(image_loss(self._context, drawn, truth, with_gradient=False)[2])
                if mask.sum() >= LEAST_MOVING:
                    values['masked_psnr'].append(psnr((drawn - truth)[mask]))
                    values['masked_ssim'].append(image_loss(self._context, drawn, truth, mask.astype(np.float32),
                                                            with_gradient=False)[2])
                if before is not None:
                    changes.append(np.abs((drawn - before[0]) - (truth - before[1])).mean())
                    truths.append(np.abs(truth - before[1]).mean())
                    if cv2:
                        far = np.linalg.norm(optical_flow(before[0], drawn) - optical_flow(before[1], truth), axis=-1)
                        flows['flow'].append(far.mean())
                        if mask.sum() >= LEAST_MOVING:
                            flows['masked_flow'].append(far[mask].mean())
                before = drawn, truth
        return {**{key: statistics.mean(found) for key, found in values.items()},
                **{key: float(statistics.mean(found)) for key, found in flows.items() if found},
                'flicker': float(statistics.mean(changes) / statistics.mean(truths)),
                'splats': most, 'frame_seconds': taken / drawn_count}


def measure(stipple, judge, given, scene, arm, strategy, seed):
    """A row of results."""
    result = given.folder / f'{scene}.stipple.safetensors'
    costs = fit(stipple, given.folder / scene, result,
                ['--model', 'motion', '--strategy', strategy, '--max-splats', given.most], given.iterations, seed)
    return {'scene': scene, 'arm': arm, 'strategy': strategy, 'seed': seed, 'iterations': given.iterations,
            'most': given.most, **judge(result, 24), **costs, 'load': os.getloadavg()[0]}


def as_many(stipple, judge, given, scene, seed, wanted):
    """The fit without the parts whose count of splats is nearest to `wanted`: thresholds by regula falsi of the
    logarithms, at most MOST_TRIES fits."""
    rows, threshold = [], THRESHOLD / 2
    for _ in range(MOST_TRIES):
        row = measure(stipple, judge, given, scene, 'off, as many', f'temporal({OFF},threshold={threshold:.3g})', seed)
        rows.append((abs(math.log(row['splats'] / wanted)), threshold, row))
        print(f'  threshold {threshold:.3g}: {row["splats"]:,} of {wanted:,}', flush=True)
        if rows[-1][0] <= LIKENESS or (row['splats'] < wanted and wanted >= given.most):
            break
        slope = -1.2  # of the logarithm of counts by that of thresholds, where nothing better is known
        if len(rows) > 1:
            (_, a, first), (_, b, second) = rows[-2:]
            slope = min(-0.1, math.log(second['splats'] / first['splats']) / math.log(b / a))
        threshold *= math.exp(math.log(wanted / row['splats']) / slope)
    return min(rows, key=lambda entry: entry[0])[2]


def table(results, given):
    lines = ['| scene | parts | ' + ' | '.join(name for _, name in FIGURES.values()) + ' |',
             '|---|---|' + '---|' * len(FIGURES)]
    for scene in (*given.scenes, None):
        for arm in ARMS:
            rows = [row for row in results.find(arm=arm, iterations=given.iterations, most=given.most)
                    if scene in (None, row['scene']) and row['scene'] in given.scenes]
            if not rows:
                continue
            cells = []
            for key, (form, _) in FIGURES.items():
                values = [row[key] for row in rows]
                spread = f' ± {form.format(statistics.stdev(values))}' if scene and len(values) > 1 else ''
                cells.append(form.format(statistics.mean(values)) + spread)
            lines.append(f'| {scene or "mean"} | {arm} | ' + ' | '.join(cells) + ' |')
    return '\n'.join(lines + ['', *gains(results, given)])


def gains(results, given):
    """Sentences on what the three parts bring, paired over scenes and seeds, with 95 % intervals (Student's t)."""
    quantiles = {1: 12.7, 2: 4.3, 3: 3.18, 4: 2.78, 5: 2.57, 6: 2.45, 7: 2.36, 8: 2.31}
    for other in ('off', 'off, as many'):
        pairs = []
        for row in results.find(arm='all three', iterations=given.iterations, most=given.most):
            found = results.find(arm=other, iterations=given.iterations, most=given.most, scene=row['scene'],
                                 seed=row['seed'])
            pairs += [row['masked_psnr'] - found[0]['masked_psnr']] if found else []
        if len(pairs) < 2:
            continue
        half = quantiles.get(len(pairs) - 1, 2.2) * statistics.stdev(pairs) / math.sqrt(len(pairs))
        yield (f'All three parts, over "{other}", masked: {statistics.mean(pairs):+.2f} dB, 95 % interval '
               f'{statistics.mean(pairs) - half:+.2f} to {statistics.mean(pairs) + half:+.2f} ({len(pairs)} pairs).')


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('stipple', type=Path)
    parser.add_argument('folder', type=Path)
    parser.add_argument('--scenes', type=lambda text: text.split(','), default=SCENES)
    parser.add_argument('--arms', type=lambda text: text.split(';'), default=list(ARMS))
    parser.add_argument('--seeds', type=int, default=3)
    parser.add_argument('--iterations', type=int, default=6000)
    parser.add_argument('--most', type=int, default=60000)
    parser.add_argument('--table', action='store_true', help='print what is there, and fit nothing')
    given = parser.parse_args()
    results = Results(given.folder / 'moving.jsonl')
    if not given.table:
        context = Context(library.load(given.stipple.resolve().parents[1] / 'lib' / 'libstipple.so'))
        for seed in range(given.seeds):
            for scene in given.scenes:
                judge = Judge(context, given.folder / scene)
                for arm in given.arms:
                    setting = {'scene': scene, 'seed': seed, 'iterations': given.iterations, 'most': given.most}
                    if results.find(arm=arm, **setting):
                        continue
                    whole, plain = (results.find(arm=other, **setting) for other in ('all three', 'off'))
                    if ARMS[arm]:
                        row = measure(given.stipple, judge, given, scene, arm, ARMS[arm], seed)
                    elif whole and plain and abs(math.log(plain[0]['splats'] / whole[0]['splats'])) <= LIKENESS:
                        row = {**plain[0], 'arm': arm}
                    elif whole:
                        row = as_many(given.stipple, judge, given, scene, seed, whole[0]['splats'])
                    else:
                        continue
                    results.add(row)
                    print(f'{scene}, {arm}, seed {seed}: {row["masked_psnr"]:.2f} dB masked, {row["psnr"]:.2f} dB, '
                          f'{row["splats"]:,} splats, {row["seconds"]:.0f} s', flush=True)
    print(table(results, given))


if __name__ == '__main__':
    main()
