# SPDX-License-Identifier: GPL-3.0-or-later
"""What belongs to the machine rather than to a file."""

import bpy
from bpy.props import IntProperty, StringProperty

from . import version


class STIPPLE_AP_preferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    threads: IntProperty(name="Threads", description="Processor threads that native work may use, 0 for all", default=0,
                         min=0, max=1024)
    memory_limit: IntProperty(name="Memory Limit", description="Work that would need more memory than this many "
                              "mebibytes is refused before it starts, 0 for no limit", default=0, min=0)
    cache_folder: StringProperty(name="Cache Folder", description="Where sources of files that are not saved yet are "
                                 "kept, empty for Blender's user folder", subtype='DIR_PATH', options=version.RELATIVE_PATH)
    library_path: StringProperty(name="Library", description="Path of libstipple.so, empty for the one inside the "
                                 "add-on", subtype='FILE_PATH', options=version.RELATIVE_PATH)

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column()
        column.prop(self, 'threads')
        column.prop(self, 'memory_limit', text="Memory Limit (MiB)")
        column.prop(self, 'cache_folder')
        column.prop(self, 'library_path')


def get():
    """The add-on's preferences, or None while it is not enabled in the user's preferences."""
    addon = bpy.context.preferences.addons.get(__package__)
    return addon.preferences if addon else None


classes = (STIPPLE_AP_preferences,)
