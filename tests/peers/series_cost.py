#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a series of images costs a fit: memory at full size, and time where images are read again.

    /usr/bin/python3 series_cost.py TOOL FOLDER [--steps 600] [--images 200] [--pairs 3]

FOLDER is what make_series.py writes; it is written where it is not there, 24 cameras x 300 frames of 960 x 540 pixels.
First all images with cam00 held out: the peak of resident memory. Then a few images, kept and streamed in turn: seconds
for each of 200 steps, and of processors with all around the steps, and their ratios in each pair.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent


def fit(tool, folder, steps, *more):
    """(peak bytes, processor seconds, the report) of a fit."""
    report = folder / 'cost.json'
    out = folder / 'cost.stipple.safetensors'
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    process = subprocess.Popen([tool, 'fit', folder, out, '--model', 'motion', '--held-out-cameras', 'cam00',
                                '--iterations', str(steps), '--report', report, *map(str, more)],
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    peak = 0
    while process.poll() is None:
        try:
            status = Path(f'/proc/{process.pid}/status').read_text()
            peak = max([peak, *(1024 * int(line.split()[1]) for line in status.splitlines() if line.startswith('VmHWM'))])
        except FileNotFoundError:
            pass
        time.sleep(0.05)
    assert process.returncode == 0
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    read = json.loads(report.read_text())
    for path in (report, report.with_suffix('.svg'), out):
        path.unlink()
    return peak, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, read


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('tool', type=Path)
    parser.add_argument('folder', type=Path)
    parser.add_argument('--steps', type=int, default=600)
    parser.add_argument('--images', type=int, default=200)
    parser.add_argument('--pairs', type=int, default=3)
    given = parser.parse_args()
    if not given.folder.exists():
        subprocess.run([sys.executable, HERE / 'make_series.py', given.folder, '--distinct', '10'], check=True)
    if given.steps > 0:
        peak, seconds, report = fit(given.tool, given.folder, given.steps)
        print(f'all images: {peak / 2**20:.0f} MiB, {report["seconds"]["other"] / report["seconds"]["all"]:.2%} of the '
              f'time of steps is for images', flush=True)
    for _ in range(given.pairs):
        kept, streamed = (fit(given.tool, given.folder, 200, '--max-images', given.images, '--image-bytes', limit,
                              '--gaussians', 50000) for limit in ('1GiB', '0'))
        steps = [one[2]['seconds']['all'] / 200 for one in (kept, streamed)]
        work = [one[1] / 200 for one in (kept, streamed)]
        print(f'a step: {steps[0]:.3f} s kept, {steps[1]:.3f} s streamed, {steps[1] / steps[0]:.3f} times; '
              f'of processors: {work[0]:.3f} s, {work[1]:.3f} s, {work[1] / work[0]:.3f} times', flush=True)


if __name__ == '__main__':
    main()
