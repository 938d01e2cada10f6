# SPDX-License-Identifier: GPL-3.0-or-later
"""Selected meshes become one splat object."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from .. import binding, version
from ..binding import structs
from ..binding.errors import invalid
from ..jobs import JobOperator
from ..panels.text import draw_anchors, draw_color_from
from ..properties import BAKE_SAMPLES_TEXT, BAKE_SIZE_TEXT, BAKE_VIEWS_TEXT, COLOR_SOURCES, ORDERS
from ..scene import bake, meshes
from ..scene.source import mesh_models, source_paths, sources, splat_data, sync


class STIPPLE_OT_splats_from_mesh(JobOperator, bpy.types.Operator):
    """Make one object of Gaussian splats from the selected meshes and whatever they instance"""

    bl_idname = 'stipple.splats_from_mesh'
    bl_label = "Splats from Mesh"
    bl_options = {'REGISTER', 'UNDO', 'PRESET'}

    anchors: IntProperty(name="Splats", description="Number of splats, or of the anchors that each become several. It "
                         "can be changed afterwards", default=20000, soft_min=1, soft_max=1000000)
    gaussians_per_anchor: IntProperty(name="Splats per Anchor",
                                      description="Number of splats that each anchor becomes, "
                                                  "side by side on the surface", default=1, soft_min=1, soft_max=32)
    detail_weight: FloatProperty(name="Detail Weight", description="How much texture detail and curvature attract "
                                 "anchors, 0 for an even spread", default=1.0, soft_min=0.0, soft_max=4.0)
    refine: BoolProperty(name="Refine", description=mesh_models.REFINE_TEXT, default=False)
    order: EnumProperty(name="Order", description="How anchors are drawn from the density", items=ORDERS)
    seed: IntProperty(name="Seed", description="Another seed gives another, equally good set of anchors", default=0,
                      soft_min=0)
    color_from: EnumProperty(name="Color From", description="Where the splats' colors come from", items=COLOR_SOURCES)
    bake_size: IntProperty(name="Bake Size", description=BAKE_SIZE_TEXT, default=0, min=0, max=4096,
                           subtype='PIXEL')
    bake_samples: IntProperty(name="Bake Samples", description=BAKE_SAMPLES_TEXT, default=32, min=1, soft_max=1024)
    bake_views: BoolProperty(name="View-Dependent", description=BAKE_VIEWS_TEXT, default=False)
    hide_source: BoolProperty(name="Hide Source", description="Hide the meshes in the viewport and in renders",
                              default=True)
    source_path: StringProperty(name="Source Path", description="File to keep the splats' source in, empty for a place "
                                "beside the .blend file", subtype='FILE_PATH',
                                options={'SKIP_SAVE'} | version.RELATIVE_PATH)

    @classmethod
    def poll(cls, context):
        return context.mode == 'OBJECT'

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, context):
        self._settings().check()
        self._objects = meshes.source_objects(context.view_layer.objects.selected)
        if not self._objects:
            raise invalid('No mesh is selected; select at least one object with faces.')
        native = sources.context()
        self._notes = []
        mesh = meshes.native_mesh(native, self._objects, context.evaluated_depsgraph_get(), self.color_from, self._notes,
                                  baking=bake.Settings(self.bake_size, self.bake_samples, self.bake_views))
        return mesh_models.start(native, mesh, self._settings(), self.detail_weight, self.refine)

    def finish(self, context, job):
        model = mesh_models.model_of(job)
        # Decoding and writing the source go on side by side; a budget that is refused is refused before the file.
        decoding = model.decode_start(binding.model.DecodeSettings(model.settings().maximum_budget) if self.refine
                                      else self._settings())
        active = context.view_layer.objects.active
        name = (active if active in self._objects else self._objects[0]).name + ' Splats'
        path = sources.save_model(model, source_paths.place_for(name, self.source_path), bool(self.source_path))
        sources.remember_model(path, model)
        decoding.wait()
        splats = binding.cloud.Cloud.of_job(decoding).columns()
        obj = splat_data.new_object(name, splat_data.new_data(name))
        stipple = obj.data.stipple
        with sync.paused():
            stipple.anchors, stipple.gaussians_per_anchor = self.anchors, self.gaussians_per_anchor
            stipple.order, stipple.seed = self.order, self.seed
            stipple.detail_weight, stipple.color_from = self.detail_weight, self.color_from
            stipple.bake_size, stipple.bake_samples = self.bake_size, self.bake_samples
            stipple.bake_views = self.bake_views
            stipple.refine = self.refine
            mesh_models.attach(obj.data, path, self._objects, model)
        sync.write_decoded(obj.data, splats)
        context.collection.objects.link(obj)
        self._select(context, obj)
        for note in self._notes:
            self.report({'WARNING'}, note)
        self.report({'INFO'}, f"{splats.count:,} splats in '{obj.name}'")

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        draw_anchors(layout, self, 'anchors', self.gaussians_per_anchor)
        for name in ('gaussians_per_anchor', 'refine', 'detail_weight', 'order', 'seed'):
            layout.prop(self, name)
        draw_color_from(layout, self)
        for name in ('hide_source', 'source_path'):
            layout.prop(self, name)

    def _settings(self):
        return binding.model.DecodeSettings(self.anchors, self.gaussians_per_anchor, structs.AnchorOrder[self.order],
                                            self.seed)

    def _select(self, context, obj):
        for source in self._objects:
            source.select_set(False)
            if self.hide_source:
                source.hide_set(True)
                source.hide_render = True
        obj.select_set(True)
        context.view_layer.objects.active = obj


classes = (STIPPLE_OT_splats_from_mesh,)
