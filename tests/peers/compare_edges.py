#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""How well splats of a mesh keep its edges: data sets of make_edges.py, decoded and drawn at several budgets.

    compare_edges.py STIPPLE FOLDER [--scenes suzanne,cube,helmet] [--budgets 10000,50000,100000,500000]

A band is what lies within two pixels of an edge, so that it is five pixels wide: pixels in which the truth, over black,
changes by more than 0.1 of white from one pixel to the next. Directions of gradients are compared in its pixels with
such a change, weighted by it, modulo half a rotation. PSNR is over colours and alpha, as of images elsewhere here.
"""

import argparse
import math
import statistics
from pathlib import Path

import numpy as np
from make_scene import Context, DecodeSettings, Image, Model, Renderer, Views, library

from stipple.binding.structs import OutputColour

EDGE = 0.1
HALF_BAND = 2  # pixels


def psnr(error):
    return -10 * math.log10(max(float(np.mean(np.square(error, dtype=np.float64))), 1e-12))


def gradient(image):
    """[H,W,2] of the mean of the channels, per pixel."""
    rows, columns = np.gradient(image.mean(-1))
    return np.stack([columns, rows], -1)


def widened(mask, pixels):
    for _ in range(pixels):
        wider = mask.copy()
        wider[1:] |= mask[:-1]
        wider[:-1] |= mask[1:]
        mask = wider.copy()
        mask[:, 1:] |= wider[:, :-1]
        mask[:, :-1] |= wider[:, 1:]
    return mask


class Scene:
    def __init__(self, context, folder):
        self._renderer = Renderer(context)
        self._model = Model.load(context, folder / 'model.stipple.safetensors')
        views = Views.open(context, folder)
        self._views = []
        for i in range(len(views)):
            name = views.view_info(i).name.decode()
            path = folder / (name if name.endswith('.png') else name + '.png')
            truth = Image.load(context, path).read()
            truth = np.concatenate([truth[..., :3] * truth[..., 3:], truth[..., 3:]], -1)
            change = gradient(truth)
            edges = np.hypot(change[..., 0], change[..., 1]) > EDGE
            self._views.append((views.camera(i), truth, change, edges, widened(edges, HALF_BAND)))

    def measure(self, budget):
        """PSNR of all, of the band, of the rest within it, the mean error of directions in degrees."""
        cloud = self._model.decode(DecodeSettings(budget))
        options = self._renderer.options(output_colour=OutputColour.COMPOSITED)
        found = []
        for camera, truth, change, edges, band in self._views:
            task = self._renderer.start([(cloud, np.eye(4))], camera, options, with_depth=False)
            task.job.wait()
            drawn = np.clip(task.colour, 0, 1)
            error = drawn - truth
            ours = gradient(drawn)[edges]
            angle = np.arctan2(ours[:, 1], ours[:, 0]) - np.arctan2(change[edges][:, 1], change[edges][:, 0])
            angle = np.abs((angle + math.pi / 2) % math.pi - math.pi / 2)
            weight = np.hypot(*change[edges].T)
            found.append((psnr(error), psnr(error[band]), math.degrees(np.average(angle, weights=weight)),
                          float(error[band][:, 3].mean()), psnr(error[~band])))
        return [statistics.mean(values) for values in zip(*found)]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('stipple', type=Path)
    parser.add_argument('folder', type=Path)
    parser.add_argument('--scenes', type=lambda text: text.split(','), default=['suzanne', 'cube', 'helmet'])
    parser.add_argument('--budgets', type=lambda text: [int(part) for part in text.split(',')],
                        default=[10000, 50000, 100000, 500000])
    given = parser.parse_args()
    context = Context(library.load(given.stipple.resolve().parents[1] / 'lib' / 'libstipple.so'))
    print('| scene | splats | PSNR | of the band | of the rest | error of directions | alpha of the band |\n'
          '|---|---|---|---|---|---|---|')
    for name in given.scenes:
        if not (given.folder / name / 'model.stipple.safetensors').exists():
            print(f'| {name} | not there |')
            continue
        scene = Scene(context, given.folder / name)
        for budget in given.budgets:
            whole, band, degrees, alpha, rest = scene.measure(budget)
            print(f'| {name} | {budget:,} | {whole:.2f} dB | {band:.2f} dB | {rest:.2f} dB | {degrees:.1f}° | '
                  f'{alpha:+.3f} |', flush=True)


if __name__ == '__main__':
    main()
