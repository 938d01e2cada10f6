# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of splat data and of scenes. Names are forever: files store them."""

import bpy
from bpy.props import (BoolProperty, CollectionProperty, EnumProperty, FloatProperty, FloatVectorProperty, IntProperty,
                       IntVectorProperty, PointerProperty, StringProperty)

from . import choices, version
from .binding.errors import StippleError
from .scene import overlays, selection_settings
from .scene.fit import fit_proposal, fitting, strategies
from .scene.source import mesh_models, setting_paths, source_paths, source_settings, sources, splat_data, sync
from .scene.view import photo_cameras, quality

_OVERRIDABLE = {'LIBRARY_OVERRIDABLE'}
_CHANGEABLE = {'ANIMATABLE'}

ORDERS = (('SYSTEMATIC', "Systematic", "Anchors are spread most evenly at every budget"),
          ('PROGRESSIVE', "Progressive", "The anchors of a smaller budget are a part of those of a larger one, so a "
                                         "moving budget adds and removes anchors; splats shift a little. Smooth "
                                         "Budget lets none of them jump"))
TIME_MODES = (('HOLD', "Hold", "The splats stand still"),
              ('REPEAT', "Repeat", "The clip starts anew after its end"),
              ('PING_PONG', "Ping-Pong", "The clip plays forward and backward alternately"))
COLOR_SOURCES = (('MATERIAL', "Material", "Base colors of the materials: textures, color attributes, plain colors; "
                  "other node trees are baked"),
                 ('BAKED', "Baked Lighting", "Colors as lit by the scene, baked by Cycles"),
                 ('ATTRIBUTE', "Attribute", "The active color attribute"))

BAKE_SIZE_TEXT = ("Side of the square image that the light of an object is baked into, in pixels; 0 for 1024. The time "
                  "that it takes grows with its square. What shines is baked at the size of its textures")
BAKE_SAMPLES_TEXT = "Rays of light for each pixel of the image: more of them take longer and leave less noise"
BAKE_VIEWS_TEXT = ("Bake what reflects and refracts from 36 directions as well, so that it changes with the view. Blurred "
                   "reflections come out well, mirrors do not. Takes about twice as long")

BUDGET_KINDS = (('RATIO', "Ratio", "The budget is a share of the source's splats"),
                ('COUNT', "Count", "The budget is a number of splats"))
CROP_TIMES = (('SHOWN', "Shown Frame", "Splats that move are where they are at the frame that is shown"),
              ('CLIP', "Whole Clip", "Splats that move are inside if they are at any frame of their clip while they show"))
SIDES = (('INSIDE', "Inside", "Keep what is inside"), ('OUTSIDE', "Outside", "Keep what is outside"))


def _is_splat_object(_settings, obj):
    return splat_data.is_splat_object(obj)


class STIPPLE_PG_source_object(bpy.types.PropertyGroup):
    object: PointerProperty(name="Object", type=bpy.types.Object)


class STIPPLE_PG_source_file(bpy.types.PropertyGroup):
    file: PointerProperty(name="File", type=bpy.types.Image)


def _on_overlay_change(settings, context):
    overlays.on_change(settings, context)


def _on_sequence_change(stipple, context):
    source_paths.note(stipple)
    sync.on_property_change(stipple, context)


class STIPPLE_PG_splats(bpy.types.PropertyGroup):
    """On Mesh and PointCloud: splats are a cache of (source, settings)."""

    source: StringProperty(name="Source", description="File that the splats are decoded from", subtype='FILE_PATH',
                           options=version.RELATIVE_PATH, override=_OVERRIDABLE, update=source_paths.note)
    # Holds the path in a form that Blender itself keeps right: scene/source/source_paths.py.
    source_file: PointerProperty(type=bpy.types.Image, options={'HIDDEN'}, override=_OVERRIDABLE)
    source_kind: EnumProperty(name="Source Kind", description="What kind of file the source is",
                              items=source_settings.KINDS, default='NONE')
    source_settings: StringProperty(options={'HIDDEN'})  # which settings it has: scene/source/source_settings.py
    source_count: IntProperty(options={'HIDDEN'})  # of a splat tree
    source_stamp: StringProperty(options={'HIDDEN'})  # of the file as it was read
    budget_by: EnumProperty(name="Budget By", description="Whether the budget is a share or a number of splats",
                            items=BUDGET_KINDS, options=set(), override=_OVERRIDABLE, update=sync.on_property_change)
    ratio: FloatProperty(name="Ratio", description="Share of the source's splats that the viewport shows", default=1.0,
                         min=0.0, max=1.0, subtype='FACTOR', precision=3, options=_CHANGEABLE, override=_OVERRIDABLE,
                         update=sync.on_property_change)
    ratio_render: FloatProperty(name="Render Ratio", description="Share of the source's splats that renders show",
                                default=1.0, min=0.0, max=1.0, subtype='FACTOR', precision=3, options=_CHANGEABLE,
                                override=_OVERRIDABLE)
    # Limits are checked where the value is used, so that one beyond them is reported and not bent.
    anchors: IntProperty(name="Splats", description="Number of splats, or of the anchors that each become several",
                         default=20000, soft_min=1, soft_max=1000000, options=_CHANGEABLE, override=_OVERRIDABLE,
                         update=sync.on_property_change)
    anchors_render: IntProperty(name="Render Budget", description="Anchor budget of renders, 0 for the same as in the "
                                "viewport", default=0, soft_min=0, soft_max=10000000, options=_CHANGEABLE,
                                override=_OVERRIDABLE)
    detail: FloatProperty(name="Detail", description="How often the number of splats is doubled, here and in renders; "
                          "negative numbers halve it. Keyframe this instead of the number for a change of detail that "
                          "is even to the eye", default=0.0, min=-30.0, max=30.0, soft_min=-8.0, soft_max=8.0, step=10,
                          precision=2, options=_CHANGEABLE, override=_OVERRIDABLE, update=sync.on_property_change)
    smooth_budget: BoolProperty(name="Smooth Budget", description="As the number of splats changes, splats grow out of "
                                "others and none of them jumps. Up to twice as many splats are shown, and anchors are "
                                "in progressive order", default=False, options=_CHANGEABLE, override=_OVERRIDABLE,
                                update=sync.on_property_change)
    gaussians_per_anchor: IntProperty(name="Splats per Anchor", description="Number of splats that each anchor becomes",
                                      default=1, soft_min=1, soft_max=32, options=_CHANGEABLE, override=_OVERRIDABLE,
                                      update=sync.on_property_change)
    order: EnumProperty(name="Order", description="How anchors are drawn from the density", items=ORDERS,
                        options=_CHANGEABLE, override=_OVERRIDABLE, update=sync.on_property_change)
    seed: IntProperty(name="Seed", description="Another seed gives another, equally good set of anchors", default=0,
                      soft_min=0, options=_CHANGEABLE, override=_OVERRIDABLE, update=sync.on_property_change)
    # Of a field, which was learned for that many splats per anchor and those budgets; 0 of all else. Kept for versions
    # that know fields alone.
    learned_gaussians: IntProperty(options={'HIDDEN'})
    learned_least: IntProperty(options={'HIDDEN'})
    learned_most: IntProperty(options={'HIDDEN'})
    detail_weight: FloatProperty(name="Detail Weight", description="How much texture detail and curvature attract "
                                 "anchors, 0 for an even spread. Takes effect with Update from Source", default=1.0,
                                 min=0.0, soft_max=4.0, options=set(), override=_OVERRIDABLE)
    color_from: EnumProperty(name="Color From", description="Where colors come from. Takes effect with Update from "
                             "Source", items=COLOR_SOURCES, options=set(), override=_OVERRIDABLE)
    bake_size: IntProperty(name="Bake Size", description=BAKE_SIZE_TEXT + ". Takes effect with Update from Source",
                           default=0, min=0, max=4096, subtype='PIXEL', options=set(), override=_OVERRIDABLE)
    bake_samples: IntProperty(name="Bake Samples", description=BAKE_SAMPLES_TEXT + ". Takes effect with Update from "
                              "Source", default=32, min=1, soft_max=1024, options=set(), override=_OVERRIDABLE)
    bake_views: BoolProperty(name="View-Dependent", description=BAKE_VIEWS_TEXT + ". Takes effect with Update from "
                             "Source", default=False, options=set(), override=_OVERRIDABLE)
    refine: BoolProperty(name="Refine", description=mesh_models.REFINE_TEXT + ". Takes effect with Update from Source",
                         default=False, options=set(), override=_OVERRIDABLE)
    # What the present source was made with, to say when the settings above differ.
    source_detail_weight: FloatProperty(options={'HIDDEN'})
    source_color_from: StringProperty(options={'HIDDEN'})
    source_refine: BoolProperty(options={'HIDDEN'})
    source_bake_views: BoolProperty(options={'HIDDEN'})
    source_bake: IntVectorProperty(size=2, default=(0, 32), options={'HIDDEN'})
    source_objects: CollectionProperty(type=STIPPLE_PG_source_object)
    source_fingerprint: StringProperty(options={'HIDDEN'})
    source_changed: BoolProperty(name="Source Changed",
                                 description="The mesh differs from the one that the splats were "
                                             "made from", options={'HIDDEN'})
    # A series of files, one for each frame; source is its first. Names and meaning as in Blender's volumes.
    is_sequence: BoolProperty(name="Sequence", description="The source is the first of a numbered series of files, one "
                              "for each frame", options=set(), override=_OVERRIDABLE, update=_on_sequence_change)
    series_files: CollectionProperty(type=STIPPLE_PG_source_file)  # of a packed series: scene/source/source_packing.py
    frame_duration: IntProperty(name="Frames", description="Number of files of the series that are used", default=1,
                                min=1, options=set(), override=_OVERRIDABLE, update=sync.on_property_change)
    frame_start: IntProperty(name="Start", description="Frame of the scene at which the series or clip starts", default=1,
                             options=_CHANGEABLE, override=_OVERRIDABLE, update=sync.on_property_change)
    frame_offset: IntProperty(name="Offset", description="Added to the number of the file or of the clip's frame that is "
                              "shown; keyframes here time it freely", default=0, options=_CHANGEABLE, override=_OVERRIDABLE,
                              update=sync.on_property_change)
    frame_speed: FloatProperty(name="Speed", description="Number of files, or of the clip's frames, that pass in each "
                                                         "frame of the scene; a negative number plays backward",
                               default=1.0, soft_min=-4.0, soft_max=4.0, options=set(), override=_OVERRIDABLE,
                               update=sync.on_property_change)
    sequence_mode: EnumProperty(name="Mode", description="What is shown before the first and after the last file",
                                items=choices.SERIES_MODES, options=set(), override=_OVERRIDABLE,
                                update=sync.on_property_change)
    time_mode: EnumProperty(name="Mode", description="What splats that move do before and after their clip",
                            items=TIME_MODES, options=set(), override=_OVERRIDABLE, update=sync.on_property_change)
    missing_frames: EnumProperty(name="Missing Files", description="What happens where a file of the series is "
                                                                   "missing",
                                 items=choices.SERIES_GAPS, options=set(), override=_OVERRIDABLE,
                                 update=sync.on_property_change)
    # The colour grade: limits are those of the native library.
    exposure: FloatProperty(name="Exposure", description="Brightness in stops, +1 doubles the light of every splat",
                            default=0.0, min=-16.0, max=16.0, soft_min=-5.0, soft_max=5.0, step=10, precision=2,
                            options=_CHANGEABLE, override=_OVERRIDABLE, update=sync.on_property_change)
    tint: FloatVectorProperty(name="Tint",
                              description="Color that the light of every splat is multiplied by, white for "
                                          "none", size=3, default=(1.0, 1.0, 1.0), min=0.0, max=16.0, soft_max=1.0,
                              subtype='COLOR', options=_CHANGEABLE, override=_OVERRIDABLE,
                              update=sync.on_property_change)
    saturation: FloatProperty(name="Saturation", description="Strength of the colors: 0 makes them grey, 1 leaves "
                                                             "them as they are",
                              default=1.0, min=0.0, max=16.0, soft_max=2.0, options=_CHANGEABLE, override=_OVERRIDABLE,
                              update=sync.on_property_change)
    grade_opacity: FloatProperty(name="Opacity", description="Share of every splat's opacity, 0 hides the object",
                                 default=1.0, min=0.0, max=1.0, subtype='FACTOR', options=_CHANGEABLE,
                                 override=_OVERRIDABLE, update=sync.on_property_change)
    fit_report: PointerProperty(name="Fit Report", description="Curves of the fit that made the splats",
                                type=bpy.types.Image)
    # What the splats follow: scene/source/bound.py.
    bind_object: PointerProperty(name="Mesh", description="Mesh that the splats follow", type=bpy.types.Object,
                                 options={'HIDDEN'}, override=_OVERRIDABLE)
    bind_rest: PointerProperty(type=bpy.types.Mesh, options={'HIDDEN'})  # its shape when they were bound
    bind_rest_render: PointerProperty(type=bpy.types.Mesh, options={'HIDDEN'})  # in renders, where they differ
    bind_reach: EnumProperty(name="Bind", description="Which part of the mesh each splat follows",
                             items=choices.REACHES, options={'HIDDEN'})
    bind_matrix: FloatVectorProperty(size=16, options={'HIDDEN'})  # from the mesh's space to the splats', row by row
    bind_topology: StringProperty(options={'HIDDEN'})  # of its faces
    bind_topology_render: StringProperty(options={'HIDDEN'})
    bind_key: StringProperty(options={'HIDDEN'})       # tells bindings apart
    bind_follow: BoolProperty(name="Follow Mesh", description="The splats follow the mesh. Off, they rest where they were "
                              "bound, and can be edited", default=True, options=set(), override=_OVERRIDABLE,
                              update=sync.on_property_change)
    edited: BoolProperty(name="Edited", description="The splats were edited by hand", options={'HIDDEN'})


class STIPPLE_PG_fit(bpy.types.PropertyGroup):
    """How splats are fitted to views of the scene."""

    views_from: EnumProperty(name="Views", description="What the splats are to look like",
                             items=(('RIG', "Camera Rig", "The fit renders the selected meshes, or all if none is "
                                                          "selected, from cameras that are made for it"),
                                    ('CAMERAS', "Scene Cameras", "The fit renders through the cameras of the scene"),
                                    ('DATASET', "Photos", "The fit learns from a folder of photographs with their "
                                                          "cameras: COLMAP or transforms.json")), options=set())
    rig: EnumProperty(name="Rig", description="Where the cameras of the rig are placed",
                      items=(('AUTO', "Automatic", "Inside if the scene's camera is between walls, otherwise around"),
                             ('AROUND', "Around", "The cameras are on a sphere around everything and look in"),
                             ('INSIDE', "Inside", "The cameras are between the walls of a room and look everywhere")),
                      options=set())
    view_count: IntProperty(name="Count", description="Number of views that are rendered; of Moving Splats, the number "
                            "of cameras", default=60, min=1, soft_max=500, max=10000, options=set())
    # Of splats that move: which frames, and which images of all cameras at all of them.
    scene_range: BoolProperty(name="Scene Range", description="The fit takes the frames from the scene's start to its "
                              "end", default=True, options=set())
    range_start: IntProperty(name="Start", description="First frame of the splats' clip", default=1, options=set())
    range_end: IntProperty(name="End", description="Last frame of the splats' clip", default=250, options=set())
    frame_step: FloatProperty(name="Step", description="Frames from one time that is seen to the next; below 1, times "
                              "between two frames are seen, too", default=1.0, min=0.01, soft_min=0.1, soft_max=10.0,
                              max=1000.0, step=25, precision=2, options=set())
    image_count: IntProperty(name="Images", description="Number of images that are rendered, or used of photographs, at "
                             "most, spread evenly over frames and cameras: each frame is seen by about as many cameras",
                             default=300, min=2, soft_max=2000, max=1000000, options=set())
    held_out_cameras: IntProperty(name="Held Out", description="Number of cameras whose images the fit is "
                                  "measured on and never learns from. With 0 it is measured on every eighth image",
                                  default=0, min=0, soft_max=10, max=10000, options=set())
    # The same of photographs.
    series_whole: BoolProperty(name="All Frames", description="The fit takes every frame that the data set has",
                               default=True, options=set())
    series_first: IntProperty(name="First", description="First frame that is used, by the number in the names of the "
                              "images, or counted from 0 where the data set says times", default=0, min=0, options=set())
    series_last: IntProperty(name="Last", description="Last frame that is used", default=299, min=0, options=set())
    series_step: IntProperty(name="Step", description="The fit uses every so many-th frame", default=1, min=1,
                             soft_max=30, max=100000, options=set())
    series_rate: FloatProperty(name="Frame Rate", description="Numbered images of a camera are so many per second. With 0 "
                               "the data set says it, or 30 are", default=0.0, min=0.0, soft_max=120.0, max=1e6,
                               precision=2, options=set())
    held_out_names: StringProperty(name="Held Out", description="Names of cameras, with commas between, that the fit is "
                                   "measured on and never learns from. Without any, the data set says it", options=set())
    view_size: IntProperty(name="Resolution", description="Pixels of the longer side of a view", default=256, min=16,
                           soft_max=1024, max=8192, options=set())
    engine: EnumProperty(name="Engine", description="Engine that renders the views",
                         items=(('CYCLES', "Cycles", "Cycles renders the light as in the final image"),
                                ('EEVEE', "EEVEE", "EEVEE renders the light as it shows it in the viewport"),
                                ('WORKBENCH', "Workbench", "Workbench renders plain colors without light, and is the "
                                                           "quickest")), options=set())
    samples: IntProperty(name="Samples", description="Samples per pixel of a view", default=64, min=1, soft_max=1024,
                         options=set())
    transparent: BoolProperty(name="Transparent Film", description="On, the fit learns the objects alone; off, it "
                                                                   "also learns the world behind them", default=True,
                              options=set())
    dataset: StringProperty(name="Folder", description="Folder with photographs and their cameras",
                            subtype='DIR_PATH', options=version.RELATIVE_PATH,
                            update=setting_paths.noting('dataset'))
    # Images hold the paths in a form that Blender itself keeps right: scene/source/setting_paths.py.
    dataset_file: PointerProperty(type=bpy.types.Image, options={'HIDDEN'})
    report_file: PointerProperty(type=bpy.types.Image, options={'HIDDEN'})
    checkpoint_file: PointerProperty(type=bpy.types.Image, options={'HIDDEN'})
    up_axis: EnumProperty(name="Up Axis",
                          description="Which way is up in the data set; choose the same for its cameras",
                          items=photo_cameras.UP_AXES, options=set())
    downscale: IntProperty(name="Downscale", description="Factor by which photographs are made smaller along each "
                                                         "side before the fit learns from them", default=1, min=1,
                           soft_max=8, max=64, options=set())
    max_splats: IntProperty(name="Splats", description="Maximum number of splats of the fit", default=100000, min=100,
                            soft_max=1000000, max=100000000, options=set())
    quality: EnumProperty(name="Quality", description="How many steps the fit takes",
                          items=(('FAST', "Fast", "Few steps, for a first look"),
                                 ('BALANCED', "Balanced", "A number of steps that is enough for most shots"),
                                 ('FINE_DETAIL', "Fine Detail", "Many steps, for close views of fine texture")),
                          default='BALANCED', options=set())
    view_dependent: BoolProperty(name="View-Dependent Color", description="Colors change with the direction of the "
                                                                          "view, as those of shiny objects do. Each "
                                                                          "splat then has more numbers", default=False,
                                 options=set())
    model: EnumProperty(name="Model", description="What the fit learns: splats, a density of anchors, splats that "
                                                  "move, anchors with features, or such anchors at key frames",
                        items=(('EXPLICIT', "Splats", "The fit learns splats, each with numbers of its own"),
                               ('FIELD', "Density Field", "The fit learns a density of anchors, which decodes at any "
                                                          "budget"),
                               ('MOTION', "Moving Splats", "The fit learns splats that move, from views at several "
                                                           "frames, which then play on the timeline"),
                               ('SCAFFOLD', "Anchors", "The fit learns anchors with features, which small networks "
                                                       "turn into splats. A budget keeps the anchors that matter "
                                                       "most"),
                               ('RELAY', "Long Shot", "The fit learns anchors at key frames of a long clip, what becomes "
                                                      "of them until the next key frames, and how two of them blend")),
                        options=set())
    key_frame_spacing: FloatProperty(name="Key-Frame Spacing", description="Seconds from one key frame of a long shot to "
                                                                           "the next. Things that move fast want less",
                                     default=1.0, min=0.01, max=3600.0, soft_max=10.0, subtype='TIME_ABSOLUTE',
                                     unit='TIME_ABSOLUTE', options=set())
    strategy: EnumProperty(name="Strategy", description="How splats are added and removed while they are fitted",
                           items=strategies.strategy_items, default=strategies.BY_QUALITY_NUMBER, options=set())
    parts: EnumProperty(name="Parts", description="Parts of other strategies that are added, or that take the place "
                                                  "of the strategy's own",
                        items=strategies.part_items, options={'ENUM_FLAG'})
    density_gradient: BoolProperty(name="Learn Density", description="The fit moves anchors to where they help the "
                                                                     "images most", default=True, options=set())
    shell: EnumProperty(name="Shell", description="The field gets a shell behind the objects that holds a world or a "
                                                  "landscape, and fills the gaps between the splats of walls",
                        items=(('AUTO', "Auto", "The field gets a shell where views are opaque: far out, or close "
                                                "behind the walls of a closed room"),
                               ('ON', "On", "Always"), ('OFF', "Off", "Never")), options=set())
    begin_with: PointerProperty(name="Begin With", type=bpy.types.Object, poll=_is_splat_object,
                                description="The fit begins with a copy of this object's splats where they are, as Add "
                                            "Detail, a mesh or another fit left them; empty: it makes its own")
    seed: IntProperty(name="Seed", description="Another seed gives another, equally good fit", default=0, min=0,
                      options=set())
    shown: EnumProperty(name="Show", description="What the 3D view shows until you accept the fit; renders show the "
                                                 "source",
                        items=(('SPLATS', "Splats", "The 3D view shows the fit alone"),
                               ('SOURCE', "Source", "The 3D view shows what is fitted"),
                               ('BOTH', "Both", "The 3D view shows both")), options={'SKIP_SAVE'},
                        update=fit_proposal.on_shown_change)
    # A bar for Blenders whose layouts have none of their own.
    progress: FloatProperty(name="Progress", subtype='PERCENTAGE', min=0.0, max=100.0, precision=0,
                            options={'HIDDEN', 'SKIP_SAVE'}, get=lambda _: 100 * fitting.state.fraction)
    report: StringProperty(name="Report", description="File for the fit's figures (.json, and curves as .svg beside "
                           "it); empty for none", subtype='FILE_PATH', options=version.RELATIVE_PATH,
                           update=setting_paths.noting('report'))
    checkpoint: StringProperty(name="Checkpoint",
                               description="File (.safetensors) that keeps the state of a fit once a "
                                           "minute while it runs, so that it can go on after a stop or a crash; empty "
                                           "for none",
                               subtype='FILE_PATH', options=version.RELATIVE_PATH,
                               update=setting_paths.noting('checkpoint'))
    resume: BoolProperty(name="Go On", description="The fit goes on from the checkpoint if there is one; otherwise it"
                                                   " starts from the beginning and replaces it", default=True,
                         options=set())


class STIPPLE_PG_overlay(bpy.types.PropertyGroup):
    """What the 3D view colours splats by."""

    kind: EnumProperty(name="Color By", description="Quantity that colors the splats in the 3D view, to examine "
                                                    "density control", items=choices.OVERLAYS, options=set(),
                       update=_on_overlay_change)
    auto_range: BoolProperty(name="Auto Range", description="The color range goes from the lowest to the highest "
                                                            "value that is shown, without a few extremes", default=True,
                             options=set(), update=_on_overlay_change)
    low: FloatProperty(name="From", description="Value of the darkest color", default=0.0, options=set(),
                       update=_on_overlay_change)
    high: FloatProperty(name="To", description="Value of the brightest color", default=1.0, options=set(),
                        update=_on_overlay_change)


def _on_level_change(self, _context):
    try:
        quality.take_level(sources.context().library, self)
    except StippleError:
        pass  # without the library there is no image, and the panels say so


class STIPPLE_PG_quality(bpy.types.PropertyGroup):
    """How exact images are: a level, which sets every knob, and the knobs."""

    level: EnumProperty(name="Quality", description="How exact images are", items=quality.LEVELS, default='FINAL',
                        options=set(), override=_OVERRIDABLE, update=_on_level_change)
    order: EnumProperty(name="Order", description="How splats are ordered in depth", items=quality.ORDERS,
                        options=set(), override=_OVERRIDABLE)
    projection: EnumProperty(name="Projection", description="How splats are projected into the image", options=set(),
                             items=quality.PROJECTIONS, override=_OVERRIDABLE)
    antialiasing: EnumProperty(name="Anti-Aliasing", description="How splats that are smaller than pixels are "
                                                                 "filtered",
                               items=quality.SAMPLINGS, options=set(), override=_OVERRIDABLE)
    samples_per_side: IntProperty(name="Samples", description="Samples along each side of a pixel", default=1, min=1,
                                  max=16, options=set(), override=_OVERRIDABLE)
    sh_degree_limit: IntProperty(name="Harmonics", description="Colors change with the view up to this degree",
                                 default=4, min=0, max=4, options=set(), override=_OVERRIDABLE)
    precision: EnumProperty(name="Precision", description="Precision of the numbers in which splats are blended",
                            items=quality.PRECISIONS, options=set(), override=_OVERRIDABLE)
    least_alpha: FloatProperty(name="Cut-Off",
                               description="Splats are skipped where they cover less than this share of "
                                           "a pixel", default=1 / 255, min=1e-9, max=0.5, precision=5, options=set(),
                               override=_OVERRIDABLE)
    budget_share: FloatProperty(name="Share of Splats", description="Splats are merged until this share of them is "
                                                                    "left",
                                default=1.0, min=0.001, max=1.0, subtype='FACTOR', options=set(), override=_OVERRIDABLE)


class STIPPLE_PG_selection(bpy.types.PropertyGroup):
    """How the tools in the toolbar select splats."""

    operation: EnumProperty(name="Operation", description="What becomes of the selection before; with Shift the tools "
                            "extend it, with Ctrl they subtract, with both they intersect",
                            items=selection_settings.OPERATIONS, options=set())
    radius: FloatProperty(name="Radius", description="Radius of the brush, pixels", default=40.0, min=1.0, max=5000.0,
                          soft_max=500.0, subtype='PIXEL', options=set())
    front_only: BoolProperty(name="Front Only", description="Select what is seen, and nothing that lies behind other "
                             "splats and meshes", default=False, options=set())
    through_meshes: BoolProperty(name="Through Meshes", description="With Front Only, select what meshes hide, too",
                                 default=False, options=set())
    tolerance: FloatProperty(name="Tolerance", description="How different from the color that is clicked a color may "
                             "be; 0.1 is a family of one hue", default=0.08, min=0.0, soft_max=0.5, subtype='FACTOR',
                             precision=3, options=set())
    within: FloatProperty(name="Within", description="Distance from the click up to which colors are looked for, 0 for "
                          "everywhere", default=0.0, min=0.0, subtype='DISTANCE', unit='LENGTH', options=set())


class STIPPLE_PG_scene(bpy.types.PropertyGroup):
    quality_viewport: PointerProperty(type=STIPPLE_PG_quality)
    quality_render: PointerProperty(type=STIPPLE_PG_quality)
    compare_first: EnumProperty(name="Left", description="Setting of the first half of a comparison",
                                items=quality.SIDES, default='VIEWPORT', options=set(), override=_OVERRIDABLE)
    compare_second: EnumProperty(name="Right", description="Setting of the second half of a comparison",
                                 items=quality.SIDES, default='RENDER', options=set(), override=_OVERRIDABLE)
    view_color: EnumProperty(
        name="View-Dependent Color", description="Colors change with the direction of the view. Auto uses the degree "
                                                 "of harmonics that carries 99.9 % of the change",
                                                 items=choices.EFFECT_SWITCHES, options=set(),
        override=_OVERRIDABLE)
    exact_projection: EnumProperty(
        name="Exact Projection", description="Splats are drawn along the rays of the pixels instead of as flat "
                                             "ellipses. Auto does so where ellipses are wrong by more than a pixel",
                                             items=choices.EFFECT_SWITCHES, options=set(), override=_OVERRIDABLE)
    zoom_antialiasing: EnumProperty(
        name="Zoom Anti-Aliasing", description="Splats smaller than pixels keep their light. Auto does so where the "
                                               "low-pass that they were trained with makes them twice as large",
                                               items=choices.EFFECT_SWITCHES, options=set(),
        override=_OVERRIDABLE)
    global_order: EnumProperty(
        name="Global Ordering", description="Splats of all objects are sorted together. Off draws each object as a "
                                            "whole, with farther ones behind it. Auto sorts them together where "
                                            "objects share a range of depth", items=choices.EFFECT_SWITCHES,
        options=set(), override=_OVERRIDABLE)
    blur_samples: IntProperty(
        name="Blur Samples", description="Number of images that depth of field and motion blur average; 0 chooses as "
                                         "many as the blur needs", default=0, min=0, soft_max=256, max=65536,
                                         options=set(), override=_OVERRIDABLE)
    splat_color: EnumProperty(
        name="Splat Color", description="Space in which splats are blended over each other",
        items=(('AS_TRAINED', "As Trained", "Blend in display space, as splats are trained and web viewers show them"),
               ('SCENE_LINEAR', "Scene Linear", "Blend light, as all other objects are")),
        options=set(), override=_OVERRIDABLE)
    meshes_as_mattes: BoolProperty(
        name="Meshes as Mattes", description="Meshes hide the splats behind them and leave a hole in the image, in "
                                             "which a render of the meshes can be composited. Shadow catchers hide "
                                             "nothing", default=True, options=set(),
        override=_OVERRIDABLE)
    shadow_margin: FloatProperty(
        name="Shadow Margin",
        description="Splats that are nearer to the camera than a shadow catcher by more than this get "
                    "none of its shadows", default=0.5, min=0.0, soft_max=10.0, subtype='DISTANCE', options=set(),
        override=_OVERRIDABLE)
    fit: PointerProperty(type=STIPPLE_PG_fit)
    overlay: PointerProperty(type=STIPPLE_PG_overlay)
    selection: PointerProperty(type=STIPPLE_PG_selection)
    max_splats: IntProperty(
        name="Max Splats", description="Maximum number of splats that the viewport shows, over all objects and their "
                                       "instances; 0 is no limit. Objects share them in proportion to their own "
                                       "budgets", default=0, min=0, soft_max=10000000,
        options=set(), override=_OVERRIDABLE, update=sync.on_limit_change)
    max_splats_render: IntProperty(
        name="Max Splats", description="Maximum number of splats that a render shows, over all objects and their "
                                       "instances; 0 is no limit. Objects share them in proportion to their own "
                                       "budgets", default=0, min=0, soft_max=100000000,
        options=set(), override=_OVERRIDABLE)


classes = (STIPPLE_PG_source_object, STIPPLE_PG_source_file, STIPPLE_PG_splats, STIPPLE_PG_fit, STIPPLE_PG_overlay,
           STIPPLE_PG_selection, STIPPLE_PG_quality, STIPPLE_PG_scene)


def register():
    for owner in (bpy.types.Mesh, bpy.types.PointCloud):
        owner.stipple = PointerProperty(name="Stipple", type=STIPPLE_PG_splats, override=_OVERRIDABLE)
    bpy.types.Scene.stipple = PointerProperty(name="Stipple", type=STIPPLE_PG_scene, override=_OVERRIDABLE)


def unregister():
    del bpy.types.Scene.stipple
    for owner in (bpy.types.PointCloud, bpy.types.Mesh):
        del owner.stipple
