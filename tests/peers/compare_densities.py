#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""What several trainings make of the same held-out objects at several budgets, and where they put their anchors.

    compare_densities.py LIBRARY COLLECTION WEIGHTS... [--held-out 12] [--anchors 32 64 128 256 512] [--seed 1]
        [--objects 1000]

Each of WEIGHTS is a weights.safetensors that 'stipple train' wrote; all are compared with the first, object by object.
PSNR is over black, the mean over all images of an object. The detailed fifth of a surface is that of its points around
which colours differ most (the deviation among the 16 nearest of 4,096 points); an anchor is there where the point
nearest to it is. A density that follows the area alone has a fifth of its anchors there.
"""

import argparse
import math
import sys
from pathlib import Path

import numpy as np
from compare_networks import Judge, Shown
from make_scene import Context, DecodeSettings, Model, library

from stipple.binding.train import start_encoding

POINTS, NEIGHBOURS, SHARE = 4096, 16, 0.2


class Surface:
    """Points of an object, and which of them are of its detailed fifth."""

    def __init__(self, path):
        self.points, colours = read_points(path)
        near = np.argpartition(self._squares(self.points), NEIGHBOURS, 1)[:, :NEIGHBOURS]
        spread = colours[near].std(1).mean(1)
        self.is_detailed = spread >= np.quantile(spread, 1 - SHARE)

    def _squares(self, places):
        """[n, points] squared distances, but for what is the same along a row."""
        return (self.points ** 2).sum(1) - 2 * places @ self.points.T

    def share_of(self, places):
        return float(self.is_detailed[self._squares(places).argmin(1)].mean())


def read_points(path):
    """Every so-many-th point [n,3] of a points.ply, and its colour [n,3], 0 to 1."""
    data = path.read_bytes()
    head, body = data.split(b'end_header\n', 1)
    assert b'format binary_little_endian' in head, path
    types = {'float': '<f4', 'uchar': 'u1'}
    fields = [line.split()[1:] for line in head.decode().splitlines() if line.startswith('property')]
    rows = np.frombuffer(body, [(name, types[kind]) for kind, name in fields])
    rows = rows[:: max(1, len(rows) // POINTS)]
    columns = [np.stack([rows[name] for name in names], 1) for names in (('x', 'y', 'z'), ('red', 'green', 'blue'))]
    return columns[0].astype(np.float64), columns[1] / 255.0


def interval(gains):
    mean = gains.mean()
    half = 1.96 * gains.std(ddof=1) / math.sqrt(len(gains)) if len(gains) > 1 else math.nan
    return f'{mean:+.3f} ({mean - half:+.3f} to {mean + half:+.3f})'


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('library', type=Path)
    parser.add_argument('collection', type=Path)
    parser.add_argument('weights', type=Path, nargs='+')
    parser.add_argument('--held-out', type=int, default=12)
    parser.add_argument('--anchors', type=int, nargs='+', default=[32, 64, 128, 256, 512])
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--objects', type=int, default=1000)
    given = parser.parse_args()
    given.image = -1  # of Judge: none of them is left out
    context = Context(library.load(given.library.resolve()))
    judge = Judge(context, given)
    folders = sorted(path.parent for path in given.collection.glob('*/transforms.json'))
    kept = [folder for i, folder in enumerate(folders) if i % given.held_out == given.held_out - 1]
    kept = kept[:: max(1, len(kept) // given.objects)]
    psnr = np.zeros((len(given.weights), len(kept), len(given.anchors)))
    share = np.zeros_like(psnr)
    for row, folder in enumerate(kept):
        shown, surface = Shown(context, folder), Surface(folder / 'points.ply')
        for which, weights in enumerate(given.weights):
            job = start_encoding(context, weights, folder)
            job.wait()
            model = Model.of_job(job)
            gaussians = model.settings().default_gaussians_per_anchor
            for column, anchors in enumerate(given.anchors):
                cloud = model.decode(DecodeSettings(anchors, gaussians, seed=given.seed))
                places = cloud.positions().astype(np.float64).reshape(-1, gaussians, 3).mean(1)
                psnr[which, row, column] = judge.of(cloud, np.eye(4), shown)
                share[which, row, column] = surface.share_of(places)
        print(f'{folder.name}: ' + '; '.join(f'{p[-1]:.2f} dB, {s[-1]:.3f} of anchors' for p, s in
                                             zip(psnr[:, row], share[:, row])), flush=True)
    for which, weights in enumerate(given.weights):
        print(f'{weights}, {len(kept)} objects')
        for column, anchors in enumerate(given.anchors):
            print(f'  {anchors} anchors: {psnr[which, :, column].mean():.2f} dB, {share[which, :, column].mean():.3f} '
                  'of them on the detailed fifth; over the first ' +
                  interval(psnr[which, :, column] - psnr[0, :, column]) + ' dB, ' +
                  interval(share[which, :, column] - share[0, :, column]))
    return 0


if __name__ == '__main__':
    sys.exit(main())
