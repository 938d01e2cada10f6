# SPDX-License-Identifier: GPL-3.0-or-later
"""A view for strokes of tests, and its own formulas of what a stroke contains."""

import bpy
import numpy as np

import scenes

SIZE = (320, 240)


class View:
    """What operators that draw are told of a camera, and where it sees points of the world."""

    def __init__(self, location=(0.4, 0.2, 6.0), rotation=(0.0, 0.0, 0.0), **camera):
        obj = scenes.camera(location, rotation, *SIZE, **camera)
        bpy.context.view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        view = np.array(obj.matrix_world.inverted())
        projection = np.array(obj.calc_matrix_camera(depsgraph, x=SIZE[0], y=SIZE[1]))
        self.given = {'view_matrix': view.reshape(-1).tolist(), 'projection_matrix': projection.reshape(-1).tolist(),
                      'region_size': SIZE}
        self._clip = projection @ view

    def pixels(self, world):
        """[N,2] from the bottom left corner, and [N] whether it is before the camera."""
        clip = np.c_[world, np.ones(len(world))] @ self._clip.T
        return (0.5 + 0.5 * clip[:, :2] / clip[:, 3:]) * SIZE, clip[:, 3] > 0


def path(*places):
    """The path of an operator."""
    return [{'name': '', 'loc': place, 'time': 0.0} for place in places]


def of_world(obj, positions):
    matrix = np.array(obj.matrix_world)
    return positions @ matrix[:3, :3].T + matrix[:3, 3]


def near_path(pixels, places, radius):
    """[N] whether pixels are at most so far from a path."""
    places, nearest = np.array(places, float), np.full(len(pixels), np.inf)
    for start, end in zip(places, places[1:] if len(places) > 1 else places):
        along = end - start
        share = np.clip((pixels - start) @ along / max(along @ along, 1e-30), 0, 1)
        nearest = np.minimum(nearest, np.linalg.norm(pixels - start - share[:, None] * along, axis=1))
    return nearest <= radius


def in_outline(pixels, places):
    """[N] whether pixels are inside, even-odd."""
    inside = np.zeros(len(pixels), bool)
    for (x0, y0), (x1, y1) in zip(places, places[1:] + places[:1]):
        crosses = (y0 > pixels[:, 1]) != (y1 > pixels[:, 1])
        with np.errstate(divide='ignore', invalid='ignore'):
            inside ^= crosses & (pixels[:, 0] < x0 + (x1 - x0) * (pixels[:, 1] - y0) / (y1 - y0))
    return inside


def oklab(linear):
    """Björn Ottosson's OKLab of linear Rec.709 [N,3]."""
    cones = np.array([[0.4122214708, 0.5363325363, 0.0514459929], [0.2119034982, 0.6806995451, 0.1073969566],
                      [0.0883024619, 0.2817188376, 0.6299787005]])
    lab = np.array([[0.2104542553, 0.7936177850, -0.0040720468], [1.9779984951, -2.4285922050, 0.4505937099],
                    [0.0259040371, 0.7827717662, -0.8086757660]])
    return np.cbrt(np.asarray(linear) @ cones.T) @ lab.T
