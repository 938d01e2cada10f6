# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on comes and goes without a trace and without loading its library."""


import addon_utils
import bpy

OPERATORS = ('splats_from_mesh', 'splats_import', 'splats_export', 'splats_to_volume', 'update_from_source',
             'use_standard_view', 'use_as_new_source', 'revert_to_source', 'upgrade_to_point_cloud')


def test_every_operator_is_registered():
    assert set(OPERATORS) <= set(dir(bpy.ops.stipple))


def test_tooltips_are_one_paragraph(stipple):
    for cls in stipple.operators.classes:
        if issubclass(cls, bpy.types.Operator):
            noun, _, verb = cls.bl_idname.partition('.')
            description = getattr(getattr(bpy.ops, noun), verb).get_rna_type().description
            assert description and '\n' not in description and '  ' not in description, cls.bl_idname


def test_settings_live_on_meshes_and_point_clouds():
    for owner in (bpy.types.Mesh, bpy.types.PointCloud):
        assert 'stipple' in owner.bl_rna.properties
    assert 'stipple' in bpy.types.Scene.bl_rna.properties


def test_disable_and_enable_leave_nothing_behind(stipple):
    name = stipple.__name__
    handlers = sum(len(getattr(bpy.app.handlers, h)) for h in dir(bpy.app.handlers)
                   if isinstance(getattr(bpy.app.handlers, h), list))
    panels = sum('STIPPLE' in getattr(p, 'COMPAT_ENGINES', ()) for p in bpy.types.Panel.__subclasses__())
    addon_utils.disable(name)
    assert 'stipple' not in bpy.types.Mesh.bl_rna.properties
    assert not any('STIPPLE' in getattr(p, 'COMPAT_ENGINES', ()) for p in bpy.types.Panel.__subclasses__()
                   if not p.__module__.startswith(name))
    addon_utils.enable(name)
    assert handlers == sum(len(getattr(bpy.app.handlers, h)) for h in dir(bpy.app.handlers)
                           if isinstance(getattr(bpy.app.handlers, h), list))
    assert panels > 5
    assert 'stipple' in bpy.types.Mesh.bl_rna.properties
