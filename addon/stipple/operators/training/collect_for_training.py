# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects become images from all around and coloured points, which networks learn from."""

import os

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from ... import version
from ...binding.errors import StippleError, invalid
from ...jobs import JobOperator, ViewsFirst
from ...scene.source import source_paths
from ...scene.training import assets, collecting

_SOURCES = (('COLLECTION', "Collection", "The objects of a collection of this file, each with its children"),
            ('FOLDER', "Folder", "The files of a folder, and of those in it: .blend, .glb, .gltf, .obj, .ply and .stl"))


class STIPPLE_OT_collect_for_training(ViewsFirst, JobOperator, bpy.types.Operator):
    """Render objects from all around in an even light and write images, cameras and colored points of each into a
    folder of its own, for networks to learn from. What is there already is kept. Esc ends, and the next time goes on
    from there"""

    bl_idname = 'stipple.collect_for_training'
    bl_label = "Collect for Training"
    bl_options = {'PRESET'}

    directory: StringProperty(name="Output Folder", description="Folder that gets a folder for each object",
                              subtype='DIR_PATH', options=version.RELATIVE_PATH)
    filter_folder: BoolProperty(default=True, options={'HIDDEN', 'SKIP_SAVE'})
    source: EnumProperty(name="Source", description="What is collected", items=_SOURCES)
    collection: StringProperty(name="Collection", description="Collection of this file whose objects are collected")
    assets_folder: StringProperty(name="Assets", description="Folder of the files that are collected",
                                  subtype='DIR_PATH', options=version.RELATIVE_PATH)
    view_count: IntProperty(name="Views", description="Number of images of each object, from cameras all around it",
                            default=24, min=1, soft_max=200, max=9999)
    image_size: IntProperty(name="Image Size", description="Pixels along both sides of an image", default=128, min=8,
                            soft_max=1024, max=8192, subtype='PIXEL')
    samples: IntProperty(name="Samples", description="Samples per pixel of an image", default=16, min=1, soft_max=1024)
    points: IntProperty(name="Points", description="Number of colored points on the surface of each object",
                        default=16384, min=1, soft_max=200000, max=1 << 24)
    seed: IntProperty(name="Seed", description="Another seed puts cameras and points elsewhere", default=0, min=0)

    @classmethod
    def poll(cls, context):
        if context.mode != 'OBJECT':
            cls.poll_message_set('Go to Object Mode first')
            return False
        return True

    def invoke(self, context, _event):
        if not self.collection and context.collection.name in bpy.data.collections:
            self.collection = context.collection.name
        context.window_manager.fileselect_add(self)
        return {'RUNNING_MODAL'}

    def execute(self, context):
        return JobOperator.execute(self, context) if bpy.app.background else self.run_in_window(context)

    def start(self, _context):
        folder = _absolute(self.directory, 'output folder')
        settings = collecting.CollectSettings(self.view_count, self.image_size, self.samples, self.points, self.seed)
        return collecting.CollectTask(self._assets(folder), folder, settings, self._say_line)

    def finish(self, _context, job):
        collected = job.result
        for name, reason in collected.left_out:
            self.report({'WARNING'}, f"'{name}' is left out: {reason}")
        if not collected.done and not collected.kept:
            raise StippleError(f'Nothing could be collected; {len(collected.left_out)} left out.')
        self.report({'INFO'}, f"{collected.summary()}, in '{os.path.basename(os.path.normpath(self.directory))}'")

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(self, 'source')
        if self.source == 'COLLECTION':
            layout.prop_search(self, 'collection', bpy.data, 'collections')
        else:
            layout.prop(self, 'assets_folder')
        for name in ('view_count', 'image_size', 'samples', 'points', 'seed'):
            layout.prop(self, name)

    def _assets(self, folder):
        if self.source == 'FOLDER':
            return assets.of_folder(_absolute(self.assets_folder, 'folder of assets'), left_out=folder)
        if not self.collection:
            raise invalid('No collection is chosen; one of this file is needed.')
        collection = bpy.data.collections.get(self.collection)
        if collection is None:
            raise invalid(f"There is no collection '{self.collection}' in this file.")
        return assets.of_collection(collection)

    def _say_line(self, line):
        if bpy.app.background:
            print(line, flush=True)


def _absolute(path, said):
    """Errors: StippleError for no path, and for one relative to a file that is not saved."""
    if not path:
        raise invalid(f'No {said} is chosen; one is needed.')
    absolute = source_paths.absolute(path)
    if not os.path.isabs(absolute) or path.startswith('//') and not bpy.data.filepath:
        raise invalid(f"The {said} '{path}' is relative to this file, which is not saved yet; give it in full.")
    return absolute


classes = (STIPPLE_OT_collect_for_training,)
