# SPDX-License-Identifier: GPL-3.0-or-later
"""One file per verb: read, native call or job, write, report."""

from . import (accuracy_compare, accuracy_measure, adapting, add_budget, add_shadow_catcher, apply_transform,
               bind_to_mesh, cameras_import, clear_mask, collect_sources, crop_by_box, crop_by_mesh, decode_budgets,
               decoding, delete_floaters, effects_look, effects_measure, generate, level_to_ground, merge_splats,
               pack_series, prepare_budgets, relink, revert_to_source, scale_budget, selection, set_scale, show_report,
               show_setting, splats_densify, splats_export, splats_fit, splats_from_mesh, splats_import, splats_to_mesh,
               splats_to_volume, training, turn_denoising_off, update_from_source, upgrade_to_point_cloud,
               use_as_new_source, use_engine, use_standard_view)

_modules = (splats_from_mesh, splats_fit, splats_densify, splats_import, splats_export, splats_to_volume,
            splats_to_mesh, update_from_source, use_as_new_source, revert_to_source, upgrade_to_point_cloud,
            use_engine, use_standard_view, crop_by_box, crop_by_mesh, delete_floaters, clear_mask, merge_splats,
            apply_transform, bind_to_mesh, adapting, add_budget, add_shadow_catcher, scale_budget, level_to_ground,
            set_scale, prepare_budgets, decode_budgets, decoding, relink, cameras_import, show_report, show_setting,
            effects_look, effects_measure, accuracy_measure, accuracy_compare, collect_sources, pack_series,
            turn_denoising_off, selection, generate, training)
classes = tuple(cls for module in _modules for cls in module.classes)

# A tooltip is the docstring, whose lines are broken for who reads the code.
for _cls in classes:
    if _cls.__doc__ and 'bl_description' not in _cls.__dict__:
        _cls.bl_description = ' '.join(_cls.__doc__.split())
