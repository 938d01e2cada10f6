# SPDX-License-Identifier: GPL-3.0-or-later
"""What settings and operators let choose from, (name, label, description), where the module that it is about is not
needed for registering and is imported late."""

# As Blender's own volume sequences name them.
SERIES_MODES = (('CLIP', "Clip", "Nothing before the first and after the last file"),
                ('EXTEND', "Extend", "The first file before the start, the last one after the end"),
                ('REPEAT', "Repeat", "From the first file again after the last one"),
                ('PING_PONG', "Ping-Pong", "The files play forward and backward alternately"))
SERIES_GAPS = (('ERROR', "Stop", "A missing file is an error: the panel says so, and a render fails"),
               ('HOLD', "Hold Previous", "In place of a missing file, the one before it is shown"))
FRAMES_OUT = (('CURRENT', "Current Frame", "The splats as they are shown now"),
              ('SERIES', "Whole Series",
               "Each file of the active object's series once, all objects placed as they are now"),
              ('SCENE', "Scene Range", "Each frame of the scene's range: timing, budgets and motion as animated"))
REACHES = (('SURFACE', "Surface", "Each splat follows the nearest triangle: for splats that were made from the mesh or "
                                  "lie on it"),
           ('AROUND', "Around", "Each splat follows the triangles around it, smoothly: for scans and fits near a mesh "
                                "or inside a cage"))
OVERLAYS = (('OFF', "Off", "Splats have their own colors"),
            ('SCORE', "Score", "How much each splat asked to multiply at the last event. Most strategies count in "
                               "thresholds, where a splat with 1 multiplies"),
            ('AGE', "Age", "Iterations of the fit since each splat was made; for densified splats, events"),
            ('SPLIT_AXIS', "Split Axis",
             "Direction of the longest axis, along which a splat would be split: red, green and "
             "blue for X, Y and Z of the object, grey where the splat is round"),
            ('CONTRIBUTION', "Contribution", "Pixels that each splat fills in a view"))
EFFECT_SWITCHES = (('AUTO', "Auto", "The effect is on where the image needs it"), ('ON', "On", "Always"),
                   ('OFF', "Off", "Never"))
