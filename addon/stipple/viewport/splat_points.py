# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats as coloured points: in wireframe, and where ellipses would be too many for the graphics card."""

import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from .. import version
from ..scene.source import splat_data
from ..scene.view import facts

# Points that are drawn of one object; more would only hide each other.
MAX_POINTS = 2_000_000
POINT_SIZE_PX = 2.0


class SplatPoints:
    """The points of objects, kept on the graphics card until their splats change."""

    def __init__(self):
        self._batches = {}

    def draw(self, entries, depsgraph, overlay=None):
        """Draws viewed splats into the bound framebuffer, with depth. overlay: gives them other colours."""
        shader = gpu.shader.from_builtin(version.FLAT_COLOR_SHADER)
        gpu.state.depth_test_set('LESS_EQUAL')
        gpu.state.depth_mask_set(True)
        gpu.state.point_size_set(POINT_SIZE_PX)
        for entry in entries:
            with gpu.matrix.push_pop():
                gpu.matrix.multiply_matrix(Matrix(entry.matrix))
                self._batch_of(entry, depsgraph, shader, overlay).draw(shader)
        gpu.state.point_size_set(1.0)
        gpu.state.depth_mask_set(False)
        gpu.state.depth_test_set('NONE')
        used = {entry.obj.name_full for entry in entries}
        self._batches = {name: known for name, known in self._batches.items() if name in used}

    def _batch_of(self, entry, depsgraph, shader, overlay):
        known = self._batches.get(entry.obj.name_full)
        state = (entry.state, overlay and overlay.scale)
        if known is None or known[0] != state:
            step = -(-entry.count // MAX_POINTS)
            positions, dc = splat_data.read_points(entry.obj.evaluated_get(depsgraph).data, step)
            colours = np.ones((len(positions), 4), np.float32)
            colours[:, :3] = facts.display_colours(dc) if overlay is None else overlay.colours(entry)[::step]
            known = (state, batch_for_shader(shader, 'POINTS', {'pos': positions, 'color': colours}))
            self._batches[entry.obj.name_full] = known
        return known[1]
