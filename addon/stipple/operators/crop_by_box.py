# SPDX-License-Identifier: GPL-3.0-or-later
"""Hides the selected splats outside (or inside) the boxes of other selected objects."""

import bpy
import numpy as np

from ..binding import cloud_edit
from ..binding.errors import invalid
from ..binding.structs import Side
from ..jobs import JobOperator
from ..properties import SIDES
from ..scene import shapes
from ..scene.source import edits, placement


class STIPPLE_OT_crop_by_box(JobOperator, bpy.types.Operator):
    """Keep the splats whose centers are inside the other selected objects' boxes: empties or bounding boxes"""

    bl_idname = 'stipple.crop_by_box'
    bl_label = "Crop by Box"
    bl_options = {'REGISTER', 'UNDO'}

    keep: bpy.props.EnumProperty(name="Keep", description="Which side of the boxes' surfaces stays", items=SIDES)

    @classmethod
    def poll(cls, context):
        return context.mode == 'OBJECT' and bool(edits.selected_splats(context))

    def start(self, context):
        boxes = [shapes.box_matrix(obj) for obj in shapes.cutters(context)]
        if not boxes:
            raise invalid('No box is selected; select an empty or any other object along with the splats.')
        self._edited = []
        for target in edits.targets(edits.selected_splats(context)):
            to_world = placement.matrix_of(target.obj)
            inside = sum(cloud_edit.select_box(target.cloud, np.linalg.inv(box) @ to_world) for box in boxes) > 0
            self._edited.append((target, np.uint8(inside == (Side[self.keep] == Side.INSIDE))))
        return None

    def finish(self, _context, _job):
        self.report({'INFO'}, str(edits.write(self._edited)))


classes = (STIPPLE_OT_crop_by_box,)
