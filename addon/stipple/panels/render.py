# SPDX-License-Identifier: GPL-3.0-or-later
"""Render: how splats are coloured; and Blender's own panels for the engine Stipple."""

import bpy

from ..scene import facts

ENGINE = 'STIPPLE'
# Blender's panels that name BLENDER_RENDER but do nothing for this engine.
_EXCLUDED = {'VIEWLAYER_PT_filter', 'VIEWLAYER_PT_layer_passes', 'RENDER_PT_freestyle', 'RENDER_PT_simplify',
             'RENDER_PT_gpencil', 'RENDER_PT_stereoscopy'}


class STIPPLE_PT_render_splats(bpy.types.Panel):
    bl_label = "Gaussian Splats"
    bl_space_type = 'PROPERTIES'
    bl_region_type = 'WINDOW'
    bl_context = 'render'
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        scene = context.scene
        layout.prop(scene.stipple, 'splat_color')
        if scene.stipple.splat_color == 'AS_TRAINED' and not facts.uses_standard_view(scene):
            box = layout.box()
            box.label(text=f"{scene.view_settings.view_transform} view changes colors", icon='INFO')
            box.operator('stipple.use_standard_view')


class STIPPLE_PT_render_film(bpy.types.Panel):
    bl_label = "Film"
    bl_space_type = 'PROPERTIES'
    bl_region_type = 'WINDOW'
    bl_context = 'render'
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.prop(context.scene.render, 'film_transparent', text="Transparent")


class STIPPLE_PT_view_layer_passes(bpy.types.Panel):
    bl_label = "Passes"
    bl_space_type = 'PROPERTIES'
    bl_region_type = 'WINDOW'
    bl_context = 'view_layer'
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column(heading="Include")
        column.prop(context.view_layer, 'use_pass_combined')
        column.prop(context.view_layer, 'use_pass_z')


def _compatible_panels():
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, 'COMPAT_ENGINES', None)
        if engines is not None and 'BLENDER_RENDER' in engines and panel.__name__ not in _EXCLUDED:
            yield engines


def register():
    for engines in _compatible_panels():
        engines.add(ENGINE)


def unregister():
    for panel in bpy.types.Panel.__subclasses__():
        getattr(panel, 'COMPAT_ENGINES', set()).discard(ENGINE)


classes = (STIPPLE_PT_render_splats, STIPPLE_PT_render_film, STIPPLE_PT_view_layer_passes)
