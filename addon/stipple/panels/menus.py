# SPDX-License-Identifier: GPL-3.0-or-later
"""Entries in Blender's own menus."""

import bpy

from .. import selection_tools
from ..scene import geometry
from ..scene.source import splat_data


class STIPPLE_MT_add(bpy.types.Menu):
    bl_label = "Gaussian Splats"

    def draw(self, _context):
        self.layout.operator_context = 'INVOKE_DEFAULT'
        self.layout.operator('stipple.splats_from_mesh', text="From Selected Meshes", icon='MESH_DATA')
        self.layout.operator('stipple.splats_import', text="From File", icon='FILE')
        self.layout.operator('stipple.splats_from_image', text="From Image", icon='IMAGE_DATA')
        self.layout.operator('stipple.random_splats', text="Random from Model", icon='SHADERFX')
        self.layout.operator('stipple.splats_from_render', text="From Render of Selected", icon='RENDER_STILL')


class STIPPLE_MT_object(bpy.types.Menu):
    bl_label = "Gaussian Splats"

    def draw(self, _context):
        layout = self.layout
        layout.operator_context = 'INVOKE_DEFAULT'
        layout.operator('stipple.level_to_ground', icon='GRID')
        layout.operator('stipple.level_to_ground', text="Level to Three Points", icon='BLANK1').use_points = True
        layout.operator('stipple.set_scale', icon='DRIVER_DISTANCE')
        layout.separator()
        layout.operator('stipple.delete_floaters', icon='BRUSH_DATA')
        layout.operator('stipple.crop_by_box', icon='CUBE')
        layout.operator('stipple.crop_by_mesh', icon='MESH_ICOSPHERE')
        layout.operator('stipple.clear_mask', icon='X')
        layout.separator()
        layout.operator_menu_enum('stipple.add_shadow_catcher', 'kind', icon='SHADING_RENDERED')
        layout.menu('STIPPLE_MT_select', icon='RESTRICT_SELECT_OFF')
        layout.separator()
        layout.operator('stipple.add_budget', icon='MOD_DECIM')
        layout.operator('stipple.merge_splats', icon='AUTOMERGE_OFF')
        layout.operator('stipple.apply_transform', icon='OBJECT_ORIGIN')
        layout.separator()
        layout.operator('stipple.bind_to_mesh', icon='MOD_MESHDEFORM')
        layout.operator('stipple.unbind', icon='BLANK1')


class STIPPLE_MT_select(bpy.types.Menu):
    bl_label = "Select Splats"

    def draw(self, _context):
        layout = self.layout
        layout.operator_context = 'INVOKE_DEFAULT'
        for name, text in selection_tools.NAMES:
            layout.operator(name, text=text)
        layout.separator()
        for action, text in (('SELECT', "All"), ('DESELECT', "None"), ('INVERT', "Invert")):
            layout.operator('stipple.select_all', text=text).action = action
        layout.operator('stipple.select_grow', text="Grow")
        layout.operator('stipple.select_shrink', text="Shrink")
        layout.separator()
        layout.operator('stipple.erase_selected', text="Erase", icon='HIDE_ON')
        layout.operator('stipple.keep_selected', text="Keep Only")
        layout.operator('stipple.separate_selected', text="Separate")
        layout.operator('stipple.fill_erased', text="Fill")


def _draw_adapt(self, context):
    active = context.object
    if active is not None and active.type == 'MESH' and not splat_data.is_splat_object(active):
        self.layout.separator()
        self.layout.operator_context = 'INVOKE_DEFAULT'
        self.layout.operator('stipple.mesh_adapt', icon='MOD_SHRINKWRAP')
        self.layout.operator('stipple.mesh_adapt_to_images', icon='IMAGE_BACKGROUND')
        self.layout.operator('stipple.mesh_adapt_to_renders', icon='RENDER_STILL')
        self.layout.operator('stipple.mesh_even_out', icon='MOD_SMOOTH')


def _draw_object(self, context):
    if splat_data.is_splat_object(context.object) or geometry.may_carry_splats(context.object):
        self.layout.separator()
        self.layout.menu('STIPPLE_MT_object', icon='OUTLINER_DATA_POINTCLOUD')


def _draw_add(self, _context):
    self.layout.menu('STIPPLE_MT_add', icon='OUTLINER_DATA_POINTCLOUD')


def _draw_convert(self, _context):
    self.layout.separator()
    self.layout.operator_context = 'INVOKE_DEFAULT'
    self.layout.operator('stipple.splats_from_mesh', text="Gaussian Splats", icon='OUTLINER_DATA_POINTCLOUD')
    self.layout.operator('stipple.splats_to_volume', text="Splats to Volume", icon='OUTLINER_DATA_VOLUME')
    self.layout.operator('stipple.splats_to_mesh', text="Splats to Mesh", icon='OUTLINER_OB_MESH')


def _draw_import(self, _context):
    self.layout.operator('stipple.splats_import', text="Gaussian Splats")
    self.layout.operator('stipple.cameras_import', text="Cameras of Photos (COLMAP, transforms.json)")


def _draw_background_images(self, _context):
    self.layout.operator('stipple.cameras_import', icon='FILE_FOLDER')


def _draw_external_data(self, _context):
    self.layout.separator()
    self.layout.operator_context = 'INVOKE_DEFAULT'
    self.layout.operator('stipple.collect_sources', icon='OUTLINER_DATA_POINTCLOUD')
    self.layout.operator('stipple.pack_series', icon='PACKAGE')


def _draw_export(self, _context):
    self.layout.operator('stipple.splats_export', text="Gaussian Splats")
    self.layout.operator('stipple.collect_for_training', text="Images and Points for Training")


_MENUS = (('VIEW3D_MT_add', _draw_add), ('VIEW3D_MT_object_convert', _draw_convert),
          ('VIEW3D_MT_object', _draw_object), ('VIEW3D_MT_object', _draw_adapt),
          ('MESH_MT_shape_key_context_menu', _draw_adapt), ('TOPBAR_MT_file_import', _draw_import),
          ('TOPBAR_MT_file_export', _draw_export), ('TOPBAR_MT_file_external_data', _draw_external_data),
          ('DATA_PT_camera_background_image', _draw_background_images))


def register():
    for name, draw in _MENUS:
        getattr(bpy.types, name).append(draw)


def unregister():
    for name, draw in _MENUS:
        getattr(bpy.types, name).remove(draw)


classes = (STIPPLE_MT_add, STIPPLE_MT_object, STIPPLE_MT_select)
