# SPDX-License-Identifier: GPL-3.0-or-later
"""What belongs to the machine rather than to a file."""

import functools
import os

import bpy
from bpy.props import CollectionProperty, EnumProperty, IntProperty, StringProperty

from . import version


POINTS_ABOVE = 1_000_000
UP_AXES = (('AUTO', "From File", "The frame is what the file says, or what files of its format usually have"),
           ('Z', "Z Up", "As in Blender"), ('-Y', "-Y Up", "Y points down, as in most captured scenes: the frame of "
                                                           "their first camera"),
           ('Y', "Y Up", "As in glTF and most game engines"))


def _on_weights_folder_change(chosen, context):
    from .scene.generate import weights_table  # it reads these preferences
    weights_table.on_folder_change(chosen, context)


class STIPPLE_PG_format(bpy.types.PropertyGroup):
    """What was chosen last for files of a format; its name is the format's."""

    up_axis: EnumProperty(name="Up Axis", description="The up direction of files that do not say theirs", items=UP_AXES)


class STIPPLE_AP_preferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    threads: IntProperty(name="Threads", description="Processor threads that native work may use, 0 for all", default=0,
                         min=0, max=1024)
    memory_limit: IntProperty(name="Memory Limit", description="Work that would need more memory than this many "
                              "mebibytes is refused before it starts, 0 for 60 % of this machine's memory", default=0,
                              min=0)
    cache_folder: StringProperty(name="Cache Folder", description="Where sources of files that are not saved yet are "
                                 "kept, empty for Blender's user folder", subtype='DIR_PATH',
                                 options=version.RELATIVE_PATH)
    budget_cache: IntProperty(name="Budget Cache", description="Mebibytes of memory in which splats of budgets are kept "
                              "once they are decoded, over all objects, so that going back to a budget takes no time; "
                              "0 for a quarter of Memory Limit", default=0, min=0)
    sequence_cache: IntProperty(name="Sequence Cache", description="Mebibytes of memory in which files of splat "
                                "sequences are kept, over all objects", default=1024, min=0)
    read_ahead: IntProperty(name="Read Ahead", description="Files of a splat sequence that are read before they are "
                            "shown, as far as the cache has room; 0 to read each when it is shown", default=4, min=0,
                            max=64)
    library_path: StringProperty(name="Library", description="Absolute path of libstipple.so, on Windows of "
                                 "stipple.dll, on macOS of libstipple.dylib; empty for the one inside the add-on. "
                                 "Paths that start at the open file are refused", subtype='FILE_PATH')
    points_above: IntProperty(name="Points Above", description="Maximum number of splats that a 3D view draws as "
                                                               "ellipses. Beyond it, the largest objects are drawn as"
                                                               " colored points", default=POINTS_ABOVE, min=0,
                              max=16_000_000)
    weights_folder: StringProperty(name="Weights Folder", description="Where the files of networks are that turn images "
                                   "into splats. You download them yourself; what they are called does not matter",
                                   subtype='DIR_PATH', update=_on_weights_folder_change)
    weights_table: StringProperty(options={'HIDDEN'})  # what is known of its files: scene/generate/weights_table.py
    formats: CollectionProperty(type=STIPPLE_PG_format)

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column()
        column.prop(self, 'threads')
        column.prop(self, 'memory_limit', text="Memory Limit (MiB)")
        column.prop(self, 'points_above')
        column.prop(self, 'cache_folder')
        column.prop(self, 'budget_cache', text="Budget Cache (MiB)")
        column.prop(self, 'sequence_cache', text="Sequence Cache (MiB)")
        column.prop(self, 'read_ahead')
        column.prop(self, 'library_path')
        for entry in self.formats:
            column.prop(entry, 'up_axis', text=f"Up Axis of .{entry.name}")
        from .panels import weights  # it reads these preferences
        weights.draw(layout, context, self)


def get():
    """The add-on's preferences, or None while it is not enabled in the user's preferences."""
    addon = bpy.context.preferences.addons.get(__package__)
    return addon.preferences if addon else None


def chosen_weights_folder():
    """The folder of the files of networks' weights that the user has chosen, '' for none."""
    chosen = get()
    return os.path.normpath(chosen.weights_folder) if chosen is not None and chosen.weights_folder else ''


@functools.cache
def shipped_weights_folder():
    """The folder of the networks that came with this add-on, '' where none did."""
    folder = os.path.join(os.path.dirname(__file__), 'networks')
    return folder if os.path.isfile(os.path.join(folder, 'flow.safetensors')) else ''


def weights_folder():
    """The folder of the files of networks' weights: the user's, else that of the networks that came with this add-on."""
    return chosen_weights_folder() or shipped_weights_folder()


def up_axis(format_name):
    """The up axis that was chosen last for a format: a key of UP_AXES."""
    chosen = get()
    entry = chosen.formats.get(format_name) if chosen is not None else None
    return entry.up_axis if entry is not None else 'AUTO'


def remember_up_axis(format_name, axis):
    chosen = get()
    if chosen is None or up_axis(format_name) == axis:
        return
    entry = chosen.formats.get(format_name) or chosen.formats.add()
    entry.name, entry.up_axis = format_name, axis
    bpy.context.preferences.is_dirty = True


classes = (STIPPLE_PG_format, STIPPLE_AP_preferences)
