# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats follow a mesh as it deforms."""

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty

from ..binding.errors import StippleError, invalid
from .. import choices
from ..scene.source import bound, decoded, edits, placement, sources, splat_data, sync


def _is_mesh(obj):
    return obj is not None and obj.type == 'MESH' and not splat_data.is_splat_object(obj)


def _target(context, obj):
    """The mesh that an object's splats shall follow: the active one, the one that is selected, or the one that they
    were made from. Errors: StippleError where that is none or several."""
    active = context.view_layer.objects.active
    if _is_mesh(active) and active.select_get():
        return active
    meshes = [other for other in context.view_layer.objects.selected if _is_mesh(other)]
    if not meshes:
        meshes = [entry.object for entry in obj.data.stipple.source_objects if _is_mesh(entry.object)]
    if len(meshes) != 1:
        raise invalid(f"{len(meshes) or 'No'} meshes are selected; select '{obj.name}' and the one mesh that it shall "
                      'follow.')
    return meshes[0]


def _users(data):
    return [obj for obj in bpy.data.objects if obj.data == data]


class STIPPLE_OT_bind_to_mesh(bpy.types.Operator):
    """Let the selected splats follow the deformation of the active mesh, or of the mesh that they were made from:
    armatures, shape keys, cloth, and all modifiers that keep its faces. They are bound to its present shape"""

    bl_idname = 'stipple.bind_to_mesh'
    bl_label = "Bind to Mesh"
    bl_options = {'REGISTER', 'UNDO'}

    reach: EnumProperty(name="Bind", description="Which part of the mesh each splat follows", items=choices.REACHES,
                        default='SURFACE')
    parent: BoolProperty(name="Parent", description="The splats become a child of the mesh, so that they go where its "
                         "object goes", default=True)

    @classmethod
    def poll(cls, context):
        return context.mode == 'OBJECT' and bool(edits.selected_splats(context))

    def execute(self, context):
        try:
            wanted = [(obj, _target(context, obj)) for obj in edits.selected_splats(context)]
            for obj, mesh in wanted:
                _check(obj, mesh)
            for obj, mesh in wanted:
                self._bind(context, obj, mesh)
        except StippleError as error:
            self.report({'ERROR'}, str(error))
            return {'CANCELLED'}
        for obj, mesh in wanted:
            self.report({'INFO'}, f"{splat_data.count(obj.data):,} splats follow '{mesh.name}'")
        return {'FINISHED'}

    def _bind(self, context, obj, mesh):
        data, depsgraph = obj.data, context.evaluated_depsgraph_get()
        edits.give_source(obj)
        matrix = np.linalg.inv(placement.matrix_of(obj)) @ placement.matrix_of(mesh.evaluated_get(depsgraph))
        with sync.paused():
            if bound.bind(data, mesh, self.reach, matrix, depsgraph, bound.brought_rest(data)):
                self.report({'INFO'}, f"'{obj.name}' is bound to the mesh at rest that its file brings")
            for user in _users(data):
                bound.hold(user, mesh)
                if self.parent and user.parent != mesh:
                    _make_child(user, mesh)
        context.view_layer.update()
        try:
            _write(data, bound.carrier(data))
        except StippleError:
            _release(data)
            raise


class STIPPLE_OT_unbind(bpy.types.Operator):
    """Let the selected splats follow their mesh no more. They go back to where they were bound"""

    bl_idname = 'stipple.unbind'
    bl_label = "Unbind"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context):
        return context.mode == 'OBJECT' and any(bound.is_bound(obj.data) for obj in edits.selected_splats(context))

    def execute(self, context):
        for obj in edits.selected_splats(context):
            if not bound.is_bound(obj.data):
                continue
            if obj.data.library is not None:
                self.report({'ERROR'}, f"'{obj.name}' is linked from another file; make it local first.")
                return {'CANCELLED'}
            _release(obj.data)
            sync.problems.pop(obj.data.name, None)
            if obj.data.stipple.edited or sync.is_edited(obj.data):
                continue  # what was changed by hand is never written over
            try:
                _write(obj.data, None)
            except StippleError as error:
                self.report({'WARNING'}, f"'{obj.name}' follows no mesh now, but its source cannot be shown: {error}")
        return {'FINISHED'}


def _write(data, carrier):
    """Stores what the source gives now."""
    settings = sources.decode_settings(data.stipple)
    splats = decoded.decode_data(data, settings, carrier=carrier).columns()
    sync.write(data, splats, sync.written_key(data, settings, carrier))


def _release(data):
    with sync.paused():
        bound.unbind(data)
        for user in _users(data):
            bound.hold(user, None)


def _make_child(obj, mesh):
    """Ctrl P: the object stays where it is."""
    matrix = obj.matrix_world.copy()
    obj.parent, obj.parent_type = mesh, 'OBJECT'
    obj.matrix_parent_inverse = mesh.matrix_world.inverted_safe()
    obj.matrix_world = matrix


def _check(obj, mesh):
    """Refuses what cannot follow a mesh."""
    if bound.is_bound(obj.data):
        raise invalid(f"'{obj.name}' is bound to a mesh already; choose Unbind first.")
    edits.check_editable(obj)
    for what in (obj, mesh):
        if placement.is_flat(what.matrix_world):
            raise invalid(f"'{what.name}' is scaled to zero; splats are bound at a size that they have.")
    parent = mesh
    while parent is not None:
        if parent == obj:
            raise invalid(f"'{mesh.name}' is a child of '{obj.name}'; a mesh cannot follow the splats that follow it.")
        parent = parent.parent


classes = (STIPPLE_OT_bind_to_mesh, STIPPLE_OT_unbind)
