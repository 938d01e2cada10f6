# SPDX-License-Identifier: GPL-3.0-or-later
"""Hides the selected splats outside (or inside) the other selected objects' meshes."""

import bpy

from ..binding import cloud_edit
from ..jobs import JobOperator, Task
from ..properties import CROP_TIMES, SIDES
from ..scene import shapes
from ..scene.source import clip_clouds, edits, placement, sources


class STIPPLE_OT_crop_by_mesh(JobOperator, bpy.types.Operator):
    """Keep the splats whose centers are inside the other selected meshes; small holes in them do not matter"""

    bl_idname = 'stipple.crop_by_mesh'
    bl_label = "Crop by Mesh"
    bl_options = {'REGISTER', 'UNDO'}

    keep: bpy.props.EnumProperty(name="Keep", description="Which side of the meshes' surfaces stays", items=SIDES)

    times: bpy.props.EnumProperty(name="Time", description="When splats that move are looked at", items=CROP_TIMES)

    @classmethod
    def poll(cls, context):
        return context.mode == 'OBJECT' and bool(edits.selected_splats(context))

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, context):
        mesh = shapes.bare_mesh(sources.context(), shapes.cutters(context), context.evaluated_depsgraph_get())
        wanted, keep = [], self.keep
        for target in edits.targets(edits.selected_splats(context)):
            readers = clip_clouds.readers(target, self.times == 'CLIP')
            wanted.append((target, readers, placement.matrix_of(target.obj)))

        def work(task):
            def inside(cloud, to_world, start, end):
                selection = cloud_edit.select_mesh_start(cloud, to_world, mesh)
                task.run(selection.job, start, end)
                return selection.mask
            return clip_clouds.crop(task, wanted, keep, inside)
        return Task(work)

    def finish(self, _context, job):
        self.report({'INFO'}, str(edits.write(job.result)))


classes = (STIPPLE_OT_crop_by_mesh,)
