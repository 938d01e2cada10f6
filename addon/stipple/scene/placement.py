# SPDX-License-Identifier: GPL-3.0-or-later
"""Moving objects of the scene as one."""


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
