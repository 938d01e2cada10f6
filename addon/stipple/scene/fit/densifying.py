# SPDX-License-Identifier: GPL-3.0-or-later
"""Density control of an object's splats, and detail for them, with views of the scene or photographs."""

import numpy as np

from ...binding.cloud import Cloud
from ...binding.densify import densify_start
from ...binding.detail import detail_start
from ...binding.errors import invalid
from ...binding.model import Model
from .. import meshes
from ..source import bound, masks, placement, source_paths, sources, sync
from .view_task import ViewTask

# Of a matrix that rotates, moves and scales alike: how far its axes may be from that, relative.
_EVENNESS = 1e-4


class DensifyTask(ViewTask):
    """Result: (model of the tree, cloud)."""

    parts = {'points': 0.01, 'views': 0.34, 'use': 0.45, 'keep': 0.20}

    def __init__(self, context, objects, settings, obj, cloud, chosen):
        """chosen: options of densify_start by name."""
        super().__init__(context, objects, settings)
        self.colour_space = cloud.info().colour_space
        self._cloud, self._chosen = cloud, chosen
        self._matrix = placement.matrix_of(obj)
        self._scale = _even_scale(self._matrix, obj.name)

    def _add_points(self, _views):
        """None: splats are there. But something must be seen."""
        if not meshes.source_objects(self._objects):
            raise invalid('There is no mesh to take views of; select one, show one, or choose a data set.')
        return iter(())

    def _add_view(self, views, seen, shot):
        views.add(self._placed(seen.camera), seen.linear, name=shot.name)

    def _placed(self, camera):
        """The same image, seen from the object's own space: its splats keep their numbers."""
        to_camera = np.array(camera.world_to_camera).reshape(4, 4) @ self._matrix
        to_camera[:3] /= self._scale
        for i, value in enumerate(to_camera.ravel()):
            camera.world_to_camera[i] = value
        camera.near_plane /= self._scale
        camera.far_plane /= self._scale
        return camera

    def _begin(self, views):
        """The job that makes the cloud."""
        return densify_start(self._native, self._cloud, views, **self._chosen)

    def _use(self, views):
        self.job = self._begin(views)
        try:
            yield from self._until_done(self.job, 'use')
            made = Cloud.of_job(self.job)
            self.job = Model.from_cloud_start(self._native, made, seed=self._chosen['seed'])
            yield from self._until_done(self.job, 'keep')
            self.result = Model.of_job(self.job), made
        finally:
            self.job = None


class DetailTask(DensifyTask):
    """The same for detail that a network adds."""

    def __init__(self, context, objects, settings, obj, cloud, weights_path, chosen):
        """chosen: options of detail_start by name."""
        super().__init__(context, objects, settings, obj, cloud, {'seed': settings.seed})
        self._weights_path, self._options = weights_path, chosen

    def _begin(self, views):
        return detail_start(self._native, self._cloud, views, self._weights_path, **self._options)


def replace(obj, model, cloud):
    """The object's splats become these. In: the result of a task."""
    count = cloud.info().count
    path = sources.save_model(model, source_paths.place_for(obj.name))
    sources.remember_model(path, model)
    # A datablock of its own: the old one may have other users, and undo goes back to it.
    data = obj.data.copy()
    with sync.paused():
        masks.clear(data)
        sources.attach_tree(data, path, count)
        if bound.follows(data):
            bound.rebind(data)
        data.stipple.ratio = data.stipple.ratio_render = 1.0
    sync.write_decoded(data, cloud.read())
    obj.data = data
    return count


def _even_scale(matrix, name):
    """Of a matrix that rotates, moves and scales alike along all axes."""
    linear = matrix[:3, :3]
    scale = np.cbrt(np.linalg.det(linear))
    if scale <= 0 or np.abs(linear @ linear.T / scale ** 2 - np.eye(3)).max() > _EVENNESS:
        raise invalid(f"'{name}' is scaled unevenly or mirrored; choose Apply Transform first, then its splats and the "
                      'images agree.')
    return scale
