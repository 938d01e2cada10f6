# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats of a view as sorted ellipses, drawn by the graphics card.

A view keeps the order of its last sort and draws with it while the next one is made by the native
library's own thread: rotating a view never waits. Nothing here knows of Blender's objects.
"""

import weakref
from dataclasses import dataclass

import gpu
import numpy as np

from . import splat_shader
from ..binding import draw_order
from ..binding.renderer import Renderer
from ..binding.structs import Antialias, CameraModel, JobState
from .splat_shader import CLIP_PLANES, GEOMETRY_TEXELS, INSTANCE_TEXELS, INSTANCES_PER_ROW, TEXTURE_SPLATS

# Variance that the low-pass adds, px^2, and whether opacity is compensated: as the native renderer has them.
_LOW_PASS = {Antialias.CLASSIC: (0.3, 0.0), Antialias.MIP: (0.1, 1.0)}


@dataclass(frozen=True)
class ShownSplats:
    """One object or instance that a view shows."""

    key: tuple        # stays while it is the same instance
    cloud: object     # native cloud, or a GradedCloud
    count: int
    antialias: int
    matrix: np.ndarray  # [4,4] object to world, float64
    selected: bool = False

    @property
    def plain(self):
        """The cloud without its grade: what geometry is made of."""
        return getattr(self.cloud, 'cloud', self.cloud)

    @property
    def grade(self):
        """The grade's settings, or None."""
        return getattr(self.cloud, 'settings', None)


# Views of the same splats share them; an entry lives as long as a view's order does.
_geometries = weakref.WeakValueDictionary()


class Geometry:
    """The splats of some clouds in one texture, each cloud once however many instances it has."""

    def __init__(self, shown):
        clouds = {}
        for entry in shown:
            clouds.setdefault(id(entry.plain), (entry.plain, entry.count))
        array, first_rows = draw_order.pack([cloud for cloud, _ in clouds.values()],
                                            [count for _, count in clouds.values()], TEXTURE_SPLATS)
        self.texture = splat_shader.texture(array, GEOMETRY_TEXELS * TEXTURE_SPLATS)
        self._first_rows = dict(zip(clouds, first_rows))
        self._clouds = clouds  # an id stays one cloud's while that lives

    def first_row(self, entry):
        return self._first_rows[id(entry.plain)]


def _geometry_key(shown):
    return tuple(dict.fromkeys(id(entry.plain) for entry in shown))


@dataclass
class _Order:
    """What one sort gave, with all that it was made for."""

    geometry: Geometry
    keys: list        # of the instances, in the order of their numbers
    count: int        # of splats
    rows: object = None  # GPU texture


class SplatView:
    """The sorted splats of one view."""

    def __init__(self, context):
        self._renderer = Renderer(context)
        self._order = None
        self._task = None     # the sort that is being made
        self._pending = None  # _Order of that sort
        self._key = None      # what the newest sort is for

    def update(self, shown, camera, wait=False):
        """Starts a sort where the view has changed, takes the one that has ended. wait: for tests and the first
        image of a scene. Returns whether a sort is still on its way. Errors: StippleError."""
        self._take()
        if not shown:
            self._order, self._key = None, None
            return self._task is not None
        key = (_geometry_key(shown), tuple((e.key, e.grade, e.matrix.tobytes()) for e in shown), camera.model,
               bytes(camera.world_to_camera))
        if self._task is None and key != self._key:
            self._start(shown, camera, key)
        # With nothing else to show, the first sort of these splats is waited for.
        while self._task is not None and (wait or self._order is None
                                          or self._order.geometry is not self._pending.geometry):
            self._task.job.wait()
            self._take()
            if key != self._key:
                self._start(shown, camera, key)
        return self._task is not None

    def _start(self, shown, camera, key):
        self._key = key
        geometry = _geometries.get(_geometry_key(shown))
        if geometry is None:
            geometry = _geometries[_geometry_key(shown)] = Geometry(shown)
        count = sum(entry.count for entry in shown)
        self._pending = _Order(geometry, [entry.key for entry in shown], count)
        self._task = draw_order.start(self._renderer, [(e.cloud, e.matrix) for e in shown], count,
                                      [geometry.first_row(e) for e in shown], camera, TEXTURE_SPLATS)

    def _take(self):
        if self._task is None or self._task.job.poll()[0] == JobState.RUNNING:
            return
        task, self._task, key, self._key = self._task, None, self._key, None
        task.job.wait()  # raises what went wrong; the next update() tries again
        self._key = key
        self._order, self._pending = self._pending, None
        self._order.rows = splat_shader.texture(task.rows, TEXTURE_SPLATS)

    def is_sorting(self):
        return self._task is not None

    def has_new_order(self):
        """Whether the next update() will take another order."""
        return self._task is not None and self._task.job.poll()[0] != JobState.RUNNING

    def draw(self, shaders, shown, camera, window_matrix, depth_back=0.0, clip_planes=(), with_selection=False):
        """Draws into the bound framebuffer, whose depth is tested and not written.

        camera: as the native renderer's. window_matrix: Blender's, for depths; depth_back: metres by which the camera
        stands behind Blender's view. clip_planes: [n,4] in the world, hidden where the plane is above 0."""
        order = self._order
        if order is None:
            return
        # A shader does not keep what it samples alive: this name does, until the draw call is made.
        instances = _instances(order.keys, shown, camera, clip_planes)
        shader = shaders.splats(with_selection)
        shader.bind()
        shader.uniform_sampler('rows', order.rows)
        shader.uniform_sampler('geometry', order.geometry.texture)
        shader.uniform_sampler('instances', instances)
        set_camera(shader, camera, window_matrix, depth_back)
        shader.uniform_int('clipCount', len(clip_planes))
        gpu.state.blend_set('ALPHA_PREMULT')
        gpu.state.depth_test_set('LESS_EQUAL')
        gpu.state.depth_mask_set(False)
        gpu.state.face_culling_set('NONE')
        gpu.state.color_mask_set(True, True, True, True)
        shaders.draw_quads(shader, order.count)
        gpu.state.depth_test_set('NONE')
        gpu.state.blend_set('NONE')

    def close(self):
        if self._task is not None:
            self._task.job.close()
            self._task = None
        self._order = None
        self._renderer.close()


def set_camera(shader, camera, window_matrix, depth_back):
    size = np.array([camera.width, camera.height], np.float64)
    focal, middle = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
    centre, half = (0.5 * size - middle) / focal, 0.5 * size / focal
    window = np.array(window_matrix, np.float64)
    shader.uniform_float('lens', (*focal, *middle))
    shader.uniform_float('slopes', (*(centre - 1.3 * half), *(centre + 1.3 * half)))
    shader.uniform_float('range', (camera.near_plane, min(camera.far_plane, 3e38), 0.0, depth_back))
    shader.uniform_float('depths', (window[2, 2], window[2, 3]))
    shader.uniform_float('size', tuple(size))
    shader.uniform_int('perspective', int(camera.model == CameraModel.PERSPECTIVE))


def _instances(keys, shown, camera, clip_planes):
    """The texture of instances as they are now; those that a view does not show any more are hidden."""
    now = {entry.key: entry for entry in shown}
    lines = 1 + max(1, -(-len(keys) // INSTANCES_PER_ROW))
    texels = np.zeros((lines, INSTANCES_PER_ROW * INSTANCE_TEXELS, 4), np.float32)
    world_to_camera = np.array(camera.world_to_camera, np.float64).reshape(4, 4)
    if len(clip_planes):
        # A plane is a row: plane . (camera to world . p) for points p of the camera's frame.
        texels[0, :len(clip_planes)] = np.asarray(clip_planes,
                                                  np.float64)[:CLIP_PLANES] @ np.linalg.inv(world_to_camera)
    flat = texels[1:].reshape(-1, INSTANCE_TEXELS, 4)
    for i, key in enumerate(keys):
        entry = now.get(key)
        if entry is None:
            continue
        flat[i, :3] = (world_to_camera @ entry.matrix)[:3]
        opacity = 1.0 if entry.grade is None else entry.grade.opacity
        flat[i, 3] = (*_LOW_PASS[Antialias(entry.antialias)], opacity, float(entry.selected))
    return splat_shader.texture(texels, INSTANCES_PER_ROW * INSTANCE_TEXELS)
