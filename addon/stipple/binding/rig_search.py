# SPDX-License-Identifier: GPL-3.0-or-later
"""Where cameras stand that see a scene from everywhere."""

from ctypes import byref, c_double, c_uint64

import numpy as np

from .errors import check
from .handle import Handle, contiguous, new_handle, pointer_to
from .structs import StippleCamera, StippleRayHits, StippleRigSearchOptions, ViewRig


class RigSearch(Handle):
    """Asks a scene where cameras can stand.

        search = RigSearch.create(library, lowest, highest, count, rig=ViewRig.AROUND)
        cameras = search.cameras(cast)
    """

    free_function = 'stipple_rig_search_free'

    @classmethod
    def create(cls, library, lowest, highest, count, rig=ViewRig.AUTOMATIC, seed=0, angle=0.0, viewer=None, size=None):
        """lowest, highest: the corners of all that is to be seen, metres, z up. angle: full, radians; 0: as the rig has
        it. viewer: where the scene's own camera stands. size: pixels per side."""
        options = StippleRigSearchOptions()
        library.stipple_rig_search_options_init(byref(options))
        options.view_rig, options.view_count, options.seed, options.angle = int(rig), count, seed, angle
        options.bounds_min, options.bounds_max = _triple(lowest), _triple(highest)
        if viewer is not None:
            options.has_viewer, options.viewer = 1, _triple(viewer)
        if size is not None:
            options.view_size = size
        made = cls(library, new_handle(library, 'stipple_rig_search_create', byref(options)))
        made._count = count
        return made

    def cameras(self, cast):
        """StippleCamera of each view. cast(rays [N,7]: origin, unit direction, farthest distance) gives distances [N]
        (infinity: nothing), normals [N,3], objects [N] from 0 on, and the sides [M,3] of the objects' boxes."""
        count = c_uint64()
        while True:
            self._check(self.library.stipple_rig_search_rays(self.pointer, 0, None, byref(count)))
            if not count.value:
                return [self._camera(index) for index in range(self._count)]
            rays = np.empty((count.value, 7))
            self._check(self.library.stipple_rig_search_rays(self.pointer, len(rays), pointer_to(rays), byref(count)))
            self._answer(*cast(rays))

    def _answer(self, distances, normals, objects, sizes):
        distances, normals, sizes = (contiguous(array, np.float64) for array in (distances, normals, sizes))
        objects = contiguous(objects, np.uint32)
        hits = StippleRayHits(count=len(distances), distances=pointer_to(distances), normals=pointer_to(normals),
                              objects=pointer_to(objects), object_count=len(sizes), object_sizes=pointer_to(sizes))
        self._check(self.library.stipple_rig_search_answer(self.pointer, byref(hits)))

    def _camera(self, index):
        camera = StippleCamera()
        check(self.library, self.library.stipple_rig_search_camera(self.pointer, index, byref(camera)))
        return camera


def _triple(values):
    return (c_double * 3)(*values)
