# SPDX-License-Identifier: GPL-3.0-or-later
"""Render: how splats are coloured; and Blender's own panels for the engine Stipple."""

import bpy

from .. import cycles_functions
from ..scene.view import facts, splat_engines
from .text import draw_text

ENGINE = splat_engines.STIPPLE
CYCLES_ENGINE = splat_engines.CYCLES
# Blender's panels that name BLENDER_RENDER but do nothing for this engine.
_EXCLUDED = {'VIEWLAYER_PT_filter', 'VIEWLAYER_PT_layer_passes', 'RENDER_PT_freestyle',
             'RENDER_PT_simplify_greasepencil', 'RENDER_PT_gpencil', 'RENDER_PT_stereoscopy'}


class SplatRenderPanel:
    """What panels of the render properties have in common."""

    bl_space_type = 'PROPERTIES'
    bl_region_type = 'WINDOW'
    bl_context = 'render'
    bl_options = {'DEFAULT_CLOSED'}
    COMPAT_ENGINES = {ENGINE, CYCLES_ENGINE}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES


class STIPPLE_PT_render_splats(SplatRenderPanel, bpy.types.Panel):
    bl_label = "Gaussian Splats"
    bl_options = set()

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        scene = context.scene
        if context.engine == CYCLES_ENGINE:
            if cycles_functions.denoising_problem(scene, context.view_layer):
                box = layout.box()
                draw_text(box, context, "This Blender was built without a denoiser", 'ERROR')
                box.operator('stipple.turn_denoising_off')
            layout.prop(scene.cycles, 'device')
            layout.prop(scene.stipple, 'shadow_margin')
            layout.operator_menu_enum('stipple.add_shadow_catcher', 'kind')
            draw_text(layout, context, "Splats do not appear in reflections", 'INFO')
        else:
            # Over the whole width: half of the editor cuts its words off.
            row = layout.row()
            row.use_property_split = False
            row.prop(scene.stipple, 'meshes_as_mattes')
        layout.prop(scene.stipple, 'splat_color')
        if scene.stipple.splat_color == 'AS_TRAINED' and not facts.uses_standard_view(scene):
            box = layout.box()
            draw_text(box, context, f"The view transform {scene.view_settings.view_transform} changes colors", 'INFO')
            box.operator('stipple.use_standard_view')


class STIPPLE_PT_other_engine(bpy.types.Panel):
    """Where the chosen engine leaves splats out of renders."""

    bl_label = "Gaussian Splats"
    bl_space_type = 'PROPERTIES'
    bl_region_type = 'WINDOW'
    bl_context = 'render'

    @classmethod
    def poll(cls, context):
        return bool(splat_engines.hint(context.scene))

    def draw(self, context):
        draw_text(self.layout, context, splat_engines.hint(context.scene) + '. These engines do:', 'INFO')
        column = self.layout.column(align=True)
        for name, label, _ in splat_engines.ENGINES:
            column.operator('stipple.use_engine', text=f'Use {label}').engine = name


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
        row = self.layout.row()
        row.use_property_decorate = False
        row.prop(context.scene.render, 'film_transparent', text="Transparent")


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
        column.prop(context.view_layer, 'use_pass_normal')
        column.prop(context.view_layer, 'use_pass_object_index')


def _draw_max_splats(self, context):
    _draw_limit(self.layout, context, 'max_splats')


def _draw_max_splats_render(self, context):
    _draw_limit(self.layout, context, 'max_splats_render')


def _draw_limit(layout, context, name):
    layout = layout.column()
    layout.use_property_split = True
    layout.use_property_decorate = False
    layout.active = context.scene.render.use_simplify
    layout.prop(context.scene.stipple, name)


def _draw_cryptomatte(self, context):
    """Cycles' panel offers what splats have no part in."""
    if context.engine == CYCLES_ENGINE:
        draw_text(self.layout, context, 'Of meshes alone, as if no splats were before them. Splats are in Object Index',
                  'INFO', is_quiet=True)


# Cycles has panels of its own.
_ADDED = (('CYCLES_RENDER_PT_passes_crypto', _draw_cryptomatte),
          ('RENDER_PT_simplify_viewport', _draw_max_splats),
          ('CYCLES_RENDER_PT_simplify_viewport', _draw_max_splats),
          ('RENDER_PT_simplify_render', _draw_max_splats_render),
          ('CYCLES_RENDER_PT_simplify_render', _draw_max_splats_render))


def _added_panels():
    for name, draw in _ADDED:
        panel = getattr(bpy.types, name, None)
        if panel is not None:
            yield panel, draw


def _panels(base=bpy.types.Panel):
    """Blender's panels that say which engines they are for."""
    for panel in base.__subclasses__():
        if getattr(panel, 'COMPAT_ENGINES', None) is not None and not panel.__name__.startswith('STIPPLE_'):
            yield panel
        yield from _panels(panel)


def register():
    for panel in _panels():
        if 'BLENDER_RENDER' in panel.COMPAT_ENGINES and panel.__name__ not in _EXCLUDED:
            panel.COMPAT_ENGINES.add(ENGINE)
        if 'CYCLES' in panel.COMPAT_ENGINES:
            panel.COMPAT_ENGINES.add(CYCLES_ENGINE)
    for panel, draw in _added_panels():
        panel.append(draw)


def unregister():
    for panel, draw in _added_panels():
        panel.remove(draw)
    for panel in _panels():
        panel.COMPAT_ENGINES.difference_update({ENGINE, CYCLES_ENGINE})


classes = (STIPPLE_PT_render_splats, STIPPLE_PT_other_engine, STIPPLE_PT_render_film, STIPPLE_PT_view_layer_passes)
