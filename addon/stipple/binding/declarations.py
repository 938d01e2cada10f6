# SPDX-License-Identifier: GPL-3.0-or-later
"""Every function of stipple.h with its result and argument types; declared once, at load."""

from ctypes import POINTER, c_char_p, c_double, c_float, c_int, c_uint32, c_uint64, c_uint8, c_void_p

from . import structs as s

_status = c_int  # an enum of C
_handle = c_void_p
_out_handle = POINTER(c_void_p)
_path = c_char_p
_matrix = POINTER(c_double)
_doubles = POINTER(c_double)
_floats = POINTER(c_float)
_mask = POINTER(c_uint8)


def _to(struct):
    return POINTER(struct)


FUNCTIONS = {
    # version and errors
    'stipple_abi_version': (c_uint32, []),
    'stipple_version_string': (c_char_p, []),
    'stipple_last_error_message': (c_char_p, []),
    'stipple_status_name': (c_char_p, [_status]),
    # context
    'stipple_context_options_init': (None, [_to(s.StippleContextOptions)]),
    'stipple_context_create': (_status, [_to(s.StippleContextOptions), _out_handle]),
    'stipple_context_free': (None, [_handle]),
    # jobs
    'stipple_job_poll': (_status, [_handle, _to(s.StippleJobProgress)]),
    'stipple_job_cancel': (_status, [_handle]),
    'stipple_job_wait': (_status, [_handle]),
    'stipple_job_free': (None, [_handle]),
    'stipple_job_model': (_status, [_handle, _out_handle]),
    'stipple_job_cloud': (_status, [_handle, _out_handle]),
    'stipple_job_volume': (_status, [_handle, _out_handle]),
    'stipple_job_mesh': (_status, [_handle, _out_handle]),
    # splat clouds
    'stipple_cloud_create': (_status, [_handle, _to(s.StippleCloudArrays), _out_handle]),
    'stipple_cloud_free': (None, [_handle]),
    'stipple_cloud_info': (_status, [_handle, _to(s.StippleCloudInfo)]),
    'stipple_cloud_read': (_status, [_handle, _to(s.StippleCloudBuffers)]),
    'stipple_cloud_create_from_columns': (_status, [_handle, _to(s.StippleCloudColumns), _out_handle]),
    'stipple_cloud_read_columns': (_status, [_handle, _to(s.StippleCloudColumnBuffers)]),
    'stipple_cloud_load': (_status, [_handle, _path, _out_handle]),
    'stipple_cloud_load_start': (_status, [_handle, _path, _out_handle]),
    'stipple_cloud_save_options_init': (None, [_to(s.StippleCloudSaveOptions)]),
    'stipple_cloud_save': (_status, [_handle, _path, _to(s.StippleCloudSaveOptions)]),
    'stipple_cloud_save_levels': (_status, [POINTER(_handle), c_uint64, _handle, _path,
                                             _to(s.StippleCloudSaveOptions)]),
    'stipple_format_count': (_status, [POINTER(c_uint64)]),
    'stipple_format_info': (_status, [c_uint64, _to(s.StippleFormatInfo)]),
    'stipple_format_of_file': (_status, [_path, POINTER(c_uint64)]),
    'stipple_cloud_transform': (_status, [_handle, _matrix, _out_handle]),
    'stipple_grade_settings_init': (None, [_to(s.StippleGradeSettings)]),
    'stipple_grade_init': (None, [_to(s.StippleGrade)]),
    'stipple_grade_from_settings': (_status, [_to(s.StippleGradeSettings), c_uint32, _to(s.StippleGrade)]),
    'stipple_cloud_grade': (_status, [_handle, _to(s.StippleGrade), _out_handle]),
    'stipple_cloud_compare': (_status, [_handle, _handle, _to(s.StippleCloudComparison)]),
    # meshes
    'stipple_mesh_create': (_status, [_handle, _out_handle]),
    'stipple_mesh_free': (None, [_handle]),
    'stipple_mesh_add_texture': (_status, [_handle, c_uint32, c_uint32, c_uint32, _floats, c_uint32,
                                           POINTER(c_uint32)]),
    'stipple_mesh_add_material': (_status, [_handle, _to(s.StippleMaterial), POINTER(c_uint32)]),
    'stipple_mesh_add_part': (_status, [_handle, _to(s.StippleMeshPart)]),
    'stipple_mesh_load': (_status, [_handle, _path, _out_handle]),
    'stipple_mesh_info': (_status, [_handle, _to(s.StippleMeshInfo)]),
    'stipple_mesh_depth_start': (_status, [_handle, _to(s.StippleMeshInstance), c_uint64, _to(s.StippleCamera), _floats,
                                           _out_handle]),
    'stipple_mesh_read': (_status, [_handle, _to(s.StippleMeshBuffers)]),
    'stipple_mesh_topology': (_status, [_handle, _to(s.StippleMeshTopology)]),
    'stipple_mesh_save': (_status, [_handle, _path]),
    # density and anchors
    'stipple_sample_options_init': (None, [_to(s.StippleSampleOptions)]),
    'stipple_density_from_points': (_status, [_handle, _floats, _floats, c_uint64, c_uint32, _out_handle]),
    'stipple_density_free': (None, [_handle]),
    'stipple_density_info': (_status, [_handle, _to(s.StippleDensityInfo)]),
    'stipple_density_sample': (_status, [_handle, _to(s.StippleSampleOptions), _to(s.StippleAnchorBuffers)]),
    # models
    'stipple_model_from_mesh_options_init': (None, [_to(s.StippleModelFromMeshOptions)]),
    'stipple_decode_options_init': (None, [_to(s.StippleDecodeOptions)]),
    'stipple_model_from_mesh_start': (_status, [_handle, _handle, _to(s.StippleModelFromMeshOptions), _out_handle]),
    'stipple_model_from_cloud_options_init': (None, [_to(s.StippleModelFromCloudOptions)]),
    'stipple_model_from_cloud_start': (_status, [_handle, _handle, _to(s.StippleModelFromCloudOptions), _out_handle]),
    'stipple_refine_options_init': (None, [_to(s.StippleRefineOptions)]),
    'stipple_cloud_refine_start': (_status, [_handle, _handle, _to(s.StippleRefineOptions), _out_handle]),
    'stipple_model_load': (_status, [_handle, _path, _out_handle]),
    'stipple_model_load_start': (_status, [_handle, _path, _out_handle]),
    'stipple_model_save': (_status, [_handle, _path]),
    'stipple_model_free': (None, [_handle]),
    'stipple_model_info': (_status, [_handle, _to(s.StippleModelInfo)]),
    'stipple_model_density': (_status, [_handle, _out_handle]),
    'stipple_model_decode': (_status, [_handle, _to(s.StippleDecodeOptions), _out_handle]),
    'stipple_model_decode_start': (_status, [_handle, _to(s.StippleDecodeOptions), _out_handle]),
    'stipple_model_decode_memory_bound': (_status, [_handle, _to(s.StippleDecodeOptions), POINTER(c_uint64)]),
    # cameras
    'stipple_views_load': (_status, [_handle, _path, _out_handle]),
    'stipple_views_free': (None, [_handle]),
    'stipple_views_count': (_status, [_handle, POINTER(c_uint64)]),
    'stipple_views_camera': (_status, [_handle, c_uint64, _to(s.StippleCamera)]),
    'stipple_camera_resize': (_status, [_to(s.StippleCamera), c_uint32, c_uint32]),
    # views with pictures
    'stipple_views_open_options_init': (None, [_to(s.StippleViewsOpenOptions)]),
    'stipple_views_open': (_status, [_handle, _path, _to(s.StippleViewsOpenOptions), _out_handle]),
    'stipple_views_create': (_status, [_handle, c_uint32, _out_handle]),
    'stipple_views_add': (_status, [_handle, _to(s.StippleCamera), _to(s.StippleViewPicture), c_char_p]),
    'stipple_views_set_points': (_status, [_handle, _to(s.StippleViewPoints)]),
    'stipple_views_info': (_status, [_handle, _to(s.StippleViewsInfo)]),
    'stipple_views_view_info': (_status, [_handle, c_uint64, _to(s.StippleViewInfo)]),
    'stipple_views_read': (_status, [_handle, c_uint64, _to(s.StippleViewBuffers)]),
    'stipple_views_read_points': (_status, [_handle, c_uint64, _floats, _floats]),
    # accuracy
    'stipple_accuracy_init': (_status, [c_uint32, _to(s.StippleAccuracy)]),
    'stipple_accuracy_check': (_status, [_to(s.StippleAccuracy)]),
    'stipple_accuracy_knob_count': (_status, [POINTER(c_uint64)]),
    'stipple_accuracy_knob_info': (_status, [c_uint64, _to(s.StippleAccuracyKnobInfo)]),
    'stipple_accuracy_level_name': (c_char_p, [c_uint32]),
    'stipple_accuracy_verdict': (c_char_p, [c_double]),
    # rendering
    'stipple_render_options_init': (None, [_to(s.StippleRenderOptions)]),
    'stipple_renderer_create': (_status, [_handle, _out_handle]),
    'stipple_renderer_free': (None, [_handle]),
    'stipple_renderer_render_start': (_status, [_handle, _to(s.StippleInstance), c_uint64, _to(s.StippleCamera),
                                                _to(s.StippleRenderOptions), _to(s.StippleRenderBuffers),
                                                _out_handle]),
    'stipple_renderer_sample_count': (_status, [_handle, _to(s.StippleInstance), c_uint64, _to(s.StippleCamera),
                                                _to(s.StippleRenderOptions), POINTER(c_uint32)]),
    'stipple_renderer_memory_bound': (_status, [_handle, _to(s.StippleInstance), c_uint64, _to(s.StippleCamera),
                                                POINTER(c_uint64)]),
    # what accuracy costs
    'stipple_accuracy_measure_options_init': (None, [_to(s.StippleAccuracyMeasureOptions)]),
    'stipple_accuracy_measure_start': (_status, [_handle, _to(s.StippleInstance), c_uint64, _to(s.StippleCamera),
                                                 _to(s.StippleRenderOptions), _to(s.StippleAccuracyMeasureOptions),
                                                 _out_handle]),
    'stipple_volume_accuracy_options_init': (None, [_to(s.StippleVolumeAccuracyOptions)]),
    'stipple_volume_accuracy_start': (_status, [_handle, _to(s.StippleInstance), c_uint64,
                                                _to(s.StippleVoxelizeOptions), _to(s.StippleVolumeAccuracyOptions),
                                                _out_handle]),
    'stipple_fit_accuracy_report': (_status, [_path, _out_handle]),
    'stipple_job_accuracy_report': (_status, [_handle, _out_handle]),
    'stipple_accuracy_report_free': (None, [_handle]),
    'stipple_accuracy_report_info': (_status, [_handle, _to(s.StippleAccuracyReportInfo)]),
    'stipple_accuracy_report_row': (_status, [_handle, c_uint64, _to(s.StippleAccuracyRow)]),
    'stipple_accuracy_report_best_within': (_status, [_handle, c_double, POINTER(c_uint64)]),
    'stipple_accuracy_report_cheapest_above': (_status, [_handle, c_double, POINTER(c_uint64)]),
    'stipple_accuracy_report_save': (_status, [_handle, _path]),
    'stipple_accuracy_report_draw': (_status, [_handle, c_double, c_uint64, _floats, POINTER(c_uint32),
                                              POINTER(c_uint32)]),
    # drawing by a graphics card
    'stipple_cloud_pack': (_status, [_handle, _floats, c_uint64]),
    'stipple_effects_survey': (_status, [_handle, _to(s.StippleInstance), c_uint64, _to(s.StippleCamera),
                                         _to(s.StippleEffectsSurvey)]),
    'stipple_effect_facts_init': (None, [_to(s.StippleEffectFacts)]),
    'stipple_effects_plan': (_status, [_to(s.StippleEffectFacts), _to(s.StippleEffectRow), c_uint64]),
    'stipple_renderer_order_start': (_status, [_handle, _to(s.StippleInstance), c_uint64, _to(s.StippleCamera),
                                               _to(s.StippleDrawOrderBuffers), _out_handle]),
    'stipple_renderer_order_memory_bound': (_status, [_handle, _to(s.StippleInstance), c_uint64, POINTER(c_uint64)]),
    # editing splat clouds
    'stipple_cloud_select_box': (_status, [_handle, _matrix, c_uint32, _mask, c_uint64, POINTER(c_uint64)]),
    'stipple_cloud_select_mesh_start': (_status, [_handle, _matrix, _handle, c_uint32, _mask, c_uint64,
                                                  POINTER(c_uint64), _out_handle]),
    'stipple_floater_options_init': (None, [_to(s.StippleFloaterOptions)]),
    'stipple_cloud_select_floaters_start': (_status, [_handle, _to(s.StippleFloaterOptions), _mask, c_uint64,
                                                      _to(s.StippleFloaterReport), _out_handle]),
    'stipple_cloud_keep': (_status, [_handle, _mask, c_uint64, _out_handle]),
    'stipple_cloud_thin': (_status, [_handle, c_uint64, c_uint64, _out_handle]),
    'stipple_model_keep': (_status, [_handle, _mask, c_uint64, _out_handle]),
    'stipple_cloud_merge': (_status, [_to(s.StippleInstance), c_uint64, c_uint32, _out_handle]),
    'stipple_ground_plane_options_init': (None, [_to(s.StippleGroundPlaneOptions)]),
    'stipple_cloud_ground_plane': (_status, [_handle, _matrix, _to(s.StippleGroundPlaneOptions),
                                             _to(s.StippleGroundPlane)]),
    'stipple_level_points': (_status, [_doubles, _doubles, _doubles]),
    'stipple_scale_points': (_status, [_doubles, c_double, _doubles]),
    # differentiable rendering
    'stipple_renderer_backward_start': (_status, [_handle, _to(s.StippleInstance), c_uint64, _to(s.StippleCamera),
                                                  _to(s.StippleRenderOptions), _to(s.StippleBackwardInput),
                                                  _to(s.StippleSplatGradients), _to(s.StippleBackwardResult),
                                                  _out_handle]),
    'stipple_renderer_backward_memory_bound': (_status, [_handle, _to(s.StippleInstance), c_uint64, _to(s.StippleCamera),
                                                         _to(s.StippleBackwardInput), _to(s.StippleSplatGradients),
                                                         POINTER(c_uint64)]),
    'stipple_image_loss_options_init': (None, [_to(s.StippleImageLossOptions)]),
    'stipple_image_loss': (_status, [_handle, c_uint32, c_uint32, _floats, _floats, _floats,
                                     _to(s.StippleImageLossOptions), _to(s.StippleImageLoss), _floats]),
    # cameras of a fit
    'stipple_rig_search_options_init': (None, [_to(s.StippleRigSearchOptions)]),
    'stipple_rig_search_create': (_status, [_to(s.StippleRigSearchOptions), _out_handle]),
    'stipple_rig_search_free': (None, [_handle]),
    'stipple_rig_search_rays': (_status, [_handle, c_uint64, _doubles, POINTER(c_uint64)]),
    'stipple_rig_search_answer': (_status, [_handle, _to(s.StippleRayHits)]),
    'stipple_rig_search_camera': (_status, [_handle, c_uint64, _to(s.StippleCamera)]),
    # fitting splats to views
    'stipple_fit_options_init': (None, [_to(s.StippleFitOptions)]),
    'stipple_fit_options_preset': (_status, [_to(s.StippleFitOptions), c_uint32, c_uint32]),
    'stipple_fit_options_set': (_status, [_to(s.StippleFitOptions), c_char_p, c_char_p]),
    'stipple_fit_option_count': (_status, [POINTER(c_uint64)]),
    'stipple_fit_option_info': (_status, [c_uint64, _to(s.StippleFitOptionInfo)]),
    'stipple_fit_start': (_status, [_handle, _handle, _to(s.StippleFitOptions), _out_handle]),
    'stipple_fit_memory_bound': (_status, [_handle, _to(s.StippleFitOptions), POINTER(c_uint64)]),
    'stipple_fit_figures': (_status, [_handle, _to(s.StippleFitFigures)]),
    'stipple_fit_note': (_status, [_handle, c_uint64, POINTER(c_char_p)]),
    'stipple_fit_preview': (_status, [_handle, _out_handle]),
    'stipple_fit_watch_contributions': (_status, [_handle, c_uint32]),
    'stipple_fit_cloud': (_status, [_handle, c_uint64, _out_handle]),
    'stipple_fit_model': (_status, [_handle, _out_handle]),
    'stipple_fit_report_save': (_status, [_handle, _path]),
    'stipple_fit_report_draw': (_status, [_handle, c_double, c_uint64, _floats, POINTER(c_uint32),
                                         POINTER(c_uint32)]),
    'stipple_cloud_quantity': (_status, [_handle, c_uint32, c_uint64, _floats, POINTER(c_uint64)]),
    'stipple_strategy_count': (_status, [POINTER(c_uint64)]),
    'stipple_strategy_info': (_status, [c_uint64, _to(s.StippleStrategyInfo)]),
    'stipple_strategy_part_count': (_status, [POINTER(c_uint64)]),
    'stipple_strategy_part_info': (_status, [c_uint64, _to(s.StippleStrategyInfo)]),
    'stipple_strategy_check': (_status, [_path]),
    'stipple_densify_options_init': (None, [_to(s.StippleDensifyOptions)]),
    'stipple_densify_start': (_status, [_handle, _handle, _handle, _to(s.StippleDensifyOptions), _out_handle]),
    # volumes
    'stipple_voxelize_options_init': (None, [_to(s.StippleVoxelizeOptions)]),
    'stipple_voxelize_start': (_status, [_handle, _to(s.StippleInstance), c_uint64, _to(s.StippleVoxelizeOptions),
                                         _out_handle]),
    'stipple_voxelize_memory_bound': (_status, [_handle, _to(s.StippleInstance), c_uint64,
                                                _to(s.StippleVoxelizeOptions), POINTER(c_uint64)]),
    'stipple_volume_free': (None, [_handle]),
    'stipple_volume_info': (_status, [_handle, _to(s.StippleVolumeInfo)]),
    'stipple_volume_save': (_status, [_handle, _path]),
    'stipple_volume_load': (_status, [_handle, _path, _out_handle]),
    'stipple_volume_to_mesh_options_init': (None, [_to(s.StippleVolumeToMeshOptions)]),
    'stipple_volume_to_mesh_start': (_status, [_handle, _to(s.StippleVolumeToMeshOptions), _out_handle]),
    'stipple_volume_to_mesh_memory_bound': (_status, [_handle, _to(s.StippleVolumeToMeshOptions), POINTER(c_uint64)]),
    # pictures
    'stipple_image_create': (_status, [_handle, c_uint32, c_uint32, c_uint32, c_uint32, _floats, _out_handle]),
    'stipple_image_load': (_status, [_handle, _path, _out_handle]),
    'stipple_image_free': (None, [_handle]),
    'stipple_image_info': (_status, [_handle, _to(s.StippleImageInfo)]),
    'stipple_image_read': (_status, [_handle, _floats, c_uint64]),
    'stipple_image_save': (_status, [_handle, _path, c_uint32]),
    'stipple_image_compare': (_status, [_handle, _handle, _to(s.StippleImageComparison)]),
}


def declare(library):
    """Gives every function of a loaded library its types. Raises AttributeError for one that is missing."""
    for name, (result, arguments) in FUNCTIONS.items():
        function = getattr(library, name)
        function.restype = result
        function.argtypes = arguments
