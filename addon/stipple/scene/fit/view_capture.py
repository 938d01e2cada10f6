# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene as cameras see it, image by image: what splats are fitted to.

Cycles hands its passes over in memory. EEVEE and Workbench write one uncompressed image at a time, into memory that has
a path where the system has such (Linux: memfd), else into a folder of their own. In background mode Blender leaves no
other way to depth, normals and scene linear colours at the samples of a render: the Viewer node keeps its first size
there, the Render Result has none (3.4, 4.3, 5.2), and GPUOffScreen.draw_view3d() gives the viewport's image in display
colours.
"""

import contextlib
import functools
import os
import shutil
import tempfile
from dataclasses import dataclass

import bpy
import numpy as np

from ... import cycles_functions, version
from ...binding.errors import StippleError, invalid
from ...binding.image import ImageChannels
from ...binding.structs import Status
from ...cycles_functions import CyclesRender
from ..source import sources, splat_data
from ..view import cameras

ENGINES = {'CYCLES': 'CYCLES', 'EEVEE': version.EEVEE_ENGINE, 'WORKBENCH': 'BLENDER_WORKBENCH'}
_CAPTURE_ENGINE = 'STIPPLE_CAPTURE'
_MULTI_LAYER = {'file_format': 'OPEN_EXR_MULTILAYER'}
if version.VERSION >= (5, 0, 0):
    _MULTI_LAYER = {'media_type': 'MULTI_LAYER_IMAGE', **_MULTI_LAYER}
# Blender's engines mark emptiness by a depth of 65504 and more, or by the far end of the camera.
_FARTHEST, _SHARE_OF_END = 6e4, 0.999
# Pixels that a thing moves by from one frame to the next; rounding moves what stands still by less.
_LEAST_MOTION = 0.01
# A change of a camera that shows nowhere.
_ANOTHER_CAMERA = 1.0001
# Depth and normals of pixels that something covers in part are mixtures: not used.
_WHOLE = 0.99


@dataclass
class Captured:
    """Row 0 is the top."""

    name: str
    camera: object        # StippleCamera
    linear: np.ndarray    # [H,W,4] scene linear Rec.709, premultiplied
    depth: np.ndarray     # [H,W] planar z, metres; 0 where unknown
    normals: np.ndarray   # [H,W,3] world, unit; 0 where unknown; None where the engine has none
    moving: np.ndarray    # [H,W] bool, what is elsewhere a frame before or after; None where that is not known


@dataclass(frozen=True)
class CaptureSettings:
    engine: str = 'CYCLES'    # a key of ENGINES
    size: int = 256           # pixels of the longer side
    samples: int = 64         # per pixel; Workbench takes none
    transparent: bool = True  # False: the world is part of the images


class Capture:
    """Renders views of a scene. Everything of the scene that it sets is as before after the `with`.

        with Capture(context, objects, settings) as capture:
            view = capture.pose('view_0001', pose)

    objects: who may be seen; everything else that renders is hidden. Errors: StippleError.
    """

    def __init__(self, context, objects, settings):
        if settings.engine not in ENGINES:
            raise invalid(f"Engine is '{settings.engine}'; allowed are {', '.join(ENGINES)}.")
        if settings.engine == 'CYCLES' and CyclesRender is None:
            raise StippleError('This Blender was built without Cycles; EEVEE or Workbench can render the views.',
                               Status.ERROR_UNAVAILABLE)
        self._scene, self._layer = context.scene, context.view_layer
        self._objects, self._settings = set(objects), settings
        self._left = contextlib.ExitStack()
        self._passes = {}

    def __enter__(self):
        with contextlib.ExitStack() as stack:
            self._prepare(stack)
            self._left = stack.pop_all()
        return self

    def __exit__(self, *_):
        self._left.close()

    def pose(self, name, pose, with_moving=False):
        """A view from a pose of view_rigs: a square image. with_moving: also what moves in it, if the engine can tell;
        the scene is evaluated at the frames around, too."""
        camera, render = self._camera.data, self._scene.render
        camera.type, camera.sensor_fit = 'PERSP', 'HORIZONTAL'
        camera.shift_x = camera.shift_y = 0.0
        camera.angle_x = pose.angle
        camera.clip_start, camera.clip_end = pose.near, pose.far
        self._camera.matrix_world = pose.matrix
        render.resolution_x = render.resolution_y = self._settings.size
        render.pixel_aspect_x = render.pixel_aspect_y = 1.0
        return self._render(name, self._camera, with_moving)

    def camera(self, camera_object, with_moving=False):
        """The view of one of the scene's cameras, in the scene's proportions. Errors: panoramic cameras, which no fit
        can learn from."""
        if camera_object.data.type == 'PANO':
            raise StippleError(f"Camera '{camera_object.name}' is of type PANO; views are taken by perspective and "
                               'orthographic cameras.', Status.ERROR_UNSUPPORTED)
        render, (width, height) = self._scene.render, self._proportions
        share = self._settings.size / max(width, height)
        render.resolution_x = max(1, round(width * share))
        render.resolution_y = max(1, round(height * share))
        with self._still(camera_object) if with_moving else contextlib.nullcontext(camera_object) as seen_by:
            return self._render(camera_object.name, seen_by, with_moving)

    def _prepare(self, stack):
        scene, render, settings = self._scene, self._scene.render, self._settings
        self._proportions = render.resolution_x, render.resolution_y
        kept = _Kept(stack)
        engine = ENGINES[settings.engine]
        if settings.engine == 'CYCLES':
            self._register_capture(stack)
            engine = _CAPTURE_ENGINE
            kept.set(scene.cycles, samples=settings.samples, use_denoising=False, use_adaptive_sampling=False)
        elif settings.engine == 'EEVEE':
            kept.set(scene.eevee, taa_render_samples=settings.samples)
        else:
            # Its lights turn with the camera: no two views would agree.
            kept.set(scene.display.shading, light='FLAT', color_type='TEXTURE')
        self._path = None
        if settings.engine != 'CYCLES':
            self._path = _picture_path(stack)
            stack.callback(_set_in_order, render.image_settings, _file_settings(render.image_settings))
            _set_in_order(render.image_settings, {**_MULTI_LAYER, 'color_depth': '32', 'exr_codec': 'NONE'})
            kept.set(render, filepath=self._path, use_file_extension=False)
        kept.set(render, engine=engine)
        kept.set(render, resolution_x=render.resolution_x, resolution_y=render.resolution_y, resolution_percentage=100,
                 pixel_aspect_x=render.pixel_aspect_x, pixel_aspect_y=render.pixel_aspect_y, use_border=False,
                 film_transparent=settings.transparent, use_compositing=False, use_sequencer=False,
                 use_motion_blur=False, use_multiview=False, use_persistent_data=True)
        kept.set(self._layer, use_pass_z=True, use_pass_normal=True, use_pass_vector=False)
        kept.set(scene, camera=scene.camera)
        for marker in scene.timeline_markers:
            kept.set(marker, camera=None)  # it would take the place of the view's camera
        for layer in scene.view_layers:
            kept.set(layer, use=layer == self._layer)
        self._layer.update()  # else its list may hold what has been removed
        for obj in list(self._layer.objects):
            if not obj.hide_render and obj.type not in {'LIGHT', 'CAMERA', 'LIGHT_PROBE'} and not self._is_seen(obj):
                for curve in version.animation_curves(obj, 'hide_render'):
                    kept.set(curve, mute=True)
                kept.set(obj, hide_render=True)
        self._camera = bpy.data.objects.new('Stipple View', bpy.data.cameras.new('Stipple View'))
        stack.callback(_remove_camera, self._camera.name)
        scene.collection.objects.link(self._camera)

    @contextlib.contextmanager
    def _still(self, camera_object):
        """A camera that stays where this one is now: what moves by it alone does not move."""
        mine, lens = self._camera.data, camera_object.data.copy()
        try:
            lens.animation_data_clear()
            self._camera.data, self._camera.matrix_world = lens, camera_object.matrix_world
            yield self._camera
        finally:
            self._camera.data = mine
            bpy.data.cameras.remove(lens)

    def _is_seen(self, obj):
        return obj in self._objects and not splat_data.is_splat_object(obj)

    def _register_capture(self, stack):
        passes = self._passes

        class STIPPLE_RE_capture(cycles_functions.functions(), bpy.types.RenderEngine):
            bl_idname = _CAPTURE_ENGINE
            bl_label = "Stipple Views"

            def render(self, depsgraph):
                draw = functools.partial(super().render, depsgraph)
                found = cycles_functions.render(self, draw, depsgraph.view_layer.name)
                result = self.get_result()
                for name, render_pass in (found or {}).items():
                    passes[name] = version.read_pass(render_pass, result.resolution_x, result.resolution_y)[::-1]

        bpy.utils.register_class(STIPPLE_RE_capture)
        stack.callback(bpy.utils.unregister_class, STIPPLE_RE_capture)

    def _render(self, name, camera_object, with_moving):
        scene = self._scene
        scene.camera = camera_object
        if self._layer.use_pass_vector != with_moving:  # where it is as it was, Cycles keeps what it has of the scene
            self._layer.use_pass_vector = with_moving
        if with_moving:  # Cycles that kept a camera from a render without the pass takes it for one that moves
            camera_object.data.clip_end *= _ANOTHER_CAMERA
        self._passes.clear()
        with bpy.context.temp_override(scene=scene, view_layer=self._layer):
            try:
                bpy.ops.render.render(write_still=self._path is not None, scene=scene.name)
            except RuntimeError as error:
                said = '; '.join(line.removeprefix('Error: ') for line in str(error).strip().splitlines())
                raise StippleError(f"View '{name}' could not be rendered: {said}", Status.ERROR_IO) from None
        if self._path is not None:
            self._read_file()
        if 'Combined' not in self._passes:
            raise StippleError(f"Blender rendered no image for view '{name}'; its messages are in the console.",
                               Status.ERROR_IO)
        return self._captured(name, cameras.camera_of(camera_object, scene.render))

    def _read_file(self):
        try:
            self._passes.update(layers_of(ImageChannels.load(sources.context(), self._path)))
            os.truncate(self._path, 0)  # an old image never passes for a new one
        except StippleError as error:
            raise StippleError(f'A rendered view cannot be read: {error}', error.status) from None
        except OSError as error:
            raise StippleError(f'A rendered view cannot be read: {error}', Status.ERROR_IO) from None

    def _captured(self, name, camera):
        linear = np.ascontiguousarray(self._passes['Combined'], np.float32)
        if not np.isfinite(linear).all():
            row, column = np.argwhere(~np.isfinite(linear).all(axis=2))[0]
            raise invalid(f"View '{name}' has a colour that is not finite at pixel ({column}, {row}); a material or "
                          f"light "
                          'of the scene makes it.')
        # An opaque film covers every pixel; of Workbench's half floats some say 0.9985.
        linear[..., 3] = np.clip(linear[..., 3], 0, 1) if self._settings.transparent else 1
        depth = self._passes['Depth'][..., 0] if 'Depth' in self._passes else np.zeros(linear.shape[:2], np.float32)
        end = min(_FARTHEST, _SHARE_OF_END * camera.far_plane)
        is_known = np.isfinite(depth) & (depth > 0) & (depth < end) & (linear[..., 3] > _WHOLE)
        normals = None
        if 'Normal' in self._passes:
            length = np.linalg.norm(self._passes['Normal'], axis=2, keepdims=True)
            known = is_known[..., None] & (length > 0.5)
            normals = np.where(known, self._passes['Normal'] / np.maximum(length, 1e-9), 0).astype(np.float32)
        moving = None
        if 'Vector' in self._passes:
            moving = np.abs(self._passes['Vector']).max(axis=2) > _LEAST_MOTION
        return Captured(name, camera, linear, np.where(is_known, depth, 0).astype(np.float32), normals, moving)


def layers_of(channels):
    """{pass: [H,W,n]} of the passes that an ImageChannels has whole, whatever its view layer is called."""
    names, found = channels.names(), {}
    for name, letters in (('Combined', 'RGBA'), ('Depth', 'Z'), ('Normal', 'XYZ'),
                          ('Vector', 'XYZW')):
        places = [next((i for i, full in enumerate(names) if full.endswith(f'{name}.{letter}')), None)
                  for letter in letters]
        if None not in places:
            found[name] = np.stack([channels.read(place) for place in places], axis=-1)
    return found


def _picture_path(stack):
    """A path that Blender can write an image to; what is there ends with the stack."""
    if hasattr(os, 'memfd_create'):
        memory = os.memfd_create('stipple-view')
        stack.callback(os.close, memory)
        path = f'/proc/self/fd/{memory}'
        if os.path.exists(path):
            return path
    folder = tempfile.mkdtemp(prefix='stipple-views-')
    stack.callback(shutil.rmtree, folder, True)
    return os.path.join(folder, 'view.exr')


def _file_settings(image):
    """What of a scene's image settings a layered file changes."""
    return {name: getattr(image, name) for name in (*_MULTI_LAYER, 'color_mode', 'color_depth', 'exr_codec')}


def _set_in_order(owner, values):
    """What one setting may be depends on those before it."""
    for name, value in values.items():
        setattr(owner, name, value)


class _Kept:
    """Sets properties and puts them back when a stack closes, last one first."""

    def __init__(self, stack):
        self._stack = stack

    def set(self, owner, **values):
        for name, value in values.items():
            before = getattr(owner, name)
            self._stack.callback(setattr, owner, name, before)
            setattr(owner, name, value)


def _remove_camera(name):
    camera_object = bpy.data.objects.get(name)
    if camera_object is not None:
        bpy.data.cameras.remove(camera_object.data)  # its object goes with it


def scene_cameras(scene):
    """The scene's cameras that a view can be made of, by name."""
    return sorted((obj for obj in scene.objects if obj.type == 'CAMERA' and obj.data.type in {'PERSP', 'ORTHO'}),
                  key=lambda obj: obj.name)

