# SPDX-License-Identifier: GPL-3.0-or-later
"""Structs of stipple.h, field by field, and its enumerations; tests/addon compares them with the header."""

from ctypes import (POINTER, Structure, c_char, c_char_p, c_double, c_float, c_int64, c_uint8, c_uint32, c_uint64,
                    c_void_p, sizeof)

from .enums import (AccuracyLevel, AnchorOrder, Antialias, BindingReach, BlendSpace, BudgetUnit, CameraModel,
                    ColourSpace, ENUMS, Effect, EffectChoice, FitBackground, FitModel, FitOptionKind, FitQuality,
                    FitShell, Frame, JobState, LowPass, MaterialColour, MeshAlignment, MeshDensity, NoiseSource,
                    ObjectOrder, OutputColour, PictureDrawing, Precision, Projection, RegionKind, RegionOperation,
                    RenderMethod, Sampling, Side, SplatOrder, SplatQuantity, Status, Transfer, ViewRig, ViewSplit,
                    WeightsRole, WeightsState)

ABI_VERSION = 4
MAX_ANCHORS = 1 << 28
NO_INDEX = 0xFFFFFFFF
DRAW_GEOMETRY_FLOATS = 12
DRAW_ROW_FLOATS = 4
MAX_DRAW_ROWS = 1 << 24
MAX_SH_COLUMNS = 24

_floats = POINTER(c_float)
_matrix = c_double * 16


class _Sized(Structure):
    """A struct whose first field is its size."""

    def __init__(self, **fields):
        super().__init__(**fields)
        self.struct_size = sizeof(type(self))


class StippleContextOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('thread_count', c_uint32), ('memory_limit_bytes', c_uint64)]


class StippleJobProgress(_Sized):
    _fields_ = [('struct_size', c_uint32), ('state', c_uint32), ('fraction', c_double), ('stage', c_char * 64),
                ('seconds', c_double)]


class StippleCloudArrays(_Sized):
    _fields_ = [('struct_size', c_uint32), ('sh_degree', c_uint32), ('colour_space', c_uint32),
                ('antialias', c_uint32), ('count', c_uint64), ('positions', _floats), ('rotations', _floats),
                ('scales', _floats), ('opacities', _floats), ('sh', _floats), ('frame', c_uint32),
                ('reserved', c_uint32)]


class StippleCloudInfo(_Sized):
    _fields_ = [('struct_size', c_uint32), ('sh_degree', c_uint32), ('colour_space', c_uint32),
                ('antialias', c_uint32), ('count', c_uint64), ('bounds_min', c_float * 3), ('bounds_max', c_float * 3),
                ('frame', c_uint32), ('reserved', c_uint32)]


class StippleCloudBuffers(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('capacity', c_uint64), ('positions', _floats),
                ('rotations', _floats), ('scales', _floats), ('opacities', _floats), ('sh', _floats)]


class StippleCloudColumns(_Sized):
    _fields_ = [('struct_size', c_uint32), ('sh_degree', c_uint32), ('colour_space', c_uint32),
                ('antialias', c_uint32), ('count', c_uint64), ('positions', _floats), ('rotations', _floats),
                ('scales', _floats), ('base', _floats), ('rest', _floats * MAX_SH_COLUMNS), ('frame', c_uint32),
                ('reserved', c_uint32)]


class StippleCloudColumnBuffers(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('capacity', c_uint64), ('positions', _floats),
                ('rotations', _floats), ('scales', _floats), ('base', _floats), ('rest', _floats * MAX_SH_COLUMNS)]


class StippleCloudSaveOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('ascii', c_uint32), ('sh_degree_limit', c_uint32),
                ('format_version', c_uint32), ('frame', c_uint32), ('half', c_uint32)]


class StippleSeriesInfo(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('frame_count', c_uint64),
                ('frames_per_second', c_double)]


class StippleFormatInfo(_Sized):
    _fields_ = [('struct_size', c_uint32), ('can_read', c_uint32), ('can_write', c_uint32),
                ('max_sh_degree', c_uint32), ('frame', c_uint32), ('reserved', c_uint32),
                ('name', c_char_p), ('title', c_char_p), ('extensions', c_char_p), ('keeps_frame', c_uint32),
                ('keeps_colour_space', c_uint32), ('keeps_antialias', c_uint32), ('holds_times', c_uint32)]


class StippleCloudComparison(_Sized):
    _fields_ = [('struct_size', c_uint32), ('same_order', c_uint32), ('count_a', c_uint64), ('count_b', c_uint64),
                ('max_position', c_double), ('max_rotation', c_double), ('max_scale_ratio', c_double),
                ('max_opacity', c_double), ('max_sh', c_double), ('mean_position', c_double),
                ('mean_rotation', c_double), ('mean_scale_ratio', c_double), ('mean_opacity', c_double),
                ('mean_sh', c_double)]


class StippleGradeSettings(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('exposure', c_double), ('tint', c_double * 3),
                ('saturation', c_double), ('opacity', c_double)]


class StippleGrade(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('matrix', c_double * 9), ('offset', c_double * 3),
                ('opacity', c_double)]


class StippleMaterial(_Sized):
    _fields_ = [('struct_size', c_uint32), ('colour', c_uint32), ('base_colour', c_float * 4),
                ('texture', c_uint32), ('view_count', c_uint32), ('view_textures', POINTER(c_uint32))]


class StippleMeshPart(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('vertex_count', c_uint64),
                ('triangle_count', c_uint64), ('positions', _floats), ('triangles', POINTER(c_uint32)),
                ('corner_normals', _floats), ('corner_uvs', _floats), ('corner_colours', _floats),
                ('triangle_materials', POINTER(c_uint32)), ('matrix', _matrix)]


class StippleMeshInfo(_Sized):
    _fields_ = [('struct_size', c_uint32), ('material_count', c_uint32), ('vertex_count', c_uint64),
                ('triangle_count', c_uint64), ('bounds_min', c_float * 3), ('bounds_max', c_float * 3)]


class StippleMeshBuffers(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('vertex_capacity', c_uint64),
                ('triangle_capacity', c_uint64), ('positions', _floats), ('triangles', POINTER(c_uint32))]


class StippleMeshTopology(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('edge_count', c_uint64),
                ('open_edge_count', c_uint64), ('piece_count', c_uint64), ('euler', c_int64), ('volume', c_double)]


class StippleMeshAdaptTarget(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('mesh', c_void_p), ('cloud', c_void_p),
                ('points', _floats), ('normals', _floats), ('point_count', c_uint64),
                ('points_path_utf8', c_char_p), ('views', c_void_p)]


class StippleMeshAdaptOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('density', c_uint32), ('alignment', c_uint32), ('steps', c_uint32),
                ('samples_per_point', c_uint32), ('lands_on_target', c_uint32), ('target_count', c_uint64),
                ('report_count', c_uint64), ('seed', c_uint64), ('strength', c_double), ('adaptive_factor', c_double),
                ('smoothness', c_double), ('step_size', c_double), ('position_weight', c_double),
                ('normal_weight', c_double), ('landmark_weight', c_double), ('symmetric_weight', c_double),
                ('landmark_count', c_uint64), ('landmark_vertices', POINTER(c_uint32)), ('landmark_places', _floats),
                ('picture_side', c_uint32), ('picture_drawing', c_uint32), ('sharp_angle', c_double)]


class StippleMeshAdaptReport(_Sized):
    _fields_ = [('struct_size', c_uint32), ('is_measured', c_uint32), ('has_normals', c_uint32),
                ('turned_normals', c_uint32), ('place_count', c_uint64), ('loose_count', c_uint64), ('loss', c_double),
                ('distance_before', c_double), ('distance_after', c_double), ('squared_before', c_double),
                ('squared_after', c_double), ('normals_before', c_double), ('normals_after', c_double),
                ('step_count', c_uint64), ('picture_before', c_double), ('picture_after', c_double)]


class StippleDensityInfo(_Sized):
    _fields_ = [('struct_size', c_uint32), ('leaf_level', c_uint32), ('leaf_count', c_uint64),
                ('root_origin', c_double * 3), ('root_side', c_double)]


class StippleSampleOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('order', c_uint32), ('count', c_uint64), ('seed', c_uint64)]


class StippleAnchorBuffers(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('positions', _floats), ('log_q', _floats),
                ('leaves', POINTER(c_uint64)), ('ranks', POINTER(c_uint64))]


class StippleModelFromMeshOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('leaf_level', c_uint32), ('sample_count', c_uint64), ('seed', c_uint64),
                ('detail_weight', c_double), ('harmonic_degree', c_uint32), ('reserved', c_uint32)]


class StippleModelFromCloudOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('view_rig', c_uint32), ('view_count', c_uint32), ('view_size', c_uint32),
                ('seed', c_uint64), ('footprint', c_double)]


class StippleRefineOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('iterations', c_uint32), ('view_count', c_uint32),
                ('view_size', c_uint32), ('view_rig', c_uint32), ('reserved', c_uint32), ('seed', c_uint64),
                ('seconds', c_double)]


class StippleModelInfo(_Sized):
    _fields_ = [('struct_size', c_uint32), ('leaf_level', c_uint32), ('leaf_count', c_uint64),
                ('sample_count', c_uint64), ('bounds_min', c_float * 3), ('bounds_max', c_float * 3),
                ('kind', c_uint32), ('sh_degree', c_uint32), ('min_anchors', c_uint64), ('max_anchors', c_uint64),
                ('gaussians_per_anchor', c_uint32), ('reserved', c_uint32), ('kind_label', c_char_p)]


class StippleModelSettings(_Sized):
    _fields_ = [('struct_size', c_uint32), ('budget_unit', c_uint32), ('minimum_budget', c_uint64),
                ('maximum_budget', c_uint64), ('default_budget', c_uint64), ('minimum_learned_budget', c_uint64),
                ('maximum_learned_budget', c_uint64), ('minimum_gaussians_per_anchor', c_uint32),
                ('maximum_gaussians_per_anchor', c_uint32), ('default_gaussians_per_anchor', c_uint32),
                ('has_order', c_uint32), ('has_seed', c_uint32), ('takes_mask', c_uint32), ('has_time', c_uint32),
                ('has_smooth', c_uint32), ('time_begin', c_double), ('time_end', c_double)]


class StippleDecodeOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('order', c_uint32), ('anchor_count', c_uint64), ('seed', c_uint64),
                ('gaussians_per_anchor', c_uint32), ('smooth', c_uint32), ('time', c_double)]


class StippleCamera(_Sized):
    _fields_ = [('struct_size', c_uint32), ('model', c_uint32), ('width', c_uint32), ('height', c_uint32),
                ('fx', c_double), ('fy', c_double), ('cx', c_double), ('cy', c_double), ('world_to_camera', _matrix),
                ('near_plane', c_double), ('far_plane', c_double), ('field_of_view', c_double)]


class StippleViewsOpenOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('downscale', c_uint32), ('cache_bytes', c_uint64),
                ('with_frames', c_uint32), ('reserved', c_uint32), ('frame_rate', c_double), ('first_frame', c_uint64),
                ('last_frame', c_uint64), ('frame_step', c_uint64), ('max_images', c_uint64),
                ('held_out_cameras_utf8', c_char_p)]


class StippleViewImage(_Sized):
    _fields_ = [('struct_size', c_uint32), ('transfer', c_uint32), ('rgba', _floats), ('weights', _floats),
                ('depth', _floats), ('normals', _floats), ('time', c_double), ('split', c_uint32),
                ('reserved', c_uint32), ('camera_utf8', c_char_p), ('moving', POINTER(c_uint8))]


class StippleViewPoints(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('count', c_uint64), ('positions', _floats),
                ('colours', _floats), ('normals', _floats), ('weights', _floats), ('times', POINTER(c_double))]


class StippleViewsInfo(_Sized):
    _fields_ = [('struct_size', c_uint32), ('colour_space', c_uint32), ('view_count', c_uint64),
                ('point_count', c_uint64), ('has_images', c_uint32), ('reserved', c_uint32),
                ('found_count', c_uint64), ('camera_count', c_uint64), ('frame_count', c_uint64),
                ('time_begin', c_double), ('time_end', c_double)]


class StippleViewInfo(_Sized):
    _fields_ = [('struct_size', c_uint32), ('split', c_uint32), ('source_width', c_uint32),
                ('source_height', c_uint32), ('is_distorted', c_uint32), ('reserved', c_uint32), ('name', c_char_p),
                ('image_path', c_char_p), ('camera_model', c_char_p), ('time', c_double)]


class StippleViewBuffers(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('capacity', c_uint64), ('rgba', _floats),
                ('weights', _floats), ('depth', _floats), ('normals', _floats)]


class StippleInstance(_Sized):
    _fields_ = [('struct_size', c_uint32), ('holdout', c_uint32), ('cloud', c_void_p), ('matrix', _matrix),
                ('grade', POINTER(StippleGrade)), ('time', c_double)]


class StippleSceneObject(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('name_utf8', c_char_p), ('cloud', c_void_p),
                ('matrix', _matrix)]


class StippleAccuracy(_Sized):
    _fields_ = [('struct_size', c_uint32), ('level', c_uint32), ('order', c_uint32), ('projection', c_uint32),
                ('antialiasing', c_uint32), ('samples_per_side', c_uint32), ('sh_degree_limit', c_uint32),
                ('precision', c_uint32), ('min_alpha', c_double), ('budget_share', c_double)]


class StippleAccuracyKnobInfo(_Sized):
    _fields_ = [('struct_size', c_uint32), ('has_bound', c_uint32), ('name_utf8', c_char_p), ('label_utf8', c_char_p),
                ('bound_utf8', c_char_p)]


class StippleAperture(_Sized):
    _fields_ = [('struct_size', c_uint32), ('blades', c_uint32), ('aperture_radius', c_double),
                ('focus_distance', c_double), ('rotation', c_double), ('ratio', c_double)]


class StippleShutter(_Sized):
    _fields_ = [('struct_size', c_uint32), ('step_count', c_uint32), ('cameras', POINTER(c_double)),
                ('instances', POINTER(c_double)), ('curve', POINTER(c_double)), ('curve_count', c_uint64),
                ('clouds', POINTER(c_void_p))]


class StippleRenderOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('method', c_uint32), ('low_pass', c_uint32), ('blend_space', c_uint32),
                ('output_colour', c_uint32), ('sh_degree_limit', c_uint32), ('with_background', c_uint32),
                ('object_order', c_uint32), ('background', c_double * 3), ('surface_width', c_uint32),
                ('surface_height', c_uint32), ('surface_depth', _floats), ('surface_colour', _floats),
                ('matte_opacity', _floats), ('splat_light', _floats), ('accuracy', POINTER(StippleAccuracy)),
                ('aperture', POINTER(StippleAperture)), ('shutter', POINTER(StippleShutter)), ('samples', c_uint32),
                ('reserved_sampling', c_uint32), ('background_image', _floats), ('solid_depth', c_uint32),
                ('reserved_depth', c_uint32), ('surroundings', _floats), ('surroundings_width', c_uint32),
                ('surroundings_height', c_uint32)]


class StippleAccuracyMeasureOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('repetitions', c_uint32), ('reference_pixels', c_uint64),
                ('max_seconds', c_double), ('settings', POINTER(StippleAccuracy)), ('setting_count', c_uint64)]


class StippleAccuracyReportInfo(_Sized):
    _fields_ = [('struct_size', c_uint32), ('width', c_uint32), ('height', c_uint32), ('thread_count', c_uint32),
                ('compared_pixels', c_uint64), ('splat_count', c_uint64), ('row_count', c_uint64),
                ('cut_seconds', c_double), ('subject', c_uint32), ('reserved', c_uint32)]


class StippleVolumeAccuracyOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('repetitions', c_uint32), ('max_seconds', c_double)]


class StippleAccuracyRow(_Sized):
    _fields_ = [('struct_size', c_uint32), ('is_on_front', c_uint32), ('name_utf8', c_char_p),
                ('setting', StippleAccuracy), ('seconds', c_double), ('seconds_low', c_double),
                ('seconds_high', c_double), ('psnr', c_double), ('largest_error', c_double), ('error_99_9', c_double),
                ('splat_count', c_uint64), ('visible_count', c_uint64), ('repetitions', c_uint32),
                ('is_estimated', c_uint32), ('value', c_double), ('verdict_utf8', c_char_p)]


class StippleMeshInstance(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('mesh', c_void_p), ('matrix', _matrix)]


class StippleLayersInfo(_Sized):
    _fields_ = [('struct_size', c_uint32), ('has_light', c_uint32), ('has_shadows', c_uint32),
                ('has_opacity', c_uint32), ('width', c_uint32), ('height', c_uint32)]


class StippleLayersBuffers(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('depth', _floats), ('colour', _floats),
                ('light', _floats), ('opacity', _floats)]


class StippleRenderBuffers(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('colour', _floats), ('depth', _floats),
                ('median_depth', _floats), ('counts', POINTER(c_uint32)), ('transmittance', _floats),
                ('normal', _floats), ('object_index', POINTER(c_uint32))]


class StippleEffectsSurvey(_Sized):
    _fields_ = [('struct_size', c_uint32), ('sh_degree', c_uint32), ('splat_count', c_uint64),
                ('inspected_count', c_uint64), ('seen_count', c_uint64), ('object_count', c_uint64),
                ('mixed_count', c_uint64), ('view_change', c_double * 5), ('affine_error_px', c_double),
                ('error_ahead_px', c_double), ('field_of_view', c_double), ('widening', c_double)]


class StippleEffectFacts(_Sized):
    _fields_ = [('struct_size', c_uint32), ('view_colour', c_uint32), ('exact_projection', c_uint32),
                ('zoom_antialiasing', c_uint32), ('global_order', c_uint32), ('camera_model', c_uint32),
                ('motion_blur', c_uint32), ('camera_moves', c_uint32), ('moving_objects', c_uint64),
                ('shutter_frames', c_double), ('depth_of_field', c_uint32), ('transparent_film', c_uint32),
                ('depth_pass', c_uint32), ('normal_pass', c_uint32), ('object_index_pass', c_uint32),
                ('reserved', c_uint32), ('aperture_radius', c_double), ('focus_distance', c_double),
                ('hiding_meshes', c_uint64), ('view_share', c_double), ('largest_error_px', c_double),
                ('largest_widening', c_double), ('seconds', c_double * 12), ('survey', POINTER(StippleEffectsSurvey))]


class StippleEffectRow(_Sized):
    _fields_ = [('struct_size', c_uint32), ('effect', c_uint32), ('is_on', c_uint32), ('sh_degree', c_uint32),
                ('seconds', c_double), ('reason', c_char * 256)]


class StippleDrawOrderBuffers(_Sized):
    _fields_ = [('struct_size', c_uint32), ('sh_degree_limit', c_uint32), ('capacity', c_uint64),
                ('order', POINTER(c_uint32)), ('rows', _floats), ('first_rows', POINTER(c_uint64))]


class StippleFloaterOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('by_opacity', c_uint32), ('by_size', c_uint32),
                ('by_connectivity', c_uint32), ('min_opacity', c_double), ('max_size', c_double),
                ('radius', c_double), ('min_group_count', c_uint64)]


class StippleFloaterReport(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('faint', c_uint64), ('large', c_uint64),
                ('isolated', c_uint64), ('kept', c_uint64), ('group_count', c_uint64), ('max_size', c_double),
                ('radius', c_double), ('min_group_count', c_uint64)]


class StippleGroundPlaneOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('up', c_double * 3), ('max_tilt', c_double),
                ('tolerance', c_double), ('seed', c_uint64)]


class StippleGroundPlane(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('normal', c_double * 3), ('offset', c_double),
                ('matrix', _matrix), ('considered_count', c_uint64), ('inlier_count', c_uint64),
                ('tolerance', c_double), ('extent_min', c_double * 3), ('extent_max', c_double * 3)]


class StippleRegion(_Sized):
    _fields_ = [('struct_size', c_uint32), ('kind', c_uint32), ('operation', c_uint32), ('shrink', c_uint32),
                ('cloud_to_pixels', _matrix), ('cloud_to_depth', c_double * 4), ('points', _floats),
                ('point_count', c_uint64), ('radius', c_double), ('depths', _floats), ('depth_width', c_uint32),
                ('depth_height', c_uint32), ('depth_rect', c_double * 4), ('depth_margin', c_double),
                ('centre', c_double * 3), ('colour', c_double * 3), ('tolerance', c_double),
                ('cloud_to_box', _matrix), ('distance', c_double)]


class StippleFillOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('radius', c_double), ('ring_width', c_double),
                ('patch_size', c_double), ('seed', c_uint64)]


class StippleFillReport(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('hole_count', c_uint64),
                ('filled_count', c_uint64), ('no_ring_count', c_uint64), ('no_plane_count', c_uint64),
                ('covered_count', c_uint64), ('splat_count', c_uint64), ('radius', c_double)]


class StippleBindingInfo(_Sized):
    _fields_ = [('struct_size', c_uint32), ('influences', c_uint32), ('splat_count', c_uint64),
                ('vertex_count', c_uint64), ('triangle_count', c_uint64), ('topology', c_uint64)]


class StippleRestInfo(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reach', c_uint32), ('vertex_count', c_uint64),
                ('triangle_count', c_uint64), ('topology', c_uint64)]


class StippleBackwardInput(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('colour_gradient', _floats), ('residual', _floats),
                ('residual_weights', _floats), ('edge_weights', _floats), ('errors', _floats),
                ('depth_gradient', _floats)]


class StippleSplatGradients(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('capacity', c_uint64), ('positions', _floats),
                ('rotations', _floats), ('scales', _floats), ('opacities', _floats), ('sh', _floats),
                ('contributions', _floats), ('blending_weights', _floats), ('edge_weights', _floats),
                ('screen_gradients', _floats), ('absolute_screen_gradients', _floats),
                ('screen_gradient_norms', _floats), ('errors', _floats), ('largest_errors', _floats)]


class StippleBackwardResult(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('camera', c_double * 6),
                ('background', c_double * 3), ('visible_count', c_uint64)]


class StippleImageLossOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('rendered_channels', c_uint32), ('target_channels', c_uint32),
                ('reserved', c_uint32), ('ssim_share', c_double)]


class StippleImageLoss(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('loss', c_double), ('l1', c_double),
                ('ssim', c_double)]


class StippleFitOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('model', c_uint32), ('strategy_utf8', c_char_p), ('iterations', c_uint64),
                ('max_splats', c_uint64), ('start_splats', c_uint64), ('min_anchors', c_uint64),
                ('max_anchors', c_uint64), ('gaussians_per_anchor', c_uint32), ('sh_degree', c_uint32),
                ('antialias', c_uint32), ('background', c_uint32), ('density_gradient', c_uint32), ('jitter', c_uint32),
                ('holdout', c_uint32), ('resume', c_uint32), ('seed', c_uint64), ('ssim_share', c_double),
                ('image_bytes', c_uint64), ('measure_interval', c_uint64), ('checkpoint_path_utf8', c_char_p),
                ('checkpoint_interval', c_uint64), ('checkpoint_seconds', c_double), ('max_bytes', c_uint64),
                ('shell', c_uint32), ('coarse_to_fine', c_uint32), ('key_frame_spacing', c_double),
                ('key_frame_blend', c_uint32), ('growth_by_level', c_uint32), ('middle_level_rank', c_double),
                ('high_level_rank', c_double), ('middle_level_weight', c_double), ('high_level_weight', c_double)]


class StippleRigSearchOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('view_rig', c_uint32), ('view_count', c_uint32), ('view_size', c_uint32),
                ('has_viewer', c_uint32), ('reserved', c_uint32), ('seed', c_uint64), ('angle', c_double),
                ('bounds_min', c_double * 3), ('bounds_max', c_double * 3), ('viewer', c_double * 3)]


class StippleRayHits(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('count', c_uint64),
                ('distances', POINTER(c_double)), ('normals', POINTER(c_double)), ('objects', POINTER(c_uint32)),
                ('object_count', c_uint64), ('object_sizes', POINTER(c_double))]


class StippleFitOptionInfo(_Sized):
    _fields_ = [('struct_size', c_uint32), ('kind', c_uint32), ('models', c_uint32), ('fixed_models', c_uint32),
                ('name_utf8', c_char_p), ('help_utf8', c_char_p), ('choices_utf8', c_char_p), ('minimum', c_double),
                ('maximum', c_double), ('default_utf8', c_char_p), ('presets_utf8', c_char_p * 6),
                ('aliases_utf8', c_char_p * 3), ('alias_units', c_double * 3), ('motion_presets_utf8', c_char_p * 3),
                ('scaffold_presets_utf8', c_char_p * 3), ('relay_presets_utf8', c_char_p * 3)]


class StippleFitFigures(_Sized):
    _fields_ = [('struct_size', c_uint32), ('measured_on_training', c_uint32), ('iteration', c_uint64),
                ('iterations', c_uint64), ('splat_count', c_uint64), ('best_iteration', c_uint64), ('loss', c_double),
                ('psnr', c_double), ('best_psnr', c_double), ('seconds', c_double), ('seconds_left', c_double),
                ('estimated_seconds', c_double), ('estimated_bytes', c_uint64), ('note_count', c_uint64),
                ('preview_iteration', c_uint64), ('stage', c_char * 64), ('best_moving_psnr', c_double)]


class StippleStrategyInfo(_Sized):
    _fields_ = [('struct_size', c_uint32), ('model', c_uint32), ('name_utf8', c_char_p), ('summary_utf8', c_char_p),
                ('label_utf8', c_char_p), ('decides_utf8', c_char_p), ('bit', c_uint32), ('setting_count', c_uint32)]


class StippleStrategySetting(_Sized):
    _fields_ = [('struct_size', c_uint32), ('is_whole', c_uint32), ('name_utf8', c_char_p),
                ('default_value', c_double), ('minimum', c_double), ('maximum', c_double)]


class StippleDensifyOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('event_count', c_uint32), ('strategy_utf8', c_char_p),
                ('max_splats', c_uint64), ('seed', c_uint64), ('image_bytes', c_uint64), ('holdout', c_uint32),
                ('reserved', c_uint32)]


class StippleDetailOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('view_count', c_uint32), ('max_splats', c_uint64)]


class StippleVoxelizeOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('resolution', c_uint32), ('voxel_size', c_double),
                ('low_pass', c_double), ('cut_off_sigma', c_double), ('min_density', c_double)]


class StippleVolumeInfo(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('brick_count', c_uint64),
                ('active_voxel_count', c_uint64), ('voxel_size', c_double), ('bounds_min', c_double * 3),
                ('bounds_max', c_double * 3), ('max_density', c_double)]


class StippleVolumeToMeshOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('largest_only', c_uint32), ('opacity', c_double), ('density', c_double),
                ('adaptivity', c_double)]


class StippleImageInfo(_Sized):
    _fields_ = [('struct_size', c_uint32), ('width', c_uint32), ('height', c_uint32), ('channels', c_uint32),
                ('transfer', c_uint32), ('reserved', c_uint32)]


class StippleImageComparison(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('psnr', c_double), ('ssim', c_double),
                ('max_error', c_double), ('mean_error', c_double)]


class StippleImageChannelInfo(_Sized):
    _fields_ = [('struct_size', c_uint32), ('width', c_uint32), ('height', c_uint32), ('reserved', c_uint32),
                ('name_utf8', c_char_p)]


class StippleWeightsFile(_Sized):
    _fields_ = [('struct_size', c_uint32), ('role', c_uint32), ('state', c_uint32), ('reserved', c_uint32),
                ('bytes', c_uint64), ('published_bytes', c_uint64), ('modified_ns', c_int64), ('label_utf8', c_char_p),
                ('path_utf8', c_char_p), ('published_path_utf8', c_char_p), ('published_sha256_utf8', c_char_p),
                ('sha256_utf8', c_char_p), ('licence_utf8', c_char_p)]


class StippleWeightsInfo(_Sized):
    _fields_ = [('struct_size', c_uint32), ('file_count', c_uint32), ('note_count', c_uint64),
                ('folder_utf8', c_char_p), ('source_utf8', c_char_p)]


class StippleGenerateOptions(_Sized):
    _fields_ = [('struct_size', c_uint32), ('steps', c_uint32), ('token_count', c_uint32), ('canvas_size', c_uint32),
                ('erode_radius', c_uint32), ('noise_source', c_uint32), ('uses_mean_colour', c_uint32),
                ('watches_layers', c_uint32), ('measures_likeness', c_uint32), ('matches_colours', c_uint32),
                ('reserved', c_uint32), ('preview_steps', c_uint32), ('preview_anchors', c_uint64), ('seed', c_uint64),
                ('guidance', c_double), ('shift', c_double), ('size', c_double), ('weights_folder_utf8', c_char_p),
                ('checkpoint_path_utf8', c_char_p), ('encoded_by', c_void_p)]


class StippleGenerateEstimate(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('bytes', c_uint64), ('weight_bytes', c_uint64),
                ('seconds', c_double), ('operations', c_double), ('image_seconds', c_double)]


class StippleGenerateFigures(_Sized):
    _fields_ = [('struct_size', c_uint32), ('step', c_uint32), ('steps', c_uint32), ('resumed_step', c_uint32),
                ('preview_step', c_uint32), ('stage_count', c_uint32), ('seconds', c_double),
                ('seconds_left', c_double), ('likeness', c_double)]


class StippleGenerateStage(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('count', c_uint64), ('minimum', c_double),
                ('maximum', c_double), ('mean', c_double), ('deviation', c_double), ('seconds', c_double),
                ('name_utf8', c_char_p), ('operations', c_double)]


class StippleTrainFigures(_Sized):
    _fields_ = [('struct_size', c_uint32), ('measured_on_training', c_uint32), ('step', c_uint64),
                ('steps', c_uint64), ('resumed_step', c_uint64), ('skipped_steps', c_uint64),
                ('object_count', c_uint64), ('held_out_count', c_uint64), ('best_step', c_uint64),
                ('note_count', c_uint64), ('budget_count', c_uint64), ('loss', c_double), ('structure', c_double),
                ('psnr', c_double), ('seconds', c_double), ('seconds_left', c_double), ('stage', c_char * 64)]


class StippleTrainBudget(_Sized):
    _fields_ = [('struct_size', c_uint32), ('reserved', c_uint32), ('anchors', c_uint64), ('object_count', c_uint64),
                ('psnr', c_double), ('ssim', c_double), ('training_psnr', c_double),
                ('coarse_psnr', c_double), ('cut_psnr', c_double), ('coarse_splats', c_uint64)]


STRUCTS = {cls.__name__: cls for cls in _Sized.__subclasses__()}
