# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the active splats again from the meshes that they came from."""

import bpy

from ..binding.errors import invalid
from ..binding.model import Model
from ..jobs import JobOperator
from ..scene import meshes
from ..scene.source import bound, erased, source_paths, sources, splat_data, sync


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
        self._settings = sources.decode_settings(stipple)
        self._settings.check()
        self._sources = [entry.object for entry in stipple.source_objects if entry.object is not None]
        if not self._sources:
            raise invalid(f"The meshes that '{self._object.name}' was made from are gone; at least one is needed.")
        native = sources.context()
        self._notes = []
        with meshes.shown(context, self._sources):
            mesh = meshes.native_mesh(native, self._sources, context.evaluated_depsgraph_get(), stipple.color_from,
                                      self._notes)
        return Model.from_mesh_start(native, mesh, stipple.detail_weight, stipple.seed)

    def finish(self, _context, job):
        model, data = Model.of_job(job), self._object.data
        splats = erased.read(data).applied(model.decode(self._settings)).columns()
        # Never over the old file: undo goes back to it.
        path = sources.save_model(model, source_paths.place_for(self._object.name))
        sources.remember_model(path, model)
        with sync.paused():
            sources.attach_model(data, path, self._sources, model.settings())
            bound.rebind(data)
        sync.write_decoded(data, splats)
        for note in self._notes:
            self.report({'WARNING'}, note)
        self.report({'INFO'}, f"{splats.count:,} splats from {len(self._sources)} source objects")


classes = (STIPPLE_OT_update_from_source,)
