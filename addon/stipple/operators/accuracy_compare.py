# SPDX-License-Identifier: GPL-3.0-or-later
"""Two settings of the present view beside each other, or how far apart they are."""

import bpy
import numpy as np
from bpy.props import EnumProperty, FloatProperty

from ..binding.renderer import Renderer
from ..binding.structs import AccuracyLevel
from ..binding import accuracy as native
from ..jobs import JobOperator, Task
from ..scene.fit import fit_reports
from ..scene.source import sources
from ..scene.view import measured_quality, quality, rendered_view

NAME = 'Quality Comparison'
# Errors are shown so many times as large.
GAIN = 10.0


class STIPPLE_OT_accuracy_compare(JobOperator, bpy.types.Operator):
    """Draw the present view with two settings, into one Image"""

    bl_idname = 'stipple.accuracy_compare'
    bl_label = "Compare"
    bl_options = {'REGISTER'}

    first: EnumProperty(name="Left", items=quality.SIDES, default='VIEWPORT')
    second: EnumProperty(name="Right", items=quality.SIDES, default='RENDER')
    show: EnumProperty(name="Show", items=(('WIPE', "Wipe", "The first setting is to the left of a line and the "
                                                            "second to its right"),
                                           ('ERROR', "Error × 10", "The image shows ten times the difference of the "
                                                                   "two settings")))
    wipe: FloatProperty(name="Line", description="Position of the line between the two settings", default=0.5, min=0.0,
                        max=1.0, subtype='FACTOR')

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, context):
        view = rendered_view.gather(context)
        owner = sources.context()
        renderer = Renderer(owner)
        chosen = []
        for side in (self.first, self.second):
            if side == 'REFERENCE':
                accuracy = native.accuracy(owner.library, AccuracyLevel.REFERENCE)
            else:
                accuracy = quality.accuracy_of(owner.library, quality.column(context.scene, side), view.rows)
            chosen.append(renderer.options(blend_space=view.picture.blend_space,
                                           background=view.picture.background or (0.0, 0.0, 0.0), accuracy=accuracy))

        def work(task):
            pictures = []
            for place, options in enumerate(chosen):
                made = renderer.start(view.placed, view.camera, options, with_depth=False)
                task.run(made.job, place / 2, (place + 1) / 2)
                pictures.append(_display(made.colour))
            return pictures

        return Task(work)

    def finish(self, context, job):
        first, second = job.result
        if self.show == 'ERROR':
            pixels = np.minimum(GAIN * np.abs(first - second), 1.0)
            pixels[..., 3] = 1.0
        else:
            edge = int(round(self.wipe * first.shape[1]))
            pixels = second.copy()
            pixels[:, :edge] = first[:, :edge]
            pixels[:, max(edge - 1, 0):edge] = 1.0
        height, width = pixels.shape[:2]
        image = bpy.data.images.get(NAME)
        if image is not None and tuple(image.size) != (width, height):
            bpy.data.images.remove(image)
            image = None
        if image is None:
            image = bpy.data.images.new(NAME, width, height, alpha=False)
        measured_quality.write(image, pixels)
        if not bpy.app.background:
            fit_reports.show(context, image)
        error = float(np.mean(np.square((first - second)[..., :3], dtype=np.float64)))
        decibels = float('inf') if error == 0 else -10 * np.log10(error)
        words = native.accuracy_verdict(sources.context().library, decibels)
        self.report({'INFO'}, f'{words} ({decibels:.1f} dB)')


def _display(colour):
    """Display sRGB of opaque scene linear pixels [H,W,4]."""
    light = np.clip(colour, 0.0, 1.0)
    shown = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055).astype(np.float32)
    shown[..., 3] = 1.0
    return shown


classes = (STIPPLE_OT_accuracy_compare,)
