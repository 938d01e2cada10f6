# SPDX-License-Identifier: GPL-3.0-or-later
"""The last measurement of what accuracy costs in a view of a scene, and which setting is chosen from it."""

from dataclasses import dataclass

import bpy
import numpy as np

from ..source import sources
from . import facts, quality

# The plot of a scene's report, as an Image: 840 units wide.
PLOT_NAME = 'Quality Plot'
PREVIEW_WIDTH = 480  # pixels, or up to twice as many
PLOT_SCALE = 2.0
_PLOT_KEY = 'stipple_plot'


@dataclass
class Measured:
    report: object     # binding.accuracy.AccuracyReport
    camera_name: str
    frame: int
    key: str           # of what the image was of


# By scene.
_measured = {}


def of(scene):
    """The last Measured, or None."""
    return _measured.get(scene.name_full)


def keep(scene, report):
    _measured[scene.name_full] = Measured(report, scene.camera.name, scene.frame_current, key_of(scene))


def forget():
    _measured.clear()


def key_of(scene):
    """A text that is equal while a measured image would be the same."""
    return repr((facts.picture_size(scene.render), scene.stipple.splat_color, scene.stipple.max_splats_render))


def is_current(scene, measured):
    """Whether a measurement is of what the scene shows now."""
    return (measured.key == key_of(scene) and measured.frame == scene.frame_current and scene.camera is not None
            and measured.camera_name == scene.camera.name)


def row_of(scene, measured, column):
    """The measured row of the setting of 'VIEWPORT' or 'RENDER', or None where it was not measured."""
    wanted = quality.accuracy_of(sources.context().library, quality.column(scene, column))
    return next((row for row in measured.report.rows if quality.is_same(row.setting, wanted)), None)


def plot_of(scene):
    """The Image of a scene's last plot, of an earlier session too, or None."""
    return next((image for image in bpy.data.images if image.get(_PLOT_KEY) == scene.name_full), None)


def plot(scene):
    """Draws the plot of a scene's measurement into an Image, packed."""
    pixels = of(scene).report.draw(PLOT_SCALE)
    height, width = pixels.shape[:2]
    image = plot_of(scene)
    if image is None or tuple(image.size) != (width, height):
        if image is not None:
            bpy.data.images.remove(image)
        image = bpy.data.images.new(PLOT_NAME, width, height, alpha=False)
    write(image, pixels)
    _write_preview(image, pixels)
    image[_PLOT_KEY] = scene.name_full
    return image


def _write_preview(image, pixels):
    """What panels show of it. Blender draws none by itself for an Image that it has not shown yet."""
    step = max(1, pixels.shape[1] // PREVIEW_WIDTH)
    height, width = pixels.shape[0] // step, pixels.shape[1] // step
    means = pixels[:height * step, :width * step].reshape(height, step, width, step, 4).mean(axis=(1, 3))
    preview = image.preview_ensure()
    preview.image_size = width, height
    preview.image_pixels_float.foreach_set(np.ascontiguousarray(means[::-1], np.float32).reshape(-1))


def write(image, pixels):
    """pixels [H,W,4], display sRGB, row 0 = top."""
    image.pixels.foreach_set(np.ascontiguousarray(pixels[::-1], np.float32).reshape(-1))
    image.update()
    image.pack()
