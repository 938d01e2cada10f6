# SPDX-License-Identifier: GPL-3.0-or-later
"""Hides haze, blobs and specks that captures leave in the air."""

import bpy
from bpy.props import BoolProperty, FloatProperty, IntProperty

from ..binding import cloud_edit
from ..binding.errors import invalid
from ..jobs import JobOperator, Task
from ..scene.source import edits


class STIPPLE_OT_delete_floaters(JobOperator, bpy.types.Operator):
    """Hide splats that are faint, far too large, or away from all others. Clear Mask brings them back"""

    bl_idname = 'stipple.delete_floaters'
    bl_label = "Delete Floaters"
    bl_options = {'REGISTER', 'UNDO', 'PRESET'}

    by_opacity: BoolProperty(name="Faint", default=True)
    min_opacity: FloatProperty(name="Minimum Opacity", default=0.02, min=0.0, max=1.0, subtype='FACTOR')
    by_size: BoolProperty(name="Large", default=True)
    max_size: FloatProperty(name="Maximum Size", description="Largest standard deviation along the longest axis, in "
                                                             "the file's units; 0 derives it from the splats' own "
                                                             "sizes", default=0.0, min=0.0)
    by_connectivity: BoolProperty(name="Isolated", default=True)
    radius: FloatProperty(name="Gap", description="Splats within this distance belong to one group, in the file's "
                                                  "units; 0 derives it from their distances", default=0.0, min=0.0)
    min_group: IntProperty(name="Smallest Group",
                           description="Groups of fewer splats are hidden, 0 for a thousandth of all", default=0, min=0)

    @classmethod
    def poll(cls, context):
        return context.mode == 'OBJECT' and bool(edits.selected_splats(context))

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, context):
        if not (self.by_opacity or self.by_size or self.by_connectivity):
            raise invalid('No kind of floater is chosen; choose faint, large or isolated ones.')
        settings = cloud_edit.FloaterSettings(self.by_opacity, self.by_size, self.by_connectivity, self.min_opacity,
                                              self.max_size, self.radius, self.min_group)
        wanted = edits.targets(edits.selected_splats(context))

        def work(task):
            found = []
            for i, target in enumerate(wanted):
                # What is hidden already neither counts as a floater again nor holds others together.
                cloud = cloud_edit.keep(target.cloud, target.mask)
                floaters = cloud_edit.select_floaters_start(cloud, settings)
                task.run(floaters.job, i / len(wanted), (i + 1) / len(wanted))
                found.append((target, edits.spread(target.mask, floaters.mask), floaters.report))
            return found
        return Task(work)

    def finish(self, _context, job):
        reports = [report for _, _, report in job.result]
        outcome = edits.write([(target, mask) for target, mask, _ in job.result])
        faint, large, isolated = (sum(getattr(r, name) for r in reports) for name in ('faint', 'large', 'isolated'))
        self.report({'INFO'}, f'{outcome}: {faint:,} faint, {large:,} large, {isolated:,} isolated')


classes = (STIPPLE_OT_delete_floaters,)
