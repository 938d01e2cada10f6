# SPDX-License-Identifier: GPL-3.0-or-later
"""How splats are selected with the mouse: settings of the scene, which the tools in the toolbar show."""

OPERATIONS = (('SET', "Set", "The region alone is selected"),
              ('ADD', "Extend", "The region is added to the selection"),
              ('SUBTRACT', "Subtract", "The region is taken from the selection"),
              ('INTERSECT', "Intersect", "What is selected and in the region stays selected"))
OPERATION_ICONS = {'SET': 'SELECT_SET', 'ADD': 'SELECT_EXTEND', 'SUBTRACT': 'SELECT_SUBTRACT',
                   'INTERSECT': 'SELECT_INTERSECT'}


def of(scene):
    return scene.stipple.selection
