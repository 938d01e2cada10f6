# SPDX-License-Identifier: GPL-3.0-or-later
"""Hides the selected splats outside (or inside) the boxes of other selected objects."""

import bpy
import numpy as np

from ..binding import cloud_edit
from ..binding.errors import invalid
from ..jobs import JobOperator, Task
from ..properties import CROP_TIMES, SIDES
from ..scene import shapes
from ..scene.source import clip_clouds, edits, placement


class STIPPLE_OT_crop_by_box(JobOperator, bpy.types.Operator):
    """Keep the splats whose centers are inside the other selected objects' boxes: empties or bounding boxes"""

    bl_idname = 'stipple.crop_by_box'
    bl_label = "Crop by Box"
    bl_options = {'REGISTER', 'UNDO'}

    keep: bpy.props.EnumProperty(name="Keep", description="Which side of the boxes' surfaces stays", items=SIDES)

    times: bpy.props.EnumProperty(name="Time", description="When splats that move are looked at", items=CROP_TIMES)

    @classmethod
    def poll(cls, context):
        return context.mode == 'OBJECT' and bool(edits.selected_splats(context))

    def invoke(self, context, _event):
        return self.run_in_window(context) if self.times == 'CLIP' else self.execute(context)

    def start(self, context):
        boxes = [shapes.box_matrix(obj) for obj in shapes.cutters(context)]
        if not boxes:
            raise invalid('No box is selected; select an empty or any other object along with the splats.')
        wanted, keep = [], self.keep
        for target in edits.targets(edits.selected_splats(context)):
            places = [np.linalg.inv(box) @ placement.matrix_of(target.obj) for box in boxes]
            wanted.append((target, clip_clouds.readers(target, self.times == 'CLIP'), places))

        def inside(cloud, places, _start, _end):
            return np.any([cloud_edit.select_box(cloud, place) for place in places], axis=0)
        return Task(lambda task: clip_clouds.crop(task, wanted, keep, inside))

    def finish(self, _context, job):
        self.report({'INFO'}, str(edits.write(job.result)))


classes = (STIPPLE_OT_crop_by_box,)
