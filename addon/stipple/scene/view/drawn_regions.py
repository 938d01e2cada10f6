# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn over a 3D view as regions of objects: pixels become cones through their splats.

Places in pixels have Blender's own axes, from the bottom left corner of the view; regions have the image's, from the top
left.
"""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from ...binding.errors import invalid
from ...binding.regions import Region, RegionKind
from ...binding.renderer import EMPTY_DEPTH, Renderer
from ...binding.structs import CameraModel, JobState
from .. import instances
from ..source import placement, sources
from . import cameras, mattes, view_mattes, viewed
from .facts import Border

# Pixels of the longer side of the image that tells what is in front: a stroke is far wider than one of them.
DEPTH_SIDE = 400
# A splat this far behind the surface is still its front, as a share of the width that the view has there: the thickness
# of what splats cover. Not of the depth: orthographic views stand anywhere.
FRONT_SHARE = 0.02

_SOLID = 0.5  # opacity of a mesh in a pixel from which on it hides splats

_meshes = view_mattes.ViewMattes()
_last = {}  # the image of depths that was asked for last, by what it shows: strokes of a view share it


@dataclass(frozen=True)
class Front:
    """Depths of what is seen in a view."""

    depths: np.ndarray  # [h,w] metres, row 0 = top; EMPTY_DEPTH where nothing is
    camera: object      # StippleCamera of the view

    def near(self, points, radius):
        """What a region of these points (axes of the image) has to know: the part of the depths around them."""
        rows, columns = self.depths.shape
        scale = np.array([columns / self.camera.width, rows / self.camera.height])
        low = np.clip(np.floor((points.min(axis=0) - radius) * scale), 0, (columns - 1, rows - 1)).astype(int)
        high = np.clip(np.ceil((points.max(axis=0) + radius) * scale), low + 1, (columns, rows)).astype(int)
        part = np.ascontiguousarray(self.depths[low[1]:high[1], low[0]:high[0]])
        solid = part[part < EMPTY_DEPTH]
        return {'depths': part, 'depth_rect': tuple(np.concatenate([low / scale, high / scale])),
                'depth_margin': self._margin(float(np.median(solid))) if solid.size else 0.0}

    def _margin(self, depth):
        width = self.camera.width / self.camera.fx
        return FRONT_SHARE * width * (depth if self.camera.model == CameraModel.PERSPECTIVE else 1.0)


class FrontTask:
    """Depths in the making: of splats, and of meshes."""

    def __init__(self, splats, meshes, camera, kept):
        """splats: a RenderTask. meshes: samples of mattes.start_samples, or None. kept: lives as long as this."""
        self._splats, self._meshes, self._camera, self._kept = splats, meshes, camera, kept

    def is_running(self):
        """Never waits."""
        return any(task is not None and task.job.poll()[0] == JobState.RUNNING for task in (self._splats, self._meshes))

    def front(self):
        """Waits. Errors: StippleError."""
        self._splats.job.wait()
        depths = self._splats.depth
        if self._meshes is not None:
            self._meshes.job.wait()
            depths = np.where(self._meshes.opacity >= _SOLID, np.minimum(depths, self._meshes.depth), depths)
        return Front(depths, self._camera)


def camera_of(view_matrix, projection_matrix, size):
    """The camera of 4x4 matrices as a 3D view has them, view_matrix and window_matrix. Errors: StippleError."""
    view, window = (np.array(matrix, np.float64).reshape(4, 4) for matrix in (view_matrix, projection_matrix))
    if min(size) < 1 or not (np.isfinite(view).all() and np.isfinite(window).all()) or placement.is_flat(view) or (
            window[0, 0] == 0 or window[1, 1] == 0):
        raise invalid('The view that the stroke was drawn in is not given; set view_matrix, projection_matrix and '
                      'region_size, or call the operator in a 3D view.')
    return cameras.from_view(SimpleNamespace(view_matrix=view, window_matrix=window), *size)


def start_front(depsgraph, camera, space=None, behind_meshes=False):
    """A FrontTask of the splats that a view shows. space: the 3D view, whose hidden objects hide nothing; None for all
    of the view layer. behind_meshes: whether meshes hide nothing. Errors: StippleError."""
    def is_seen(owner, obj, _placed):
        return space is None or viewed.shows(space, depsgraph, owner, obj)

    entries = [entry[2] for entry in instances.gather_owned(depsgraph, 'VIEWPORT') if is_seen(*entry)]
    hiding = []
    if not behind_meshes:
        _meshes.update(depsgraph, 'ALL')
        hiding = [entry[2] for entry in _meshes.placed
                  if is_seen(*entry) and entry[0].display_type not in {'WIRE', 'BOUNDS'}]
    coarse = -(-max(camera.width, camera.height) // DEPTH_SIDE)
    part = cameras.part_of(camera, Border(0, 0, camera.width, camera.height), coarse)
    key = (bytes(camera), tuple((id(cloud), matrix.tobytes()) for cloud, matrix, _ in entries),
           tuple((id(mesh), matrix.tobytes()) for mesh, matrix in hiding))
    if key not in _last:
        renderer = Renderer(sources.context())
        options = renderer.options()
        options.sh_degree_limit = 0  # nobody sees its colours
        task = renderer.start(entries, part, options, median_depth=True)
        meshes = mattes.start_samples(hiding, part, 1) if hiding else None
        _last.clear()
        # Which holds the clouds and meshes, so that their ids stay theirs.
        _last[key] = FrontTask(task, meshes, camera, (entries, hiding))
    return _last[key]


def brush(obj, camera, path, radius, operation, front=None):
    """The region of a stroke: path [n,2] and radius in pixels. front: a Front, None for all that lies behind, too."""
    return _drawn(RegionKind.BRUSH, obj, camera, path, operation, front, radius)


def lasso(obj, camera, path, operation, front=None):
    """The region inside an outline [n,2]."""
    return _drawn(RegionKind.LASSO, obj, camera, path, operation, front)


def sphere(obj, centre, radius, operation):
    """The region of a ball of the world."""
    return Region(RegionKind.SPHERE, operation, centre=tuple(centre), radius=radius,
                  cloud_to_box=placement.matrix_of(obj))


def colour(obj, value, tolerance, operation, centre=(0.0, 0.0, 0.0), radius=0.0):
    """The region of a colour, linear, inside a ball of the world; radius 0: everywhere."""
    return Region(RegionKind.COLOUR, operation, colour=tuple(value), tolerance=tolerance, centre=tuple(centre),
                  radius=radius, cloud_to_box=placement.matrix_of(obj))


def forget():
    global _meshes
    _meshes = view_mattes.ViewMattes()
    _last.clear()


def _drawn(kind, obj, camera, path, operation, front, radius=0.0):
    matrix = placement.matrix_of(obj)
    points = np.array(path, np.float64).reshape(-1, 2)
    points[:, 1] = camera.height - points[:, 1]
    to_camera = np.array(camera.world_to_camera).reshape(4, 4) @ matrix
    limits = {} if front is None else front.near(points, radius)
    return Region(kind, operation, cloud_to_pixels=_to_pixels(camera) @ to_camera, cloud_to_depth=to_camera[2],
                  points=points.astype(np.float32), radius=radius, **limits)


def _to_pixels(camera):
    """[4,4] from the camera's space to homogeneous pixels."""
    if camera.model == CameraModel.PERSPECTIVE:
        return np.array([[camera.fx, 0, camera.cx, 0], [0, camera.fy, camera.cy, 0], [0, 0, 1, 0], [0, 0, 1, 0]])
    return np.array([[camera.fx, 0, 0, camera.cx], [0, camera.fy, 0, camera.cy], [0, 0, 1, 0], [0, 0, 0, 1]])
