# SPDX-License-Identifier: GPL-3.0-or-later
"""Selected splat objects become one closed mesh for shadows, physics and snapping."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from .. import binding
from ..jobs import JobOperator, Task
from ..scene.source import placement, proxies, sources, splat_data


class STIPPLE_OT_splats_to_mesh(JobOperator, bpy.types.Operator):
    """Make a closed mesh around the selected splats, for shadows, physics and snapping. It is not a textured
    reconstruction"""

    bl_idname = 'stipple.splats_to_mesh'
    bl_label = "Splats to Mesh"
    bl_options = {'REGISTER', 'UNDO', 'PRESET'}

    resolution: IntProperty(name="Resolution", description="Voxels along the longest side, where Voxel Size is 0",
                            default=128, soft_min=8, soft_max=1024)
    voxel_size: FloatProperty(name="Voxel Size",
                              description="Side of a voxel, 0 to take the resolution. Details smaller "
                                          "than two voxels are lost", default=0.0, soft_min=0.0, subtype='DISTANCE',
                              unit='LENGTH', precision=4)
    threshold: FloatProperty(name="Threshold", description="How opaque a voxel has to be to lie inside the mesh: a "
                                                           "low value includes haze, a high one only what is solid",
                             default=0.5, min=0.001, max=0.999, subtype='FACTOR', precision=3)
    adaptivity: FloatProperty(name="Adaptivity", description="Make larger faces where the surface is flat", default=0.0,
                              min=0.0, max=1.0, subtype='FACTOR')
    largest_only: BoolProperty(name="Largest Piece Only", description="Leave out floating pieces and hollows inside",
                               default=True)
    purpose: EnumProperty(name="Use As", description="What the mesh is for", items=proxies.PURPOSES)

    @classmethod
    def poll(cls, context):
        return context.mode == 'OBJECT' and any(splat_data.is_splat_object(obj)
                                                for obj in context.view_layer.objects.selected)

    def invoke(self, context, _event):
        return context.window_manager.invoke_props_dialog(self)

    def execute(self, context):
        return JobOperator.execute(self, context) if bpy.app.background else self.run_in_window(context)

    def start(self, context):
        active, depsgraph = context.view_layer.objects.active, context.evaluated_depsgraph_get()
        selected = [obj for obj in context.view_layer.objects.selected if splat_data.is_splat_object(obj)]
        selected.sort(key=lambda obj: obj != active)
        objects = [obj.evaluated_get(depsgraph) for obj in selected]
        self._name, self._matrix = selected[0].name, placement.matrix_of(objects[0])
        origin = self._matrix[:3, 3]
        # Around the object's own origin, so that a scene far from the world's loses no digits.
        instances = [(sources.cloud_from_object(obj), proxies.relative_to(origin, placement.matrix_of(obj)))
                     for obj in objects]
        native, resolution, voxel_size = sources.context(), self.resolution, self.voxel_size
        settings = (self.threshold, self.adaptivity, self.largest_only)

        def work(task):
            voxels = task.run(binding.volume.Volume.voxelize_start(native, instances, resolution, voxel_size), 0.0, 0.6)
            volume = binding.volume.Volume.of_job(voxels)
            mesh = binding.mesh.Mesh.of_job(task.run(volume.mesh_start(*settings), 0.6, 0.95))
            task.advance(0.95, 'Reading the mesh')
            return (*mesh.read(), volume.info().voxel_size)
        return Task(work)

    def finish(self, context, job):
        positions, triangles, voxel_size = job.result
        obj = proxies.new_object(f'{self._name} Mesh', positions, triangles, self._matrix, context.collection,
                                 self.purpose)
        for other in list(context.view_layer.objects.selected):
            other.select_set(False)
        obj.select_set(True)
        context.view_layer.objects.active = obj
        self.report({'INFO'}, f"{len(triangles):,} triangles, voxels of {voxel_size:.4g} m, in '{obj.name}'")


classes = (STIPPLE_OT_splats_to_mesh,)
