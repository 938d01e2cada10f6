# SPDX-License-Identifier: GPL-3.0-or-later
"""Object Data: budget and source of the splats.

The budget stands right under the datablock's name: a panel of its own would come after Vertex Groups,
Shape Keys and all else that meshes have.
"""

import bpy

from .. import choices
from . import source_state
from ..scene import geometry
from ..scene.source import (bound, decoded, erased, exporting, frame_budgets, masks, source_settings, sources,
                            splat_data, sync)
from ..scene.view import viewed
from .text import draw_anchors, draw_color_from


SEPARATOR = ' \u00b7 '
NARROW_PX = 300  # a Properties editor in which the budget's line needs two


class _SplatPanel:
    bl_space_type = 'PROPERTIES'
    bl_region_type = 'WINDOW'
    bl_context = 'data'
    bl_options = {'DEFAULT_CLOSED'}

    @classmethod
    def poll(cls, context):
        return splat_data.is_splat_object(context.object)


class STIPPLE_PT_source(_SplatPanel, bpy.types.Panel):
    bl_label = "Splat Source"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        stipple = context.object.data.stipple
        if stipple.source_file is None:
            layout.prop(stipple, 'source')
        else:
            layout.prop(stipple.source_file, 'filepath', text="Source")
        if source_settings.of(stipple).has_source:
            layout.operator('stipple.relink', icon='FILEBROWSER')
        if stipple.fit_report is not None:
            layout.operator('stipple.show_report', icon='GRAPH')
        if not stipple.source_objects:
            return
        column = layout.column()
        column.enabled = not stipple.edited
        column.prop(stipple, 'refine')
        column.prop(stipple, 'detail_weight')
        draw_color_from(column, stipple)
        column.operator('stipple.update_from_source', icon='FILE_REFRESH')


class STIPPLE_PT_grade(_SplatPanel, bpy.types.Panel):
    bl_label = "Color Grade"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        stipple = context.object.data.stipple
        for name in ('exposure', 'tint', 'saturation', 'grade_opacity'):
            layout.prop(stipple, name)


class STIPPLE_PT_clean_up(_SplatPanel, bpy.types.Panel):
    bl_label = "Splat Clean Up"

    def draw(self, context):
        layout = self.layout
        stipple = context.object.data.stipple
        column = layout.column(align=True)
        if not source_settings.of(stipple).takes_mask and not stipple.edited:
            layout.label(text="Decoded anew at each budget", icon='INFO')
            layout.operator('stipple.use_as_new_source')
            column.enabled = False
        column.operator_context = 'INVOKE_DEFAULT'
        column.operator('stipple.delete_floaters')
        column.operator('stipple.crop_by_box')
        column.operator('stipple.crop_by_mesh')


class STIPPLE_PT_binding(_SplatPanel, bpy.types.Panel):
    bl_label = "Splat Binding"

    def draw(self, context):
        layout = self.layout
        data = context.object.data
        if not bound.is_bound(data):
            if not data.stipple.source_objects:
                layout.label(text="Select the mesh as well")
            layout.operator_context = 'INVOKE_DEFAULT'
            layout.operator('stipple.bind_to_mesh', icon='MOD_MESHDEFORM')
            return
        stipple = data.stipple
        column = layout.column()
        name = stipple.bind_object.name if stipple.bind_object is not None else "nothing: the mesh is gone"
        column.label(text=f"Bound to {name}", icon='MOD_MESHDEFORM')
        reach = next(text for key, text, _ in choices.REACHES if key == stipple.bind_reach)
        _draw_fixed(column, "Bind", reach)
        column.enabled = not stipple.edited
        column.prop(stipple, 'bind_follow')
        layout.operator('stipple.unbind', icon='X')


class STIPPLE_PT_advanced(_SplatPanel, bpy.types.Panel):
    bl_label = "Splat Advanced"

    @classmethod
    def poll(cls, context):
        if not super().poll(context):
            return False
        known = source_settings.of(context.object.data.stipple)
        return known.max_gaussians > 1 or known.has_order

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        stipple = context.object.data.stipple
        layout.enabled = not stipple.edited
        known = source_settings.of(stipple)
        if known.min_gaussians < known.max_gaussians:
            layout.prop(stipple, 'gaussians_per_anchor')
        elif known.max_gaussians > 1:
            _draw_fixed(layout, "Splats per Anchor", f"{known.max_gaussians}, as learned")
        if known.has_order:
            column = layout.column()
            column.active = not stipple.smooth_budget
            column.prop(stipple, 'order')


def _draw_budget(self, context):
    obj = context.object
    if not splat_data.is_splat_object(obj):
        return
    data = obj.data
    stipple = data.stipple
    box = self.layout.box()
    box.use_property_split = True
    label = _shown_label(data)
    narrow = context.region.width < NARROW_PX * context.preferences.system.ui_scale
    for i, line in enumerate(label.split(SEPARATOR) if narrow else [label]):
        box.label(text=line, icon='OUTLINER_DATA_POINTCLOUD' if i == 0 else 'BLANK1')
    _draw_hidden(box, data)
    _draw_warnings(box, data)
    known = source_settings.of(stipple)
    if known.counts_splats or stipple.is_sequence:
        if stipple.is_sequence or known.least_budget < sources.visible_count(stipple):
            _draw_tree_budget(box, stipple)
        return
    if not known.has_budget:
        box.operator('stipple.add_budget', icon='MOD_DECIM')
        return
    column = box.column()
    column.enabled = not stipple.edited
    each = sources.gaussians_per_anchor(stipple)
    draw_anchors(column, stipple, 'anchors', each)
    draw_anchors(column, stipple, 'anchors_render', each, "Render")
    column.prop(stipple, 'detail')
    if known.has_smooth:
        column.prop(stipple, 'smooth_budget', text="Smooth")
    if known.has_seed:
        column.prop(stipple, 'seed')
    if frame_budgets.is_animated(data):
        column.operator('stipple.decode_budgets', icon='RENDER_ANIMATION')
    _draw_decoding(column, data)
    if known.most_budget:
        column.label(text=f"{known.most_budget:,} at most", icon='BLANK1')
    if known.is_learned:
        chosen = (stipple.anchors, stipple.anchors_render or stipple.anchors)
        used = [sources.detailed(count, stipple) for count in chosen]
        is_beyond = max(used) > known.most_learned or min(used) < known.least_learned
        column.label(text=f"Learned for {known.least_learned:,} to {known.most_learned:,}",
                     icon='INFO' if is_beyond else 'BLANK1')


def _draw_decoding(layout, data):
    """What is being decoded beside Blender, and what was cancelled."""
    share = decoded.decoding_share(data)
    if share is not None:
        row = layout.row(align=True)
        row.label(text=f"Decoding: {share:.0%} (Esc cancels)", icon='SORTTIME')
        row.operator('stipple.decoding_cancel', text="", icon='X')
    elif decoded.is_declined(data):
        row = layout.row(align=True)
        row.label(text="Decoding was cancelled", icon='INFO')
        row.operator('stipple.decoding_resume')
    count, size = decoded.cached(data)
    if count:
        row = layout.row()
        row.active = False
        row.label(text=f"{count} budget{'' if count == 1 else 's'} kept{SEPARATOR}{exporting.megabytes(size)}")


def _draw_fixed(layout, name, value):
    """A value that nobody can change, where others have a field."""
    split = layout.split(factor=0.4)
    left = split.column()
    left.alignment = 'RIGHT'
    left.label(text=name)
    split.label(text=value)


def _shown_label(data):
    count = splat_data.count(data)
    if data.stipple.is_sequence:
        return f"{count:,} Gaussian Splats{SEPARATOR}frame of a series"
    if not source_settings.of(data.stipple).counts_splats:
        return f"{count:,} Gaussian Splats"
    size = exporting.megabytes(count * splat_data.bytes_each(data))
    return f"Showing {count:,} of {sources.visible_count(data.stipple):,}{SEPARATOR}{size}"


def _draw_hidden(layout, data):
    counts = masks.counts(data)
    if counts is not None:
        text = f"{counts[0] - counts[1]:,} hidden"
    elif erased.any_of(data):
        text = "Partly erased"
    else:
        return
    row = layout.row()
    row.label(text=text, icon='HIDE_ON')
    row.operator('stipple.clear_mask', text="", icon='X')


def _draw_tree_budget(layout, stipple):
    layout = layout.column()
    layout.enabled = not stipple.edited
    layout.use_property_split = False
    layout.row().prop(stipple, 'budget_by', expand=True)
    name = 'ratio' if stipple.budget_by == 'RATIO' else 'anchors'
    row = layout.row()
    for text, suffix, render in (("Viewport", '', False), ("Render", '_render', True)):
        column = row.column(align=True)
        column.label(text=text)
        column.prop(stipple, name + suffix, text="", slider=name == 'ratio')
        buttons = column.row(align=True)
        for label, factor in (("\u00f7 2", 0.5), ("\u00d7 2", 2.0)):
            button = buttons.operator('stipple.scale_budget', text=label)
            button.factor, button.render = factor, render
    layout.use_property_split = True
    layout.prop(stipple, 'detail')
    if source_settings.of(stipple).has_smooth and not stipple.is_sequence:
        layout.prop(stipple, 'smooth_budget', text="Smooth")


def _draw_foreign(self, context):
    """Splats that something else made: they can have a budget too."""
    obj = context.object
    if not splat_data.is_splat_object(obj) and geometry.carries_splats(obj.data):
        self.layout.operator('stipple.add_budget', icon='MOD_DECIM')


def _draw_warnings(layout, data):
    stipple = data.stipple
    problem = sync.problems.get(data.name) or viewed.state['graphics']
    if not stipple.edited and source_state.draw(layout, data):
        return
    if stipple.edited:
        layout.label(text="Edited by hand", icon='LOCKED')
        column = layout.column(align=True)
        column.operator('stipple.use_as_new_source')
        column.operator('stipple.revert_to_source')
    elif problem:
        for i, line in enumerate(_wrapped(problem)):
            layout.label(text=line, icon='ERROR' if i == 0 else 'BLANK1')
    elif stipple.source_changed:
        _draw_update(layout, "Mesh has changed")
    elif stipple.source_objects and (stipple.source_detail_weight != stipple.detail_weight
                                     or stipple.source_color_from != stipple.color_from
                                     or stipple.source_refine != stipple.refine
                                     or stipple.source_bake_views != stipple.bake_views
                                     or tuple(stipple.source_bake) != (stipple.bake_size, stipple.bake_samples)):
        _draw_update(layout, "Source settings have changed")
    if bpy.ops.stipple.upgrade_to_point_cloud.poll():
        layout.operator('stipple.upgrade_to_point_cloud', icon='OUTLINER_DATA_POINTCLOUD')


def _draw_update(layout, text):
    layout.label(text=text, icon='INFO')
    layout.operator('stipple.update_from_source', icon='FILE_REFRESH')


def _wrapped(text, width=34):
    """Lines that fit a narrow Properties editor."""
    line = ''
    for word in text.split():
        if line and len(line) + len(word) + 1 > width:
            yield line
            line = ''
        line = f'{line} {word}'.strip()
    if line:
        yield line


_HOSTS = ('DATA_PT_context_mesh', 'DATA_PT_context_pointcloud')


def register():
    for name in _HOSTS:
        host = getattr(bpy.types, name, None)
        if host is not None:
            host.append(_draw_budget)
            host.append(_draw_foreign)


def unregister():
    for name in _HOSTS:
        host = getattr(bpy.types, name, None)
        if host is not None:
            host.remove(_draw_budget)
            host.remove(_draw_foreign)


classes = (STIPPLE_PT_source, STIPPLE_PT_grade, STIPPLE_PT_clean_up, STIPPLE_PT_binding, STIPPLE_PT_advanced)
