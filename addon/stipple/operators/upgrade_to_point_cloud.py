# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats that an older Blender stored on a mesh move to a native point cloud, bit for bit."""

import bpy

from .. import version
from ..jobs import JobOperator
from ..scene.source import splat_data, sync


class STIPPLE_OT_upgrade_to_point_cloud(JobOperator, bpy.types.Operator):
    """Move the splats from a mesh to a point cloud, Blender's own kind of splat object"""

    bl_idname = 'stipple.upgrade_to_point_cloud'
    bl_label = "Upgrade to Point Cloud"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context):
        return (version.HAS_SIZED_POINT_CLOUDS and splat_data.is_splat_object(context.object)
                and context.object.type == 'MESH' and context.mode == 'OBJECT')

    def start(self, context):
        self._splats = splat_data.read_ungraded(context.object.data)
        return None

    def finish(self, context, _job):
        mesh = context.object.data
        cloud = splat_data.new_data(mesh.name)
        with sync.paused():
            sync.copy_settings(mesh, cloud)
        sync.write(cloud, self._splats, mesh.get(sync.WRITTEN_KEY, ''))
        for old in [o for o in bpy.data.objects if o.data == mesh]:
            new = bpy.data.objects.new(old.name, cloud)
            new.matrix_world = old.matrix_world
            new.parent = old.parent
            for collection in old.users_collection:
                collection.objects.link(new)
            old_name = old.name
            bpy.data.objects.remove(old)
            new.name = old_name
        self.report({'INFO'}, f"{self._splats.count:,} splats are a point cloud now")


classes = (STIPPLE_OT_upgrade_to_point_cloud,)
