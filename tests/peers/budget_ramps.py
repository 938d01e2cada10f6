#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""What shows when a budget moves: images of one camera while the budget of a model goes up.

    budget_ramps.py STIPPLE MODEL... [--from 2000] [--to 500000] [--frames 48] [--images FOLDER]

MODEL is a model (.stipple.safetensors) or splats of any format, whose merge tree is built. The camera stands still and
looks at the middle of the model, so that what differs from frame to frame is the budget's doing. A ramp is even in
octaves or in splats. Of the differences between consecutive frames, channels premultiplied, over the pixels that any
frame covers: the mean of each pair, of these means the largest over the median one; and the largest 99.9th percentile
of any pair. PSNR is of the whole ramp's frames
against the last one of the same way, in the mean. *smooth* is StippleDecodeOptions.smooth.

Of ramps that are even in octaves also what no way from one budget to another can do without: the mean difference of two
frames an octave apart, over the number of frames between them. *over least* is the mean difference of a pair over that,
in the median, which is 1 where pixels go straight from what they are to what they will be; *least ratio* is the largest
over the median of these.
"""

import argparse
import math
import time
from pathlib import Path

import numpy as np
from make_scene import Context, DecodeSettings, Model, Renderer, library

from stipple.binding.cloud import Cloud
from stipple.binding.structs import AnchorOrder, OutputColour, StippleCamera

SIZE = 512  # pixels
DIRECTION = (1.0, -1.5, 0.6)  # from the middle to the camera


def camera_of(info):
    """A camera that sees the whole model."""
    low, high = np.array(info.bounds_min, float), np.array(info.bounds_max, float)
    middle, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    away = np.array(DIRECTION) / np.linalg.norm(DIRECTION)
    forward = -away
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    rotation = np.stack([right, down, forward])
    place = middle + away * radius * 2.4
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, -rotation @ place
    focal = SIZE
    camera = StippleCamera(width=SIZE, height=SIZE, fx=focal, fy=focal, cx=SIZE / 2, cy=SIZE / 2,
                           near_plane=radius * 0.01, far_plane=radius * 100)
    camera.world_to_camera = type(camera.world_to_camera)(*matrix.ravel())
    return camera


def budgets(first, last, frames, kind):
    """The budget of each frame."""
    along = np.arange(frames) / (frames - 1)
    values = first * (last / first) ** along if kind == 'octaves' else first + (last - first) * along
    return [int(round(value)) for value in values]


def model_of(context, path):
    if path.name.endswith('.stipple.safetensors'):
        return Model.load(context, path)
    job = Model.from_cloud_start(context, Cloud.load(context, path))
    job.wait()
    return Model.of_job(job)


class Ramp:
    """A model seen by one camera."""

    def __init__(self, context, path):
        self.model = model_of(context, path)
        self.settings = self.model.settings()
        self._renderer = Renderer(context)
        self._options = self._renderer.options(output_colour=OutputColour.COMPOSITED)
        self._camera = camera_of(self.model.info())
        self.seconds = 0.0

    def image(self, budget, order, smooth):
        begin = time.perf_counter()
        cloud = self.model.decode(DecodeSettings(budget, order=order, smooth=smooth))
        self.seconds += time.perf_counter() - begin
        task = self._renderer.start([(cloud, np.eye(4))], self._camera, self._options, with_depth=False)
        task.job.wait()
        return np.clip(task.colour, 0, 1)

    def measure(self, counts, order, smooth, folder):
        """What a row of the table has, in its order; the last is seconds of a decode."""
        self.seconds = 0.0
        frames = [self.image(count, order, smooth) for count in counts]
        covered = np.max([frame[..., 3] for frame in frames], axis=0) > 0.01
        means, peaks = [], []
        for before, after in zip(frames, frames[1:]):
            difference = np.abs(after - before)[covered]
            means.append(float(difference.mean()))
            peaks.append(float(np.percentile(difference.max(-1), 99.9)))
        stride = round((len(counts) - 1) / math.log2(counts[-1] / counts[0])) or 1
        least = [float(np.abs(frames[i + stride] - frames[i])[covered].mean()) / stride
                 for i in range(len(frames) - stride)]
        # Of each pair, the octave that it is in the middle of.
        around = [least[min(max(i - stride // 2, 0), len(least) - 1)] for i in range(len(means))]
        excess = float(np.median(np.array(means) / np.maximum(around, 1e-12)))
        errors = [float(np.mean(np.square(frame - frames[-1]))) for frame in frames[:-1]]
        if folder:
            for i, frame in enumerate(frames):
                np.save(folder / f'{i:03}.npy', frame)
        return (max(means) / float(np.median(means)), float(np.median(means)), max(peaks), excess,
                max(around) / max(float(np.median(around)), 1e-12),
                float(np.mean([-10 * math.log10(max(error, 1e-12)) for error in errors])), self.seconds / len(counts))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('stipple', type=Path)
    parser.add_argument('models', type=Path, nargs='+')
    parser.add_argument('--from', dest='first', type=int, default=2000)
    parser.add_argument('--to', dest='last', type=int, default=500000)
    parser.add_argument('--frames', type=int, default=48)
    parser.add_argument('--kinds', type=lambda text: text.split(','), default=['octaves', 'splats'])
    parser.add_argument('--images', type=Path, help='a folder for the frames of the last ramp, as .npy')
    given = parser.parse_args()
    context = Context(library.load(given.stipple.resolve().parents[1] / 'lib' / 'libstipple.so'))
    print('| model | order | even in | largest over median | median | 99.9 % | over least | least ratio | PSNR | decode |'
          '\n|---|---|---|---|---|---|---|---|---|---|')
    for path in given.models:
        ramp = Ramp(context, path)
        first = max(given.first, ramp.settings.minimum_budget)
        last = min(given.last, ramp.settings.maximum_budget)
        ways = [(order, False) for order in AnchorOrder] if ramp.settings.has_order else [(AnchorOrder.SYSTEMATIC, False)]
        ways += [(AnchorOrder.PROGRESSIVE, True)] if ramp.settings.has_smooth else []
        for kind in given.kinds:
            for order, smooth in ways:
                ratio, median, peak, excess, floor, psnr, seconds = ramp.measure(
                    budgets(first, last, given.frames, kind), order, smooth, given.images)
                way = 'smooth' if smooth else order.name.lower()
                octaves = f'{excess:.1f} | {floor:.2f}' if kind == 'octaves' else ' | '
                print(f'| {path.name} | {way} | {kind} | {ratio:.2f} | {median:.4f} | '
                      f'{peak:.3f} | {octaves} | {psnr:.1f} dB | {seconds * 1000:.0f} ms |', flush=True)


if __name__ == '__main__':
    main()
