# SPDX-License-Identifier: GPL-3.0-or-later
"""A shadow catcher where the selected splats are: their ground, or their shape."""

import bpy
import numpy as np
from bpy.props import EnumProperty, FloatProperty, IntProperty

from .. import binding
from ..binding import cloud_edit
from ..jobs import JobOperator, Task
from ..scene.source import placement, proxies, sources, splat_data

# Half of the floor's splats or more may lie off the plane that was found; below this share it may be another surface.
_LEAST_IN_PLANE = 0.03


class STIPPLE_OT_add_shadow_catcher(JobOperator, bpy.types.Operator):
    """Add a plane or a mesh where the selected splats are, so that meshes cast shadows on them in the engine Cycles +
    Stipple. Only these shadows show"""

    bl_idname = 'stipple.add_shadow_catcher'
    bl_label = "Add Shadow Catcher"
    bl_options = {'REGISTER', 'UNDO', 'PRESET'}

    kind: EnumProperty(name="Shape", description="What shadows fall on", items=(
        ('PLANE', "Ground Plane", "A plane in the splats' floor, as large as they are"),
        ('MESH', "Mesh of Splats", "A closed mesh of the splats' own shape, for shadows on uneven ground and objects")))
    extend: FloatProperty(name="Extend", description="How much larger than the splats the plane is, as a share of "
                                                     "their size", default=0.1, min=0.0, soft_max=1.0,
                          subtype='FACTOR')
    resolution: IntProperty(name="Resolution", description="Voxels along the longest side of the mesh", default=128,
                            min=8, soft_max=512)
    threshold: FloatProperty(name="Threshold", description="How opaque a voxel has to be to lie inside the mesh",
                             default=0.5, min=0.001, max=0.999, subtype='FACTOR', precision=3)
    inset: FloatProperty(name="Inset", description="Voxels by which the mesh lies below the splats' surface, so that "
                                                   "objects that touch it are not inside", default=1.0, min=0.0,
                         soft_max=4.0)

    @classmethod
    def poll(cls, context):
        return context.mode == 'OBJECT' and any(splat_data.is_splat_object(obj)
                                                for obj in context.view_layer.objects.selected)

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, 'kind')
        for name in ('extend',) if self.kind == 'PLANE' else ('resolution', 'threshold', 'inset'):
            layout.prop(self, name)

    def invoke(self, context, _event):
        return self.run_in_window(context) if self.kind == 'MESH' else self.execute(context)

    def start(self, context):
        active, depsgraph = context.view_layer.objects.active, context.evaluated_depsgraph_get()
        selected = [obj for obj in context.view_layer.objects.selected if splat_data.is_splat_object(obj)]
        selected.sort(key=lambda obj: obj != active)
        objects = [obj.evaluated_get(depsgraph) for obj in selected]
        self._parent, self._matrix = selected[0], placement.matrix_of(objects[0])
        # Around the object's own origin, so that a scene far from the world's loses no digits.
        origin = self._matrix[:3, 3]
        instances = [(sources.cloud_from_object(obj), proxies.relative_to(origin, placement.matrix_of(obj)))
                     for obj in objects]
        work = self._plane(instances) if self.kind == 'PLANE' else self._mesh(instances)
        return Task(work)

    def _plane(self, instances):
        extend = self.extend

        def work(task):
            task.advance(0.0, 'Looking for the ground')
            cloud, matrix = instances[0] if len(instances) == 1 else (cloud_edit.merge(instances), np.eye(4))
            plane = cloud_edit.ground_plane(cloud, matrix)
            return plane, proxies.plane_over(cloud_edit.matrix_of(plane), plane.extent_min, plane.extent_max, extend)
        return work

    def _mesh(self, instances):
        native, resolution, threshold = sources.context(), self.resolution, self.threshold

        def work(task):
            voxels = task.run(binding.volume.Volume.voxelize_start(native, instances, resolution, 0.0), 0.0, 0.6)
            volume = binding.volume.Volume.of_job(voxels)
            mesh = binding.mesh.Mesh.of_job(task.run(volume.mesh_start(threshold, 0.0, True), 0.6, 0.95))
            task.advance(0.95, 'Reading the mesh')
            return (*mesh.read(), volume.info().voxel_size)
        return work

    def finish(self, context, job):
        if self.kind == 'PLANE':
            plane, (positions, triangles) = job.result
            depth = plane.tolerance
            share = plane.inlier_count / max(plane.considered_count, 1)
            found = f'in the plane of {share:.0%} of the splats'
        else:
            positions, triangles, voxel_size = job.result
            depth, share = self.inset * voxel_size, 1.0
            found = f'{len(triangles):,} triangles, voxels of {voxel_size:.4g} m'
        obj = proxies.new_object(f'{self._parent.name} Shadow Catcher', positions, triangles, self._matrix,
                                 context.collection, 'CATCHER')
        if self.kind == 'MESH':
            proxies.smooth_and_shrink(obj, depth)
        proxies.keep_with(obj, self._parent)
        for other in list(context.view_layer.objects.selected):
            other.select_set(False)
        obj.select_set(True)
        context.view_layer.objects.active = obj
        raised = self._raise_margin(context.scene, depth)
        hint = '' if context.scene.render.engine == 'STIPPLE_CYCLES' else '; render with Cycles + Stipple'
        doubtful = share < _LEAST_IN_PLANE
        if doubtful:
            found += ', which may be no ground: check where it lies'
        self.report({'WARNING' if doubtful else 'INFO'}, f"'{obj.name}': {found}{raised}{hint}")

    def _raise_margin(self, scene, depth):
        """Splats that are nearer than the catcher by more than the margin get no shadow: those of its own surface are
        its depth away, and as thick again."""
        needed = 4 * depth
        if needed <= scene.stipple.shadow_margin:
            return ''
        scene.stipple.shadow_margin = needed
        return f'; Shadow Margin is now {needed:.3g} m'


classes = (STIPPLE_OT_add_shadow_catcher,)
