#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""What networks that 'stipple train' has learned make of objects that they have never seen.

    compare_networks.py LIBRARY NETWORKS COLLECTION [--held-out 12] [--anchors 256] [--steps 20] [--guidance 3]
        [--image 12] [--tries 1] [--match-colours] [--objects 1000] [--picture FILE]

NETWORKS holds weights.safetensors and flow.safetensors, COLLECTION is the folder that they were learned from, of which
every --held-out-th object by name was kept from them. For each of those, over all its images but one:

    encoded     the autoencoder's splats of its points, with two seeds of draws
    generated   splats of that one image, of --tries seeds those that look most like it ('stipple generate --keep-best')
    nearest     the object that was learned from and has the image that is nearest to it by pixels, as the autoencoder
                has it, turned so that both cameras have one azimuth

What is generated is turned by that of four quarter turns that shows the one image best. PSNR is over black.
"""

import argparse
import math
import statistics
import sys
from pathlib import Path

import numpy as np
from make_scene import Context, DecodeSettings, Image, Model, Renderer, Views, library

from stipple.binding.generate import Generation, generate_options
from stipple.binding.structs import OutputColour
from stipple.binding.train import start_encoding

NORMALISED = 0.95  # of the cube that networks know: the largest side of an object


def turned(angle, scale=1.0):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[scale * c, -scale * s, 0, 0], [scale * s, scale * c, 0, 0], [0, 0, scale, 0], [0, 0, 0, 1.0]])


def psnr(one, other):
    return -10 * math.log10(max(np.mean(np.square(one - other, dtype=np.float64)), 1e-12))


class Shown:
    """The images of an object, over black, and their cameras."""

    def __init__(self, context, folder):
        views = Views.open(context, folder)
        self.cameras = [views.camera(i) for i in range(len(views))]
        self.images = [views.read(i)[0] for i in range(len(views))]

    def azimuth(self, index):
        to_camera = np.array(self.cameras[index].world_to_camera).reshape(-1, 4)[:3]
        place = -to_camera[:, :3].T @ to_camera[:, 3]
        return math.atan2(place[1], place[0])


class Judge:
    def __init__(self, context, given):
        self._context, self._given = context, given
        self._renderer = Renderer(context)
        self._options = self._renderer.options(output_colour=OutputColour.COMPOSITED, background=(0, 0, 0))

    def draw(self, cloud, matrix, camera):
        task = self._renderer.start([(cloud, matrix)], camera, self._options, with_depth=False)
        task.job.wait()
        return np.clip(task.colour[..., :3], 0, 1)

    def of(self, cloud, matrix, shown):
        """The mean over all images but the one."""
        return statistics.mean(psnr(self.draw(cloud, matrix, camera), image[..., :3])
                               for i, (camera, image) in enumerate(zip(shown.cameras, shown.images))
                               if i != self._given.image)

    def encoded(self, folder, seed):
        job = start_encoding(self._context, self._given.networks / 'weights.safetensors', folder)
        job.wait()
        return self._decoded(Model.of_job(job), seed)

    def generated(self, image):
        jobs = []
        for seed in range(1, self._given.tries + 1):
            jobs.append(self._job(image, jobs[-1] if jobs else None, seed, measures_likeness=self._given.tries > 1))
        best = max(range(len(jobs)), key=lambda i: jobs[i].figures().likeness) if len(jobs) > 1 else 0
        job = self._job(image, jobs[best], best + 1, matches_colours=1) if self._given.match_colours else jobs[best]
        return self._decoded(Model.of_job(job), 1)

    def _job(self, image, before, seed, **options):
        options = generate_options(self._context.library, self._given.networks, seed=seed, steps=self._given.steps,
                                   guidance=self._given.guidance, size=0, **options)
        job = Generation.start(self._context, Image.create(self._context, image), None, options, before)
        job.wait()
        return job

    def _decoded(self, model, seed):
        return model.decode(DecodeSettings(self._given.anchors, model.settings().default_gaussians_per_anchor,
                                           seed=seed))


def nearest_of(seen, image):
    """In: seen [N,H,W,3] of bytes. The row with the smallest squared difference."""
    wanted = np.round(255 * image).astype(np.int32)
    return int(np.argmin([np.square(one - wanted).sum() for one in seen]))


def linear(image):
    """A display image as scene linear, both premultiplied."""
    alpha = np.maximum(image[..., 3:], 1e-6)
    straight = np.clip(image[..., :3] / alpha, 0, 1)
    values = np.where(straight <= 0.04045, straight / 12.92, ((straight + 0.055) / 1.055) ** 2.4)
    return np.concatenate([values * image[..., 3:], image[..., 3:]], -1).astype(np.float32)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('library', type=Path)
    parser.add_argument('networks', type=Path)
    parser.add_argument('collection', type=Path)
    parser.add_argument('--held-out', type=int, default=12)
    parser.add_argument('--anchors', type=int, default=256)
    parser.add_argument('--steps', type=int, default=20)
    parser.add_argument('--guidance', type=float, default=3)
    parser.add_argument('--image', type=int, default=12, help='the one that is told')
    parser.add_argument('--tries', type=int, default=1, help='seeds that are tried for each image')
    parser.add_argument('--match-colours', action='store_true', help="lead the object's colours closer to the image")
    parser.add_argument('--objects', type=int, default=1000)
    parser.add_argument('--picture', type=Path, help='a PNG of some objects: truth, encoded, generated, nearest')
    given = parser.parse_args()
    context = Context(library.load(given.library.resolve()))
    judge = Judge(context, given)
    folders = sorted(path.parent for path in given.collection.glob('*/transforms.json'))
    kept = [folder for i, folder in enumerate(folders) if i % given.held_out == given.held_out - 1]
    known = [folder for folder in folders if folder not in kept]
    places, seen = [], []
    for folder in known:
        shown = Shown(context, folder)
        places += [(folder, shown.azimuth(i)) for i in range(len(shown.images))]
        seen += [np.round(255 * image[..., :3]).astype(np.uint8) for image in shown.images]
    seen = np.array(seen)
    rows, pictures = [], []
    for folder in kept[:: max(1, len(kept) // given.objects)]:
        shown = Shown(context, folder)
        told = shown.images[given.image]
        clouds = [judge.encoded(folder, seed) for seed in (1, 2)]
        encoded = [judge.of(cloud, np.eye(4), shown) for cloud in clouds]
        made = judge.generated(linear(told))
        turns = [turned(k * math.pi / 2, 1 / NORMALISED) for k in range(4)]
        matrix = max(turns, key=lambda turn: psnr(judge.draw(made, turn, shown.cameras[given.image]), told[..., :3]))
        generated = judge.of(made, matrix, shown)
        other, azimuth = places[nearest_of(seen, told[..., :3])]
        like = judge.encoded(other, 1)
        back = turned(shown.azimuth(given.image) - azimuth)
        nearest = judge.of(like, back, shown)
        rows.append((*encoded, generated, nearest))
        print(f'{folder.name}: encoded {encoded[0]:.2f}, {encoded[1]:.2f}, generated {generated:.2f}, nearest '
              f'({other.name}) {nearest:.2f} dB', flush=True)
        camera = shown.cameras[(given.image + 5) % len(shown.cameras)]
        pictures.append(np.concatenate([told[..., :3], shown.images[(given.image + 5) % len(shown.images)][..., :3],
                                        *(judge.draw(*one, camera) for one in (
                                            (clouds[0], np.eye(4)), (made, matrix), (like, back)))], 1))
    columns = np.array(rows)
    gain = columns[:, 2] - columns[:, 3]
    half = 1.96 * gain.std(ddof=1) / math.sqrt(len(gain)) if len(gain) > 1 else math.nan
    print(f'{len(rows)} objects, {given.anchors} anchors: encoded {columns[:, 0].mean():.2f} dB, the other seed '
          f'{columns[:, 1].mean():.2f} (largest difference {np.abs(columns[:, 0] - columns[:, 1]).max():.2f}), '
          f'generated {columns[:, 2].mean():.2f}, nearest {columns[:, 3].mean():.2f}; generated is {gain.mean():+.2f} dB '
          f'ahead, 95 % interval {gain.mean() - half:+.2f} to {gain.mean() + half:+.2f}')
    if given.picture:
        shown = np.concatenate(pictures[:: max(1, len(pictures) // 6)][:6], 0)
        Image.create(context, linear(np.concatenate([shown, np.ones_like(shown[..., :1])], -1))).save(given.picture)
    return 0


if __name__ == '__main__':
    sys.exit(main())
