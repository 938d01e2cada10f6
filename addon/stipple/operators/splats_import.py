# SPDX-License-Identifier: GPL-3.0-or-later
"""A splat file becomes a splat object, bit for bit."""

import os

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ImportHelper
from mathutils import Matrix

from ..binding.cloud import Cloud
from ..jobs import JobOperator
from ..scene import sources, splat_data, sync


class STIPPLE_OT_splats_import(JobOperator, bpy.types.Operator, ImportHelper):
    """Import Gaussian splats from a file"""

    bl_idname = 'stipple.splats_import'
    bl_label = "Import Splats"
    bl_options = {'REGISTER', 'UNDO', 'PRESET'}

    filename_ext = '.ply'
    filter_glob: StringProperty(default='*.ply', options={'HIDDEN'})
    up_axis: bpy.props.EnumProperty(
        name="Up Axis", description="Which way is up in the file; the object is turned, its data stay as they are",
        items=(('Z', "Z Up", "As in Blender"), ('-Y', "-Y Up", "As most captured scenes, the frame of their first camera"),
               ('Y', "Y Up", "As in glTF and most game engines")), default='Z')

    def start(self, _context):
        self._splats = Cloud.load(sources.context(), bpy.path.abspath(self.filepath)).read()
        return None

    def finish(self, context, _job):
        name = os.path.splitext(os.path.basename(self.filepath))[0]
        data = splat_data.new_data(name)
        data.stipple.source = sources.blend_path(bpy.path.abspath(self.filepath))
        data.stipple.source_kind = 'CLOUD'
        sync.write(data, self._splats, '')
        obj = splat_data.new_object(name, data)
        turn = {'Z': 0.0, '-Y': -1.5707963267948966, 'Y': 1.5707963267948966}[self.up_axis]
        obj.matrix_world = Matrix.Rotation(turn, 4, 'X')
        context.collection.objects.link(obj)
        for other in list(context.view_layer.objects.selected):
            other.select_set(False)
        obj.select_set(True)
        context.view_layer.objects.active = obj
        self.report({'INFO'}, f"{self._splats.count:,} splats in '{obj.name}'")


classes = (STIPPLE_OT_splats_import,)
