# SPDX-License-Identifier: GPL-3.0-or-later
"""Object Data: source and budget of the splats."""

import bpy

from ..scene import splat_data, sync


class _SplatPanel:
    bl_space_type = 'PROPERTIES'
    bl_region_type = 'WINDOW'
    bl_context = 'data'

    @classmethod
    def poll(cls, context):
        return splat_data.is_splat_object(context.object)


class STIPPLE_PT_splats(_SplatPanel, bpy.types.Panel):
    bl_label = "Gaussian Splats"
    bl_order = -10

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        data = context.object.data
        stipple = data.stipple
        _draw_warnings(layout, data)
        count = splat_data.count(data)
        if stipple.source_kind != 'MODEL':
            layout.label(text=f"{count:,} splats", icon='OUTLINER_DATA_POINTCLOUD')
            return
        column = layout.column()
        column.enabled = not stipple.edited
        single = stipple.gaussians_per_anchor == 1
        column.prop(stipple, 'anchors', text="Splats" if single else "Anchor Budget")
        column.prop(stipple, 'anchors_render', text="Render Splats" if single else "Render Budget")
        if not single:
            row = column.row()
            row.alignment = 'RIGHT'
            row.label(text=f"{count:,} splats")
        column.prop(stipple, 'seed')
        column.prop(stipple, 'order')


class STIPPLE_PT_splats_source(_SplatPanel, bpy.types.Panel):
    bl_label = "Source"
    bl_parent_id = 'STIPPLE_PT_splats'
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        stipple = context.object.data.stipple
        layout.prop(stipple, 'source')
        if stipple.source_kind != 'MODEL':
            return
        column = layout.column()
        column.enabled = not stipple.edited
        column.prop(stipple, 'detail_weight')
        column.prop(stipple, 'color_from')
        column.operator('stipple.update_from_source', icon='FILE_REFRESH')


class STIPPLE_PT_splats_advanced(_SplatPanel, bpy.types.Panel):
    bl_label = "Advanced"
    bl_parent_id = 'STIPPLE_PT_splats'
    bl_options = {'DEFAULT_CLOSED'}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.object.data.stipple.source_kind == 'MODEL'

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        stipple = context.object.data.stipple
        layout.enabled = not stipple.edited
        layout.prop(stipple, 'gaussians_per_anchor')


def _draw_warnings(layout, data):
    stipple = data.stipple
    problem = sync.problems.get(data.name)
    if stipple.edited:
        box = layout.box()
        box.label(text="The splats were edited by hand", icon='LOCKED')
        row = box.row()
        row.operator('stipple.use_as_new_source')
        row.operator('stipple.revert_to_source')
    elif problem:
        box = layout.box()
        for i, line in enumerate(_wrapped(problem)):
            box.label(text=line, icon='ERROR' if i == 0 else 'BLANK1')
    changed = stipple.source_changed or (len(stipple.source_objects) > 0 and (
        stipple.source_detail_weight != stipple.detail_weight or stipple.source_color_from != stipple.color_from))
    if changed and not stipple.edited:
        box = layout.box()
        box.label(text="The source mesh has changed" if stipple.source_changed else "The source settings have changed",
                  icon='INFO')
        box.operator('stipple.update_from_source', icon='FILE_REFRESH')
    if bpy.ops.stipple.upgrade_to_point_cloud.poll():
        layout.operator('stipple.upgrade_to_point_cloud', icon='OUTLINER_DATA_POINTCLOUD')


def _wrapped(text, width=52):
    line = ''
    for word in text.split():
        if line and len(line) + len(word) + 1 > width:
            yield line
            line = ''
        line = f'{line} {word}'.strip()
    if line:
        yield line


classes = (STIPPLE_PT_splats, STIPPLE_PT_splats_source, STIPPLE_PT_splats_advanced)
