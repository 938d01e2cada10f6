# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotates and moves what is selected so that the active splats' floor is the ground of the world."""

import bpy
from bpy.props import BoolProperty, FloatProperty, FloatVectorProperty, IntProperty
from mathutils import Matrix

from ..binding import cloud_edit
from ..jobs import JobOperator
from ..scene.source import placement, sources, splat_data
from ..scene.view import picking
from ..viewport import picked_points


class STIPPLE_OT_level_to_ground(picking.PointOperator, JobOperator, bpy.types.Operator):
    """Make the floor of the active splats horizontal and put it at height 0; everything selected moves along"""

    bl_idname = 'stipple.level_to_ground'
    bl_label = "Level to Ground"
    bl_options = {'REGISTER', 'UNDO'}

    point_count = 3
    use_points: BoolProperty(name="Pick Points", description="Three points of the floor, instead of a search for it",
                             default=False)
    points: FloatVectorProperty(name="Points", size=9, options={'SKIP_SAVE', 'HIDDEN'})
    max_tilt: FloatProperty(name="Maximum Tilt", description="Maximum angle between the floor and level now",
                            default=0.785398, min=0.0174533, max=1.570796, subtype='ANGLE')
    seed: IntProperty(name="Seed", description="Another seed may find another plane", default=0, min=0)

    @classmethod
    def poll(cls, context):
        return splat_data.is_splat_object(context.object) and context.mode == 'OBJECT'

    def marks_of(self, picked):
        return picked_points.PickedPoints(picked)

    def start(self, context):
        if self.use_points:
            self._matrix = cloud_edit.level_points(sources.context().library, self.points)
            self._found, self._doubtful = 'three points', False
        else:
            cloud = sources.cloud_from_object(context.object)
            plane = cloud_edit.ground_plane(cloud, placement.matrix_of(context.object), max_tilt=self.max_tilt,
                                            seed=self.seed)
            self._matrix = cloud_edit.matrix_of(plane)
            self._found = f'{plane.inlier_count:,} of {plane.considered_count:,} splats'
            self._doubtful = plane.inlier_count < 0.03 * plane.considered_count
        return None

    def finish(self, context, _job):
        placement.move(placement.chosen(context), Matrix(self._matrix.tolist()))
        self.report({'WARNING' if self._doubtful else 'INFO'}, f'Leveled to the plane of {self._found}')


classes = (STIPPLE_OT_level_to_ground,)
