#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits data sets with every strategy, keeps what came out, and writes docs/results/strategies.md, its lines and its
plot.

    compare_strategies.py STIPPLE FOLDER DOCS [--seeds 3] [--iterations 3000] [--strategies a,b] [--scenes a,b]
        [--photos DATASET] [--again] [--table]

FOLDER holds a folder with transforms.json for each scene, and results.jsonl: a line for each fit that is done. All of
them are written to DOCS, too; copied back as results.jsonl, a run goes on from there on another machine. With --again
the lines of
--strategies are dropped first, and measured anew.

Held-out views judge and choose nothing: budgets and strategies are chosen by `training_psnr`, that of views that a fit
learns from.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import textwrap
import time
from pathlib import Path

from strategy_plot import plot

SCENES = {'fine_texture': 'fine texture', 'thin_structures': 'thin structures', 'furnished_room': 'room',
          'still_life': 'photo set'}
MOST_SPLATS = 100000
DOWNSCALE = 2                         # of the pictures of 464 x 256, so that three seeds fit in a night on two cores
UNSCALED = ('adaptive', 'improved')   # also for 30,000 iterations, on the first scene
SPLATS_PER_ANCHOR = 10                # of a scaffold
OTHER_MODELS = 'learned_density', 'scaffold'
THIRD = 3                             # of adaptive's count, which the best strategies get once more
HALF = {'improved': 2}                # published as better with half of adaptive's count
BEST = 5                              # so many of them, beside adaptive itself
COMBINED = ('absolute+long_axis_split',)  # and what parts make of them: the best of seven that short runs tried on one
                                          # scene


def strategies(stipple):
    """Names that `stipple fit --strategies` lists, without the parts, and the model whose anchors grow by a rule of
    their own."""
    text = subprocess.run([stipple, 'fit', '--strategies'], check=True, capture_output=True, text=True).stdout
    return [line.split()[0] for line in text.split('parts')[0].splitlines() if line.startswith('  ')] + ['scaffold']


def fit(stipple, dataset, folder, job):
    """One fit as a process of its own: its figures."""
    report, result = folder / 'report.json', folder / 'result.stipple.safetensors'
    command = [stipple, 'fit', dataset, result, '--iterations', job['iterations'], '--seed', job['seed'], '--holdout',
               8, '--downscale', job['downscale'], '--report', report]
    if job['strategy'] == 'learned_density':
        command += ['--model', 'field']
    elif job['strategy'] == 'scaffold':
        command += ['--model', 'scaffold', '--max-anchors', job['most'] // SPLATS_PER_ANCHOR]
    else:
        command[3] = folder / 'result.ply'
        command += ['--strategy', job['strategy'], '--gaussians', job['most']]
    for left in folder.glob('result.*'):  # of a night that was cut off
        left.unlink()
    start = time.perf_counter()
    process = subprocess.Popen([str(part) for part in command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    message = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - start
    if status != 0:
        raise RuntimeError(f'{job["strategy"]} on {job["scene"]}: {message.decode().splitlines()[-1]}')
    story = json.loads(report.read_text())
    best = max(story['by_budget'], key=lambda row: row['training_psnr'])  # held-out views judge, and choose nothing
    return {**job, 'training_psnr': best['training_psnr'], 'psnr': best['psnr'], 'ssim': best['ssim'],
            'gaussians': best['gaussians'], 'seconds': seconds, 'processor_seconds': usage.ru_utime + usage.ru_stime,
            'megabytes': usage.ru_maxrss / 1024, 'load': os.getloadavg()[0]}


class Results:
    """Fits that are done, in a file that grows by a line each."""

    def __init__(self, path):
        self.path = path
        self.rows = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []

    def find(self, **wanted):
        return [row for row in self.rows if all(row.get(key) == value for key, value in wanted.items())]

    def forget(self, names):
        self.rows = [row for row in self.rows if row['strategy'] not in names]
        self.path.write_text(''.join(json.dumps(row) + '\n' for row in self.rows))

    def add(self, row):
        self.rows.append(row)
        with self.path.open('a') as file:
            file.write(json.dumps(row) + '\n')


def best(results, scene, iterations):
    """Strategies of explicit splats with the highest PSNR of training views on a scene, by the first seed, and
    adaptive."""
    rows = [row for row in results.find(scene=scene, seed=0, kind='full', iterations=iterations)
            if row['strategy'] not in (*OTHER_MODELS, 'adaptive') and 'training_psnr' in row]
    return ['adaptive', *(row['strategy'] for row in sorted(rows, key=lambda row: -row['training_psnr'])[:BEST])]


def jobs(given, names, results):
    """Rounds of every scene and strategy, so that a night that is cut off leaves whole rounds."""
    base = {'iterations': given.iterations, 'most': MOST_SPLATS, 'downscale': DOWNSCALE, 'kind': 'full'}
    for seed in range(given.seeds):
        for scene in given.scenes:
            for name in names:
                yield {**base, 'scene': scene, 'strategy': name, 'seed': seed}
        for scene in given.scenes:
            full = results.find(scene=scene, strategy='adaptive', seed=seed, kind='full', iterations=given.iterations)
            if not full:
                continue
            few = {**base, 'scene': scene, 'seed': seed}
            for name in (*best(results, scene, given.iterations), *COMBINED):
                yield {**few, 'strategy': name, 'kind': 'third', 'most': max(1, full[0]['gaussians'] // THIRD)}
            for name, part in HALF.items():
                yield {**few, 'strategy': name, 'kind': 'half', 'most': max(1, full[0]['gaussians'] // part)}
    if given.unscaled:
        for name in UNSCALED:
            yield {**base, 'scene': given.scenes[0], 'strategy': name, 'seed': 0, 'iterations': 30000}


def spread(values, form):
    mean = statistics.mean(values)
    return form.format(mean) + (' ± ' + form.format(statistics.stdev(values)) if len(values) > 1 else '')


def table(results, scene, kind, iterations):
    lines = ['| strategy | seeds | PSNR, dB | SSIM | splats | processor seconds | peak memory, MiB |',
             '|---|---|---|---|---|---|---|']
    rows = results.find(scene=scene, kind=kind, iterations=iterations)
    by_name = {}
    for row in rows:
        by_name.setdefault(row['strategy'], []).append(row)
    for name, found in sorted(by_name.items(), key=lambda item: -statistics.mean(row['psnr'] for row in item[1])):
        lines.append('| ' + ' | '.join((
            f'`{name}`', str(len(found)), spread([row['psnr'] for row in found], '{:.2f}'),
            spread([row['ssim'] for row in found], '{:.4f}'),
            f'{statistics.mean(row["gaussians"] for row in found):,.0f}',
            spread([row['processor_seconds'] for row in found], '{:.0f}'),
            f'{statistics.mean(row["megabytes"] for row in found):.0f}')) + ' |')
    return lines if by_name else []


def write_page(results, given):
    seeds = len({row['seed'] for row in results.rows})
    head = (f'`bash tests/peers/strategies.sh` writes this page: fits of {given.iterations:,} iterations with at most '
            f'{MOST_SPLATS:,} splats, up to {seeds} seed{"s" if seeds > 1 else ""} (mean ± standard deviation), every '
            f'eighth view held out, images of {464 // DOWNSCALE} × {256 // DOWNSCALE}. All fits together took '
            f'{sum(row["processor_seconds"] for row in results.rows) / 3600:.1f} processor hours on {os.cpu_count()} '
            f'cores. '
            f'Their clocks add up to {sum(row["seconds"] for row in results.rows) / 3600:.1f} hours; the mean load of '
            f'the '
            f'machine was {statistics.mean(row["load"] for row in results.rows):.1f}, and above 2 fits ran side by '
            f'side.')
    lines = ['# What every strategy reaches', '', *textwrap.wrap(head, 120), '',
             '![Processor seconds and PSNR of every strategy](../images/strategies.svg)', '',
             '[What these figures say](densification.md). [Every fit, a line each](strategies.jsonl).', '']
    if any('training_psnr' not in row for row in results.rows):
        lines += textwrap.wrap('Fits without `training_psnr` there were chosen by held-out views, and are not measured '
                               'again: the '
                               "best state of each, the budget of a field, and which strategies get a third of "
                               "`adaptive`'s "
                               'count.', 120) + ['']
    for scene in given.scenes:
        lines += [f'## {SCENES.get(scene, scene).capitalize()}', '', *table(results, scene, 'full', given.iterations),
                  '']
        for kind, share in (('half', 'half'), ('third', 'a third')):
            fewer = table(results, scene, kind, given.iterations)
            if fewer:
                lines += [f'With at most {share} of the splats that `adaptive` makes above:', '', *fewer, '']
    unscaled = table(results, given.scenes[0], 'full', 30000)
    if unscaled:
        lines += ['## Without scaling', '', f'{SCENES[given.scenes[0]].capitalize()}, 30,000 iterations, schedules as '
                  'published:', '', *unscaled, '']
    (given.docs / 'results' / 'strategies.md').write_text('\n'.join(lines))
    (given.docs / 'results' / 'strategies.jsonl').write_text(
        ''.join(json.dumps(row) + '\n' for row in results.rows))
    full = [row for row in results.rows if row['kind'] == 'full' and row['iterations'] == given.iterations]
    (given.docs / 'images' / 'strategies.svg').write_text(plot(full, SCENES))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('stipple', type=Path)
    parser.add_argument('folder', type=Path)
    parser.add_argument('docs', type=Path)
    parser.add_argument('--seeds', type=int, default=3)
    parser.add_argument('--iterations', type=int, default=3000)
    parser.add_argument('--strategies', type=lambda text: text.split(','))
    parser.add_argument('--scenes', type=lambda text: text.split(','), default=list(SCENES))
    parser.add_argument('--photos', type=Path, help='a data set instead of the rendered photo set')
    parser.add_argument('--no-unscaled', dest='unscaled', action='store_false')
    parser.add_argument('--again', action='store_true', help='measure --strategies anew')
    parser.add_argument('--table', action='store_true', help='only write what is there already')
    given = parser.parse_args()
    names = given.strategies or strategies(given.stipple)
    results = Results(given.folder / 'results.jsonl')
    if given.again and given.strategies:
        results.forget(given.strategies)
    if not given.table:
        # The second half of a round's jobs follows from the first.
        for job in jobs(given, names, results):
            if results.find(**job):
                continue
            dataset = given.photos if given.photos and job['scene'] == 'still_life' else given.folder / job['scene']
            try:
                row = fit(given.stipple, dataset, given.folder, job)
            except RuntimeError as error:
                print(error, file=sys.stderr, flush=True)
                continue
            results.add(row)
            print(f'{row["scene"]:16} {row["kind"]:6} {row["strategy"]:16} seed {row["seed"]}: {row["psnr"]:.2f} dB, '
                  f'{row["gaussians"]} splats, {row["seconds"]:.0f} s', flush=True)
    if not results.rows:
        sys.exit('there are no results to write')
    write_page(results, given)


if __name__ == '__main__':
    main()
