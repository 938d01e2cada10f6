# SPDX-License-Identifier: GPL-3.0-or-later
"""Which effects an image of a scene needs: Blender's settings and what its splats say, as the native plan."""

from dataclasses import dataclass, field

from ...binding import effects as native
from ...binding.structs import CameraModel, Effect, EffectChoice, ObjectOrder
from . import apertures, facts as facts_of, motion, quality

NAMES = {Effect.VIEW_COLOUR: "View-Dependent Color", Effect.MOTION: "Motion", Effect.MOTION_BLUR: "Motion Blur",
         Effect.DEPTH_OF_FIELD: "Depth of Field", Effect.EXACT_PROJECTION: "Exact Projection",
         Effect.ZOOM_ANTIALIASING: "Zoom Anti-Aliasing", Effect.TRANSPARENT_FILM: "Transparent Film",
         Effect.DEPTH_PASS: "Depth Pass", Effect.NORMAL_PASS: "Normal Pass",
         Effect.OBJECT_INDEX_PASS: "Object Index Pass", Effect.MESH_OCCLUSION: "Occlusion by Meshes",
         Effect.GLOBAL_ORDER: "Global Ordering"}
# The property of the scene's settings that chooses an effect which Blender has no switch for.
CHOSEN_BY = {Effect.VIEW_COLOUR: 'view_color', Effect.EXACT_PROJECTION: 'exact_projection',
             Effect.ZOOM_ANTIALIASING: 'zoom_antialiasing', Effect.GLOBAL_ORDER: 'global_order'}
# Effects whose cost is the time of an image with them less that of one without.
MEASURABLE = (Effect.VIEW_COLOUR, Effect.MOTION_BLUR, Effect.DEPTH_OF_FIELD, Effect.EXACT_PROJECTION,
              Effect.ZOOM_ANTIALIASING, Effect.TRANSPARENT_FILM, Effect.DEPTH_PASS, Effect.NORMAL_PASS,
              Effect.OBJECT_INDEX_PASS, Effect.MESH_OCCLUSION, Effect.GLOBAL_ORDER)
# Where the switch of the others is: the tab of the properties editor.
TABS = {Effect.MOTION: 'RENDER', Effect.MOTION_BLUR: 'RENDER', Effect.DEPTH_OF_FIELD: 'DATA',
        Effect.TRANSPARENT_FILM: 'RENDER', Effect.DEPTH_PASS: 'VIEW_LAYER', Effect.NORMAL_PASS: 'VIEW_LAYER',
        Effect.OBJECT_INDEX_PASS: 'VIEW_LAYER', Effect.MESH_OCCLUSION: 'RENDER'}


@dataclass
class Look:
    """What was seen when splats were looked at last: of a camera and a frame."""

    survey: object
    camera_name: str
    frame: int
    camera_moves: bool = False
    moving_objects: int = 0
    meshes: int = 0
    seconds: dict = field(default_factory=dict)  # {Effect: measured}
    settings: str = ''  # at the time of measuring


# By scene.
_looks = {}


def look_of(scene):
    return _looks.get(scene.name_full)


def remember(scene, look):
    """Keeps a look for panels; what was measured stays while the view is the same."""
    known = look_of(scene)
    if known is not None and not look.seconds and (known.camera_name, known.frame) == (look.camera_name, look.frame):
        look.seconds, look.settings = known.seconds, known.settings
    _looks[scene.name_full] = look


def forget():
    _looks.clear()


def look(context, scene, placed, camera, camera_object, shutter=None, meshes=0):
    """Looks at an image's splats and keeps what they say. Errors: StippleError."""
    made = Look(native.survey(context, placed, camera), camera_object.name, scene.frame_current,
                shutter is not None and shutter.cameras is not None, shutter.moving_count if shutter else 0, meshes)
    remember(scene, made)
    return made


def plan(library, scene, view_layer, depsgraph, seen, camera_object=None):
    """[EffectRow], one of each. seen: a Look or None. Errors: StippleError."""
    return native.plan(library, facts(library, scene, view_layer, depsgraph, seen, camera_object))


def facts(library, scene, view_layer, depsgraph, seen, camera_object=None):
    """StippleEffectFacts of a scene's settings."""
    camera_object = camera_object or scene.camera
    camera = camera_object.data if camera_object is not None and camera_object.type == 'CAMERA' else None
    aperture = aperture_of(camera_object, depsgraph) if camera is not None else None
    models = {'PERSP': CameraModel.PERSPECTIVE, 'ORTHO': CameraModel.ORTHOGRAPHIC}
    settings = scene.stipple
    given = dict(
        camera_model=int(models.get(camera.type, CameraModel.PERSPECTIVE) if camera else CameraModel.PERSPECTIVE),
        motion_blur=motion.is_wanted(scene, view_layer), shutter_frames=scene.render.motion_blur_shutter,
        depth_of_field=aperture is not None, transparent_film=scene.render.film_transparent,
        depth_pass=view_layer.use_pass_z, normal_pass=view_layer.use_pass_normal,
        object_index_pass=view_layer.use_pass_object_index)
    for effect, name in CHOSEN_BY.items():
        given[effect.name.lower()] = int(EffectChoice[getattr(settings, name)])
    if aperture is not None:
        given.update(aperture_radius=aperture.aperture_radius, focus_distance=aperture.focus_distance)
    if seen is None:
        return native.facts(library, **given)
    given.update(camera_moves=seen.camera_moves, moving_objects=seen.moving_objects, hiding_meshes=seen.meshes)
    return native.facts(library, seen.survey, seen.seconds, **given)


def aperture_of(camera_object, depsgraph):
    """The Aperture of a camera, or None where all is sharp or there is nothing evaluated yet."""
    return apertures.aperture_of(camera_object, depsgraph) if depsgraph is not None else None


def is_current(scene, seen):
    """Whether what was measured is of the settings as they are now."""
    return seen.settings == settings_of(scene) and seen.frame == scene.frame_current


def settings_of(scene):
    """A text that is equal while an image takes as long."""
    return repr((choices_of(scene), quality.key_of(scene.stipple.quality_render), scene.stipple.blur_samples,
                 facts_of.picture_size(scene.render), scene.render.engine))


def object_order(scene, placed):
    """How the instances of an image are ordered. Where Auto is off, both orders are the same image, and that of all
    splats together takes no longer."""
    apart = scene.stipple.global_order == 'OFF' and len(placed) > 1
    return ObjectOrder.APART if apart else ObjectOrder.TOGETHER


def choices_of(scene):
    """What is chosen where Blender has no switch."""
    return tuple(getattr(scene.stipple, name) for name in CHOSEN_BY.values())
