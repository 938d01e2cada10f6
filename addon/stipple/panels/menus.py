# SPDX-License-Identifier: GPL-3.0-or-later
"""Entries in Blender's own menus."""

import bpy


class STIPPLE_MT_add(bpy.types.Menu):
    bl_label = "Gaussian Splats"

    def draw(self, _context):
        self.layout.operator_context = 'INVOKE_DEFAULT'
        self.layout.operator('stipple.splats_from_mesh', text="From Selected Meshes", icon='MESH_DATA')
        self.layout.operator('stipple.splats_import', text="From File", icon='FILE')


def _draw_add(self, _context):
    self.layout.menu('STIPPLE_MT_add', icon='OUTLINER_DATA_POINTCLOUD')


def _draw_convert(self, _context):
    self.layout.separator()
    self.layout.operator_context = 'INVOKE_DEFAULT'
    self.layout.operator('stipple.splats_from_mesh', text="Gaussian Splats", icon='OUTLINER_DATA_POINTCLOUD')
    self.layout.operator('stipple.splats_to_volume', text="Splats to Volume", icon='OUTLINER_DATA_VOLUME')


def _draw_import(self, _context):
    self.layout.operator('stipple.splats_import', text="Gaussian Splats (.ply)")


def _draw_export(self, _context):
    self.layout.operator('stipple.splats_export', text="Gaussian Splats (.ply)")


_MENUS = (('VIEW3D_MT_add', _draw_add), ('VIEW3D_MT_object_convert', _draw_convert),
          ('TOPBAR_MT_file_import', _draw_import), ('TOPBAR_MT_file_export', _draw_export))


def register():
    for name, draw in _MENUS:
        getattr(bpy.types, name).append(draw)


def unregister():
    for name, draw in _MENUS:
        getattr(bpy.types, name).remove(draw)


classes = (STIPPLE_MT_add,)
