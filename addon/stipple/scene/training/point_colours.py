# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of points on a surface: the mean of the images that see them."""

import numpy as np
from mathutils.kdtree import KDTree

from ...binding import mesh as native
from ..source import sources
from . import sphere

# A pixel that the surface covers less of has no colour of its own.
_COVERED = 0.5
# Cosine of the flattest angle under which a point is seen: its plane says nothing of the pixel's depth beyond it.
_FLATTEST = 0.02
# Of a pixel's width: how far the depth that a point has there may be from the measured one.
_AGREEMENT = 0.25
# A triangle is turned where images see the back of its points so many times as much as their front. Along edges a pixel
# now and then is of another face; of two sheets that lie together, each has its front.
_TURNED = 4


class PointColours:
    """Adds up what images show of points. In: places [N,3], triangles that they lie on [N], normals of these [N,3], a
    native mesh that hides them.

    An image counts with the cosine between normal and view. Of a triangle that is seen from behind, since it is turned
    inwards, those images count.
    """

    def __init__(self, places, triangles, normals, mesh):
        self._triangles = triangles
        self._places, self._normals, self._mesh = places, normals, mesh
        self._front, self._back = (np.zeros((len(places), 4)) for _ in range(2))  # r g b weight

    def add(self, image, pose):
        """image [size,size,4] display values with straight alpha, row 0 = top; pose: of sphere.poses()."""
        size, focal = len(image), sphere.focal(len(image))
        rotation, eye = pose[:3, :3] * (1, -1, -1), pose[:3, 3]  # OpenCV's axes
        local = (self._places - eye) @ rotation
        normals = self._normals @ rotation
        ahead = np.maximum(local[:, 2], sphere.NEAR / 2)
        pixels = np.floor(local[:, :2] / ahead[:, None] * focal + size / 2).astype(int)
        inside = ((pixels >= 0) & (pixels < size)).all(1)
        x, y = np.where(inside[:, None], pixels, 0).T
        # Where the ray of the pixel meets the point's plane: there the mesh's depth was measured.
        rays = np.stack([(x + 0.5 - size / 2) / focal, (y + 0.5 - size / 2) / focal, np.ones(len(x))], 1)
        cosines = -(normals * local).sum(1) / np.linalg.norm(local, axis=1)
        steep = np.abs(cosines) > _FLATTEST
        slopes = (normals * rays).sum(1)
        depths = np.where(steep, (normals * local).sum(1) / np.where(steep, slopes, 1), np.inf)
        agrees = np.abs(depths - self._depth(pose, size)[y, x]) < _AGREEMENT * ahead / focal
        sees = inside & agrees & (image[y, x, 3] > _COVERED)
        for sums, weights in ((self._front, cosines), (self._back, -cosines)):
            weights = np.where(sees, np.maximum(weights, 0), 0)[:, None]
            sums += weights * np.concatenate([image[y, x, :3], np.ones((len(x), 1))], 1)

    def result(self):
        """(display colours [N,3], turned [N]: True where triangles are seen from behind), or None where no image sees
        any point."""
        front, back = (np.bincount(self._triangles, sums[:, 3]) for sums in (self._front, self._back))
        turned = (back > _TURNED * front)[self._triangles]
        sums = np.where(turned[:, None], self._back, self._front)
        seen = sums[:, 3] > 0
        if not seen.any():
            return None
        colours = sums[:, :3] / np.where(seen, sums[:, 3], 1)[:, None]
        numbers = np.flatnonzero(seen)
        tree = KDTree(len(numbers))
        for i, place in enumerate(self._places[numbers]):
            tree.insert(place, i)
        tree.balance()
        for i in np.flatnonzero(~seen):
            colours[i] = colours[numbers[tree.find(self._places[i])[1]]]
        return colours, turned

    def _depth(self, pose, size):
        task = native.start_depth(sources.context(), [(self._mesh, np.eye(4))], sphere.native_camera(pose, size))
        task.job.wait()
        return task.depth
