# SPDX-License-Identifier: GPL-3.0-or-later
"""Series of splat files go into the .blend, all of their files."""

import bpy

from ..binding.errors import invalid
from ..jobs import JobOperator
from ..scene.source import source_packing


class STIPPLE_OT_pack_series(JobOperator, bpy.types.Operator):
    """Pack all files of the splat series into the .blend, which Pack Resources passes over. Unpack Resources brings
    them back"""

    bl_idname = 'stipple.pack_series'
    bl_label = "Pack Splat Series"
    bl_options = {'REGISTER', 'UNDO'}

    def start(self, _context):
        self._series = source_packing.series()
        if not self._series:
            raise invalid('No splats of this file come from a series of files.')

    def finish(self, _context, _job):
        count = total = 0
        for data in self._series:
            files, size_bytes = source_packing.pack(data)
            count, total = count + files, total + size_bytes
        self.report({'INFO'}, f'{count:,} files packed, {total / 2**20:,.1f} MiB')


classes = (STIPPLE_OT_pack_series,)
