# SPDX-License-Identifier: GPL-3.0-or-later
"""Enumerations of stipple.h, value by value; tests/addon compares them with the header."""

from enum import IntEnum

from .fit_enums import FitBackground, FitModel, FitOptionKind, FitQuality, FitShell, KeyFrameBlend, SplatQuantity


class Status(IntEnum):
    OK = 0
    ERROR_INVALID_ARGUMENT = 1
    ERROR_OUT_OF_MEMORY = 2
    ERROR_MEMORY_LIMIT = 3
    ERROR_IO = 4
    ERROR_FORMAT = 5
    ERROR_UNSUPPORTED = 6
    ERROR_UNAVAILABLE = 7
    ERROR_CANCELLED = 8
    ERROR_BUFFER_TOO_SMALL = 9
    ERROR_INTERNAL = 10


class JobState(IntEnum):
    RUNNING = 0
    DONE = 1
    FAILED = 2
    CANCELLED = 3


class ColourSpace(IntEnum):
    DISPLAY = 0
    LINEAR = 1


class Antialias(IntEnum):
    CLASSIC = 0
    MIP = 1


class Frame(IntEnum):
    UNKNOWN = 0
    LDB = 1
    RDB = 2
    LUB = 3
    RUB = 4
    LDF = 5
    RDF = 6
    LUF = 7
    RUF = 8
    LFD = 9
    RFD = 10
    LFU = 11
    RFU = 12
    LBD = 13
    RBD = 14
    LBU = 15
    RBU = 16


class MaterialColour(IntEnum):
    CONSTANT = 0
    TEXTURE = 1
    CORNER = 2


class ViewSplit(IntEnum):
    NONE = 0
    TRAIN = 1
    TEST = 2
    VALIDATION = 3


class AnchorOrder(IntEnum):
    SYSTEMATIC = 0
    PROGRESSIVE = 1


class ViewRig(IntEnum):
    AUTOMATIC = 0
    AROUND = 1
    INSIDE = 2


class BudgetUnit(IntEnum):
    ANCHORS = 0
    SPLATS = 1


class CameraModel(IntEnum):
    PERSPECTIVE = 0
    ORTHOGRAPHIC = 1
    EQUIRECTANGULAR = 2
    FISHEYE_EQUIDISTANT = 3
    FISHEYE_EQUISOLID = 4


class LowPass(IntEnum):
    FROM_CLOUD = 0
    CLASSIC = 1
    MIP = 2
    NONE = 3


class BlendSpace(IntEnum):
    AS_TRAINED = 0
    SCENE_LINEAR = 1


class ObjectOrder(IntEnum):
    TOGETHER = 0
    APART = 1


class OutputColour(IntEnum):
    SCENE_LINEAR = 0
    COMPOSITED = 1


class RenderMethod(IntEnum):
    TILED = 0
    REFERENCE = 1
    RAYS = 2
    RAYS_UNLIMITED = 3


class AccuracyLevel(IntEnum):
    DRAFT = 0
    PREVIEW = 1
    FINAL = 2
    REFERENCE = 3


class AccuracySubject(IntEnum):
    IMAGE = 0
    VOLUME = 1
    FIT = 2


class SplatOrder(IntEnum):
    CENTRE = 0
    PIXEL = 1


class Projection(IntEnum):
    AFFINE = 0
    RAY = 1


class Sampling(IntEnum):
    AS_TRAINED = 0
    MIP = 1
    SAMPLES = 2


class Precision(IntEnum):
    FLOAT = 0
    DOUBLE = 1


class Effect(IntEnum):
    VIEW_COLOUR = 0
    MOTION = 1
    MOTION_BLUR = 2
    DEPTH_OF_FIELD = 3
    EXACT_PROJECTION = 4
    ZOOM_ANTIALIASING = 5
    TRANSPARENT_FILM = 6
    DEPTH_PASS = 7
    NORMAL_PASS = 8
    OBJECT_INDEX_PASS = 9
    MESH_OCCLUSION = 10
    GLOBAL_ORDER = 11


class EffectChoice(IntEnum):
    AUTO = 0
    ON = 1
    OFF = 2


class Side(IntEnum):
    INSIDE = 0
    OUTSIDE = 1


class MeshDensity(IntEnum):
    OFF = 0
    UNIFORM = 1
    ADAPTIVE = 2


class MeshAlignment(IntEnum):
    NONE = 0
    SIZE = 1
    RIGID = 2
    SIMILARITY = 3


class PictureDrawing(IntEnum):
    TRIANGLES = 0
    SPLATS = 1


class BindingReach(IntEnum):
    SURFACE = 0
    AROUND = 1


class RegionKind(IntEnum):
    ALL = 0
    BRUSH = 1
    LASSO = 2
    SPHERE = 3
    COLOUR = 4
    GROW = 5
    BOX = 6


class RegionOperation(IntEnum):
    SET = 0
    ADD = 1
    SUBTRACT = 2
    INTERSECT = 3
    TOGGLE = 4


class Transfer(IntEnum):
    LINEAR = 0
    SRGB = 1


class WeightsRole(IntEnum):
    STRUCTURE_ENCODER = 0
    COLOUR_ENCODER = 1
    FLOW = 2
    DECODER = 3


class WeightsState(IntEnum):
    MISSING = 0
    OTHER_SIZE = 1
    UNCHECKED = 2
    PUBLISHED = 3
    OTHER_CONTENT = 4
    TRAINED = 5
    NOT_NEEDED = 6


class NoiseSource(IntEnum):
    KEYED = 0
    TORCH_CPU = 1


# Each enumeration: the C type and what its values' names start with.
ENUMS = {
    'StippleStatus': (Status, 'STIPPLE_'),
    'StippleJobState': (JobState, 'STIPPLE_JOB_'),
    'StippleColourSpace': (ColourSpace, 'STIPPLE_COLOUR_'),
    'StippleAntialias': (Antialias, 'STIPPLE_ANTIALIAS_'),
    'StippleFrame': (Frame, 'STIPPLE_FRAME_'),
    'StippleMaterialColour': (MaterialColour, 'STIPPLE_MATERIAL_'),
    'StippleAnchorOrder': (AnchorOrder, 'STIPPLE_ORDER_'),
    'StippleViewRig': (ViewRig, 'STIPPLE_RIG_'),
    'StippleViewSplit': (ViewSplit, 'STIPPLE_VIEW_SPLIT_'),
    'StippleBudgetUnit': (BudgetUnit, 'STIPPLE_BUDGET_'),
    'StippleCameraModel': (CameraModel, 'STIPPLE_CAMERA_'),
    'StippleLowPass': (LowPass, 'STIPPLE_LOW_PASS_'),
    'StippleBlendSpace': (BlendSpace, 'STIPPLE_BLEND_'),
    'StippleObjectOrder': (ObjectOrder, 'STIPPLE_OBJECTS_'),
    'StippleOutputColour': (OutputColour, 'STIPPLE_OUTPUT_'),
    'StippleRenderMethod': (RenderMethod, 'STIPPLE_RENDER_'),
    'StippleAccuracyLevel': (AccuracyLevel, 'STIPPLE_ACCURACY_'),
    'StippleAccuracySubject': (AccuracySubject, 'STIPPLE_ACCURACY_OF_'),
    'StippleSplatOrder': (SplatOrder, 'STIPPLE_ORDER_'),
    'StippleProjection': (Projection, 'STIPPLE_PROJECTION_'),
    'StippleSampling': (Sampling, 'STIPPLE_SAMPLING_'),
    'StipplePrecision': (Precision, 'STIPPLE_PRECISION_'),
    'StippleEffect': (Effect, 'STIPPLE_EFFECT_'),
    'StippleEffectChoice': (EffectChoice, 'STIPPLE_EFFECT_'),
    'StippleSide': (Side, 'STIPPLE_SIDE_'),
    'StippleMeshDensity': (MeshDensity, 'STIPPLE_MESH_DENSITY_'),
    'StippleMeshAlignment': (MeshAlignment, 'STIPPLE_MESH_ALIGN_'),
    'StipplePictureDrawing': (PictureDrawing, 'STIPPLE_PICTURE_DRAWING_'),
    'StippleBindingReach': (BindingReach, 'STIPPLE_BIND_'),
    'StippleRegionKind': (RegionKind, 'STIPPLE_REGION_'),
    'StippleRegionOperation': (RegionOperation, 'STIPPLE_REGION_'),
    'StippleTransfer': (Transfer, 'STIPPLE_TRANSFER_'),
    'StippleFitModel': (FitModel, 'STIPPLE_FIT_'),
    'StippleKeyFrameBlend': (KeyFrameBlend, 'STIPPLE_BLEND_KEYS_'),
    'StippleFitQuality': (FitQuality, 'STIPPLE_FIT_'),
    'StippleSplatQuantity': (SplatQuantity, 'STIPPLE_QUANTITY_'),
    'StippleFitBackground': (FitBackground, 'STIPPLE_FIT_BACKGROUND_'),
    'StippleFitShell': (FitShell, 'STIPPLE_FIT_SHELL_'),
    'StippleNoiseSource': (NoiseSource, 'STIPPLE_NOISE_'),
    'StippleWeightsRole': (WeightsRole, 'STIPPLE_WEIGHTS_'),
    'StippleWeightsState': (WeightsState, 'STIPPLE_WEIGHTS_'),
    'StippleFitOptionKind': (FitOptionKind, 'STIPPLE_FIT_OPTION_'),
}
