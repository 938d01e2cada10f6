# SPDX-License-Identifier: GPL-3.0-or-later
"""The active splat object becomes a file."""

import bpy
from bpy.props import BoolProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from ..binding.errors import invalid
from ..jobs import JobOperator
from ..scene import sources, splat_data

ENDINGS = ('.ply',)


class STIPPLE_OT_splats_export(JobOperator, bpy.types.Operator, ExportHelper):
    """Export the active object's splats to a file"""

    bl_idname = 'stipple.splats_export'
    bl_label = "Export Splats"
    bl_options = {'REGISTER', 'PRESET'}

    filename_ext = '.ply'
    filter_glob: StringProperty(default='*.ply', options={'HIDDEN'})
    apply_transform: BoolProperty(name="Apply Transform", description="Write the splats where the object puts them, with "
                                  "their harmonics turned; otherwise in the object's own space", default=True)
    ascii: BoolProperty(name="Text", description="Write numbers as text, several times larger", default=False)

    @classmethod
    def poll(cls, context):
        return splat_data.is_splat_object(context.object)

    def start(self, context):
        path = bpy.path.abspath(self.filepath)
        if not path.lower().endswith(ENDINGS):
            raise invalid(f"'{path}' has an ending that is no splat format; allowed is {', '.join(ENDINGS)}.")
        evaluated = context.object.evaluated_get(context.evaluated_depsgraph_get())
        cloud = sources.cloud_from_object(evaluated)
        if self.apply_transform:
            cloud = cloud.transformed(evaluated.matrix_world)
        cloud.save(path, ascii=self.ascii)
        self._count = cloud.info().count
        return None

    def finish(self, _context, _job):
        self.report({'INFO'}, f"{self._count:,} splats written to '{self.filepath}'")


classes = (STIPPLE_OT_splats_export,)
