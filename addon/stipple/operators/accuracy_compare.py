# SPDX-License-Identifier: GPL-3.0-or-later
"""Two settings of the present view beside each other, or how far apart they are."""

import bpy
import numpy as np
from bpy.props import EnumProperty, FloatProperty

from .. import binding
from ..binding import accuracy as native, structs
from ..jobs import JobOperator, Task
from ..scene.fit import fit_reports
from ..scene.source import sources
from ..scene.view import measured_quality, quality, rendered_view

NAME = 'Quality Comparison'
# Errors are shown so many times as large.
GAIN = 10.0


class STIPPLE_OT_accuracy_compare(JobOperator, bpy.types.Operator):
    """Draw what the scene's camera sees with two settings, into one image"""

    bl_idname = 'stipple.accuracy_compare'
    bl_label = "Compare"
    bl_options = {'REGISTER'}

    first: EnumProperty(name="Left", description="What is drawn to the left of the line", items=quality.SIDES,
                        default='VIEWPORT')
    second: EnumProperty(name="Right", description="What is drawn to the right of the line", items=quality.SIDES,
                         default='RENDER')
    show: EnumProperty(name="Show", description="How the two images are put together",
                       items=(('WIPE', "Wipe",
                               "The first setting is to the left of a line and the second to its right"),
                              ('ERROR', "Error × 10", "The image shows ten times the difference of the two settings")))
    wipe: FloatProperty(name="Line", description="Position of the line between the two settings", default=0.5, min=0.0,
                        max=1.0, subtype='FACTOR')

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, context):
        view = rendered_view.gather(context)
        owner = sources.context()
        renderer = binding.renderer.Renderer(owner)
        chosen = []
        for side in (self.first, self.second):
            if side == 'REFERENCE':
                accuracy = native.accuracy(owner.library, structs.AccuracyLevel.REFERENCE)
            else:
                accuracy = quality.accuracy_of(owner.library, quality.column(context.scene, side), view.rows)
            chosen.append(renderer.options(blend_space=view.picture.blend_space,
                                           background=view.picture.background, accuracy=accuracy))

        def work(task):
            pictures = []
            for place, options in enumerate(chosen):
                made = renderer.start(view.placed, view.camera, options, with_depth=False)
                task.run(made.job, place / 2, (place + 1) / 2)
                pictures.append(made.colour)
            # The judge of measurements, over all pixels.
            judged = [binding.image.Image.create(owner, picture) for picture in pictures]
            return pictures, judged[0].compare(judged[1]).psnr

        return Task(work)

    def finish(self, context, job):
        drawn, psnr = job.result
        first, second = (_display(picture) for picture in drawn)
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
        words = native.accuracy_verdict(sources.context().library, psnr)
        self.report({'INFO'}, f'{words} ({measured_quality.decibels(psnr)})')


def _display(colour):
    """Display sRGB over black of scene linear pixels [H,W,4], premultiplied."""
    light = np.clip(colour, 0.0, 1.0)
    shown = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055).astype(np.float32)
    shown[..., 3] = 1.0
    return shown


classes = (STIPPLE_OT_accuracy_compare,)
