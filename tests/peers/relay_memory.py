#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures the peak of memory of fits of the first frames of a clip, and what a frame of a fitted clip costs to draw.

    relay_memory.py STIPPLE FOLDER [--scene passing] [--lengths 60,240,480] [--spacing 2] [--steps 30] [--anchors 4000]
        [--models relay,motion] [--image-bytes 64MiB] [--draw CLIP...]

FOLDER holds a folder of make_moving.py for the scene. A fit has as many steps as key frames, or windows, times --steps:
what the figures show is memory, not quality. With --draw nothing is fitted: `stipple render` draws a frame in the
middle of each of these clips, three times.
"""

import argparse
import math
import statistics
import tempfile
from pathlib import Path

from compare_moving import costs_of, fit
from compare_relay import FRAME_RATE, SPLATS_PER_ANCHOR


def most_of(model, given):
    if model == 'motion':
        return ['--max-splats', SPLATS_PER_ANCHOR * given.anchors]
    return ['--max-anchors', given.anchors, '--key-frame-spacing', given.spacing]


def fits(given, folder):
    print('| model | frames | images in memory | steps | peak, MiB | processor seconds | bytes |', '|---|---|---|---|---|---|---|',
          sep='\n')
    for image_bytes in given.image_bytes:
        for model in given.models:
            for length in given.lengths:
                steps = given.steps * math.ceil((length - 1) / round(given.spacing * FRAME_RATE))
                result = folder / 'clip.stipple.safetensors'
                kept = [] if image_bytes == 'default' else ['--image-bytes', image_bytes]
                costs = fit(given.stipple, given.folder / given.scene, result, [
                    '--model', model, '--frames', f'0:{length - 1}', *most_of(model, given), *kept], steps, 0)
                print(f'| {model} | {length} | {image_bytes} | {steps:,} | {costs["megabytes"]:,.0f} '
                      f'| {costs["processor_seconds"]:,.0f} | {result.stat().st_size:,} |', flush=True)


def drawings(given, folder):
    print('| clip | seconds | processor seconds | peak, MiB |', '|---|---|---|---|', sep='\n')
    for clip in given.draw:
        rows = [costs_of([given.stipple, 'render', clip, '--camera', given.folder / given.scene / 'transforms.json',
                          '--view', 5, '--time', given.lengths[-1] / 2 / FRAME_RATE, '-o', folder / 'frame.png'])
                for _ in range(3)]
        seconds, processor, most = (statistics.median(row[key] for row in rows)
                                    for key in ('seconds', 'processor_seconds', 'megabytes'))
        print(f'| {clip.name} | {seconds:.2f} | {processor:.2f} | {most:,.0f} |', flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('stipple', type=Path)
    parser.add_argument('folder', type=Path)
    parser.add_argument('--scene', default='passing')
    parser.add_argument('--lengths', type=lambda text: [int(part) for part in text.split(',')], default=[60, 240, 480])
    parser.add_argument('--spacing', type=float, default=2)
    parser.add_argument('--steps', type=int, default=30)
    parser.add_argument('--anchors', type=int, default=4000)
    parser.add_argument('--models', type=lambda text: text.split(','), default=['relay', 'motion'])
    parser.add_argument('--image-bytes', type=lambda text: text.split(','), default=['default', '64MiB'])
    parser.add_argument('--draw', type=Path, nargs='+')
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        (drawings if given.draw else fits)(given, Path(folder))


if __name__ == '__main__':
    main()
