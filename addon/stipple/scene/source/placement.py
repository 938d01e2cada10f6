# SPDX-License-Identifier: GPL-3.0-or-later
"""Where objects of the scene are, and moving them as one."""

import numpy as np

from ...binding.errors import invalid


def is_flat(matrix):
    """True for a matrix that leaves no extent along some axis: scaled to zero. The library's own limit."""
    linear = np.asarray(matrix, np.float64)[:3, :3]
    return abs(np.linalg.det(linear)) <= 1e-12 * np.prod(np.linalg.norm(linear, axis=0))


def matrix_of(obj):
    """[4,4] from an object to the world. Errors: StippleError for one that is scaled to zero."""
    matrix = np.array(obj.matrix_world, np.float64)
    if is_flat(matrix):
        raise invalid(f"Object '{obj.name}' is scaled to zero (its matrix is singular); give it some extent along "
                      'each axis.')
    return matrix


def chosen(context):
    """The active object and everything selected, without those whose parent moves along anyway."""
    objects = set(context.view_layer.objects.selected) | {context.view_layer.objects.active}

    def parent_moves(obj):
        while obj.parent is not None:
            obj = obj.parent
            if obj in objects:
                return True
        return False
    return [obj for obj in objects if not parent_moves(obj)]


def move(objects, matrix):
    """Applies a 4x4 matrix of the world to objects."""
    for obj in objects:
        obj.matrix_world = matrix @ obj.matrix_world
