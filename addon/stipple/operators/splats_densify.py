# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats of an object multiply and go where views ask for it."""

import bpy
from bpy.props import IntProperty, StringProperty

from ..jobs import JobOperator, ViewsFirst
from ..scene.fit import densifying, fitting, strategies
from ..scene.source import decoded, edits, splat_data


class STIPPLE_OT_splats_densify(ViewsFirst, JobOperator, bpy.types.Operator):
    """Split, copy and remove the active object's splats where renders of the selected objects, or the photographs of a
    data set, ask for it. Nothing is trained"""

    bl_idname = 'stipple.splats_densify'
    bl_label = "Densify Splats"
    bl_options = {'REGISTER', 'UNDO'}

    strategy: StringProperty(name="Strategy", description="How splats are added and removed; empty for the strategy of "
                             "the fit's settings")
    events: IntProperty(name="Events", description="How often splats multiply and are removed; between two events all"
                                                   " views are drawn again", default=1, min=1, soft_max=20, max=1000)
    max_splats: IntProperty(name="Splats", description="Maximum number of splats; 0 is twice as many as there are",
                            default=0, min=0, max=100000000)

    @classmethod
    def poll(cls, context):
        return (context.mode == 'OBJECT' and splat_data.is_splat_object(context.object)
                and context.object.data.library is None and not fitting.state.is_running)

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, context):
        self._object = context.object
        edits.refuse_sequence(self._object)
        edits.refuse_moving(self._object)
        settings = context.scene.stipple.fit
        strategy = self.strategy or strategies.text_of(settings)
        strategies.require(strategy)
        objects = [] if settings.views_from == 'DATASET' else fitting.seen_objects(context)
        cloud = decoded.full_cloud(self._object.data)
        self._count = cloud.info().count
        chosen = {'strategy': strategy, 'event_count': self.events,
                  'max_splats': self.max_splats, 'seed': settings.seed}
        return densifying.DensifyTask(context, objects, settings, self._object, cloud, chosen)

    def finish(self, _context, job):
        model, cloud = job.result
        count = densifying.replace(self._object, model, cloud)
        self.report({'INFO'}, f"{count:,} splats in '{self._object.name}', {self._count:,} before")


classes = (STIPPLE_OT_splats_densify,)
