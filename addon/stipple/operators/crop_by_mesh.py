# SPDX-License-Identifier: GPL-3.0-or-later
"""Hides the selected splats outside (or inside) the other selected objects' meshes."""

import bpy

from ..binding import cloud_edit
from ..binding.structs import Side
from ..jobs import JobOperator, Task
from ..properties import SIDES
from ..scene import shapes
from ..scene.source import edits, placement, sources


class STIPPLE_OT_crop_by_mesh(JobOperator, bpy.types.Operator):
    """Keep the splats whose centers are inside the other selected meshes; small holes in them do not matter"""

    bl_idname = 'stipple.crop_by_mesh'
    bl_label = "Crop by Mesh"
    bl_options = {'REGISTER', 'UNDO'}

    keep: bpy.props.EnumProperty(name="Keep", description="Which side of the meshes' surfaces stays", items=SIDES)

    @classmethod
    def poll(cls, context):
        return context.mode == 'OBJECT' and bool(edits.selected_splats(context))

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, context):
        mesh = shapes.bare_mesh(sources.context(), shapes.cutters(context), context.evaluated_depsgraph_get())
        side = Side[self.keep]
        wanted = [(target, placement.matrix_of(target.obj)) for target in
                  edits.targets(edits.selected_splats(context))]

        def work(task):
            masks = []
            for i, (target, to_world) in enumerate(wanted):
                selection = cloud_edit.select_mesh_start(target.cloud, to_world, mesh, side)
                task.run(selection.job, i / len(wanted), (i + 1) / len(wanted))
                masks.append((target, selection.mask))
            return masks
        return Task(work)

    def finish(self, _context, job):
        self.report({'INFO'}, str(edits.write(job.result)))


classes = (STIPPLE_OT_crop_by_mesh,)
