# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the active splats again from the meshes that they came from."""

import bpy

from .. import binding
from ..binding.errors import invalid
from ..jobs import JobOperator
from ..scene import bake, meshes
from ..scene.source import bound, erased, mesh_models, source_paths, source_settings, sources, splat_data, sync


class STIPPLE_OT_update_from_source(JobOperator, bpy.types.Operator):
    """Make the splats again from their source meshes as they are now"""

    bl_idname = 'stipple.update_from_source'
    bl_label = "Update from Source"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context):
        obj = context.object
        return splat_data.is_splat_object(obj) and len(obj.data.stipple.source_objects) > 0

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, context):
        self._object = context.object
        stipple = self._object.data.stipple
        was_refined = source_settings.of(stipple).counts_splats
        self._changes_kind = was_refined != stipple.refine
        made = self._made = mesh_models.made_with(stipple)
        self._settings = sources.decode_settings(stipple)
        if self._changes_kind:
            splat_count = made.anchors * made.gaussians_per_anchor
            self._settings = binding.model.DecodeSettings(splat_count) if stipple.refine else made
        self._settings.check()
        self._sources = [entry.object for entry in stipple.source_objects if entry.object is not None]
        if not self._sources:
            raise invalid(f"The meshes that '{self._object.name}' was made from are gone; at least one is needed.")
        native = sources.context()
        self._notes = []
        with meshes.shown(context, self._sources):
            baking = bake.Settings(stipple.bake_size, stipple.bake_samples, stipple.bake_views)
            mesh = meshes.native_mesh(native, self._sources, context.evaluated_depsgraph_get(), stipple.color_from,
                                      self._notes, baking=baking)
        return mesh_models.start(native, mesh, made, stipple.detail_weight, stipple.refine)

    def finish(self, _context, job):
        model, data = mesh_models.model_of(job), self._object.data
        splats = erased.read(data).applied(model.decode(self._settings)).columns()
        # Never over the old file: undo goes back to it.
        path = sources.save_model(model, source_paths.place_for(self._object.name))
        sources.remember_model(path, model)
        with sync.paused():
            mesh_models.attach(data, path, self._sources, model)
            if self._changes_kind:
                mesh_models.show_all(data.stipple, self._made)
            bound.rebind(data)
        sync.write_decoded(data, splats)
        for note in self._notes:
            self.report({'WARNING'}, note)
        self.report({'INFO'}, f"{splats.count:,} splats from {len(self._sources)} source objects")


classes = (STIPPLE_OT_update_from_source,)
