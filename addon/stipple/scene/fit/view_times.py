# SPDX-License-Identifier: GPL-3.0-or-later
"""Which images a fit of splats that move renders: the times, and which cameras see each of them.

Images are numbered in the order of time. Of N images at T times, image i is of time floor(i T / N), so that each time
has as many as any other, or one more. Cameras take turns, in steps of the golden section of their number: each takes as
many images as any other, or one more, and where two times that follow each other have no more images than there are
cameras, no camera sees both.
"""

import math
from dataclasses import dataclass

from ...binding.errors import invalid

# More times than any clip that a fit can learn from; a range that has more was mistyped.
_MOST_TIMES = 100_000
_GOLDEN = (math.sqrt(5) - 1) / 2
# Without cameras that are held out, every one of so many images is, as published results do it.
_HELD_OUT_EVERY = 8
_ROUNDING = 1e-6  # of a step, that the end of a range may be missed by


@dataclass(frozen=True)
class Plan:
    """What is rendered."""

    frames: tuple        # of the times, ascending; between two whole ones too
    camera_count: int
    image_count: int     # at most those of all cameras at all times
    held_out: frozenset  # indices of the cameras that the fit is measured on alone

    def images(self):
        """((index of a time, index of a camera), ...) by time."""
        return spread(len(self.frames), self.camera_count, self.image_count)

    def held_out_images(self):
        """Places in images() of those that the fit is measured on: all of the cameras that are held out; where none is,
        every eighth by camera and time, if there are so many."""
        images = self.images()
        if self.held_out:
            return frozenset(i for i, (_, camera) in enumerate(images) if camera in self.held_out)
        by_camera = sorted(range(len(images)), key=lambda i: images[i][::-1])
        return frozenset(by_camera[::_HELD_OUT_EVERY] if len(images) >= _HELD_OUT_EVERY else ())

    @property
    def whole_count(self):
        """Images of all cameras at all times."""
        return self.camera_count * len(self.frames)

    def __str__(self):
        times = 'frames' if all(frame == int(frame) for frame in self.frames) else 'times'
        cameras = f"{self.camera_count:,} camera{'s' if self.camera_count > 1 else ''}"
        text = f'{cameras} × {len(self.frames):,} {times} = {self.whole_count:,} images'
        some = 'all' if self.image_count == self.whole_count else f'{self.image_count:,}'
        return f'{text}; {some} are rendered'


def plan(settings, scene, camera_count):
    """The Plan of a fit's settings. Errors: StippleError that says what to change."""
    if camera_count < 1:
        raise invalid('There is no camera to take views by; at least one is needed.')
    times = frames(settings, scene)
    held = settings.held_out_cameras
    if held >= camera_count:
        raise invalid(f'All {camera_count} cameras are held out, and none is left to learn from; Held Out must '
                      f'be smaller than {camera_count}.')
    if settings.image_count < len(times):
        raise invalid(f'Images is {settings.image_count:,}, and there are {len(times):,} times from frame '
                      f'{times[0]:g} to {times[-1]:g}; at least {len(times):,} are needed, one for each. Raise Images, '
                      'or raise Step.')
    count = min(settings.image_count, len(times) * camera_count)
    # In the middle of as many equal parts of the cameras' order.
    chosen = frozenset((2 * i + 1) * camera_count // (2 * held) for i in range(held))
    return Plan(times, camera_count, count, chosen)


def frames(settings, scene):
    """The frames of the times, ascending: (first, ..., last). Errors: StippleError for a range without two."""
    first, last = scene.frame_start, scene.frame_end
    where = 'the scene'
    if not settings.scene_range:
        first, last, where = settings.range_start, settings.range_end, 'the fit'
    if last < first:
        raise invalid(f'End of {where} is frame {last}, before Start, frame {first}; End must come later.')
    count = math.floor((last - first) / settings.frame_step + _ROUNDING) + 1
    if count < 2:
        raise invalid(f'Frames {first} to {last} in steps of {settings.frame_step:g} are one time; splats that move '
                      'need two or more. For one frame, choose the model Splats in Advanced.')
    if count > _MOST_TIMES:
        raise invalid(f'Frames {first} to {last} in steps of {settings.frame_step:g} are {count:,} times; at most '
                      f'{_MOST_TIMES:,} are allowed.')
    return tuple(first + i * settings.frame_step for i in range(count))


def spread(time_count, camera_count, image_count):
    """((index of a time, index of a camera), ...) of image_count different pairs, by time."""
    step = _turn(camera_count)
    return tuple((i * time_count // image_count, i * step % camera_count) for i in range(image_count))


def seconds_at(scene, frame, start):
    """Of a frame, from the frame `start` on."""
    return (frame - start) * scene.render.fps_base / scene.render.fps


def key_frame_seconds(times, spacing):
    """Seconds from the first of these times, ascending, at which the key frames of a long shot stand: every so many
    whole times, in the middle of all."""
    if len(times) < 2:
        return (0.0,)
    step = (times[-1] - times[0]) / (len(times) - 1)
    every = min(max(1, math.floor(spacing / step + 0.5)), len(times))
    last = len(times) - 1
    count = -(-last // every)
    first = (last - (count - 1) * every) // 2
    return tuple((first + i * every) * step for i in range(count))


def evenly(items, most):
    """At most so many of them, the first and the last one among them."""
    count = min(most, len(items))
    return [items[round(i * (len(items) - 1) / max(count - 1, 1))] for i in range(count)]


def _turn(count):
    """From a camera to the one whose turn is next: near the golden section, without common divisor."""
    wished = count * _GOLDEN
    return min((step for step in range(1, count + 1) if math.gcd(step, count) == 1),
               key=lambda step: (abs(step - wished), step))
