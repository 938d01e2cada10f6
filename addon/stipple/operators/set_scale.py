# SPDX-License-Identifier: GPL-3.0-or-later
"""Scales what is selected so that two points are as far apart as they are in reality."""

import bpy
from bpy.props import FloatProperty, FloatVectorProperty
from mathutils import Matrix

from ..binding import cloud_edit
from ..jobs import JobOperator
from ..scene.source import placement, sources, splat_data
from ..scene.view import picking
from ..viewport import picked_points


class STIPPLE_OT_set_scale(picking.PointOperator, JobOperator, bpy.types.Operator):
    """Pick two points whose distance you know; everything selected is scaled about the world's origin to match"""

    bl_idname = 'stipple.set_scale'
    bl_label = "Set Scale"
    bl_options = {'REGISTER', 'UNDO'}

    point_count = 2
    use_points = True
    points: FloatVectorProperty(name="Points", size=6, options={'SKIP_SAVE', 'HIDDEN'})
    length: FloatProperty(name="Length", description="How far apart the two points are", default=1.0, min=1e-6,
                          subtype='DISTANCE', unit='LENGTH')

    @classmethod
    def poll(cls, context):
        return splat_data.is_splat_object(context.object) and context.mode == 'OBJECT'

    def marks_of(self, picked):
        return picked_points.PickedPoints(picked)

    def start(self, _context):
        matrix = cloud_edit.scale_points(sources.context().library, self.points, self.length)
        self._factor = matrix[0, 0]
        self._matrix = Matrix(matrix.tolist())
        return None

    def finish(self, context, _job):
        placement.move(placement.chosen(context), self._matrix)
        self.report({'INFO'}, f'Scaled by {self._factor:.4g}')


classes = (STIPPLE_OT_set_scale,)
