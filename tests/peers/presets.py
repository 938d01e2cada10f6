#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""What iterations and splats bring and cost: fits of data sets, a row each, and the presets that follow.

    presets.py STIPPLE DATASET... [--iterations 250 500 ...] [--gaussians 5000 ...] [--model explicit]

Per fit: held-out PSNR over black, splats, seconds, those of the processor. Then the mean over the data sets, and what
the rule chooses: of iterations, and then of counts, the last doubling that still brings Fast 2 dB, Balanced 0.5 dB,
Fine Detail 0.2 dB.
"""

import argparse
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

RULE = {'Fast': 2.0, 'Balanced': 0.5, 'Fine Detail': 0.2}  # dB a doubling, at least


def fit(program, dataset, model, iterations, count, strategy):
    """(seconds, processor seconds, splats, PSNR) of one fit."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / 'report.json'
        out = Path(folder) / ('fit.ply' if model == 'explicit' else 'fit.stipple.safetensors')
        most = ('--gaussians', str(count), '--strategy', strategy) if model == 'explicit' else ('--anchors',
                                                                                                str(max(1, count // 4)))
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
        subprocess.run([program, 'fit', dataset, out, '--model', model, '--iterations', str(iterations), '--holdout',
                        '6', '--report', report, *most], check=True, stdout=subprocess.DEVNULL,
                       stderr=subprocess.DEVNULL)
        seconds, after = time.monotonic() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
        busy = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        best = json.loads(report.read_text())['by_budget'][-1]
        return seconds, busy, best['gaussians'], best['psnr']


def last_worth(values, psnr, least):
    """The last of `values` that brings at least `least` dB a doubling over the one before it."""
    chosen = values[0]
    for before, after in zip(values, values[1:]):
        doublings = math.log2(after / before)
        if psnr[after] - psnr[before] < least * doublings:
            break
        chosen = after
    return chosen


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument('stipple')
    parser.add_argument('datasets', nargs='+')
    parser.add_argument('--iterations', type=int, nargs='+', default=[250, 500, 1000, 2000, 4000, 8000])
    parser.add_argument('--gaussians', type=int, nargs='+', default=[15000, 30000, 60000])
    parser.add_argument('--model', choices=('explicit', 'field'), default='explicit')
    parser.add_argument('--strategy', default='adaptive', help='of explicit splats')
    given = parser.parse_args()
    if not os.access(given.stipple, os.X_OK):
        sys.exit(f"presets.py: '{given.stipple}' is not a program.")
    print('| iterations | most splats | ' + ' | '.join(Path(d).name for d in given.datasets) + ' | mean |')
    print('|---|---|' + '---|' * (len(given.datasets) + 1))
    means = {}
    for count in given.gaussians:
        for iterations in given.iterations:
            rows = [fit(given.stipple, d, given.model, iterations, count, given.strategy) for d in given.datasets]
            cells = [f'{psnr:.2f} dB, {splats:,}, {seconds:.0f} s ({busy:.0f} s)' for seconds, busy, splats,
                     psnr in rows]
            psnr, busy = (sum(row[i] for row in rows) / len(rows) for i in (3, 1))
            means[count, iterations] = psnr
            print(f'| {iterations:,} | {count:,} | ' + ' | '.join(cells) + f' | {psnr:.2f} dB, ({busy:.0f} s) |',
                  flush=True)
    for name, least in RULE.items():
        many = given.gaussians[-1]
        iterations = last_worth(given.iterations, {i: means[many, i] for i in given.iterations}, least)
        count = last_worth(given.gaussians, {c: means[c, iterations] for c in given.gaussians}, least)
        print(f'{name}: {iterations:,} iterations, {count:,} splats')


if __name__ == '__main__':
    main()
