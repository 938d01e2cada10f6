# SPDX-License-Identifier: GPL-3.0-or-later
"""The cameras of a photo data set become cameras of the scene."""

import os

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from ..binding.errors import StippleError
from ..scene.sequence import frames
from ..scene.source import sources
from ..scene.view import photo_cameras


class STIPPLE_OT_cameras_import(bpy.types.Operator, ImportHelper):
    """Import the cameras of photos: COLMAP, nerfstudio's transforms.json or NeRF-synthetic"""

    bl_idname = 'stipple.cameras_import'
    bl_label = "Import Cameras"
    bl_options = {'REGISTER', 'UNDO', 'PRESET'}

    filename_ext = '.json'
    filter_glob: StringProperty(default='*.json;cameras.bin;cameras.txt;images.bin;images.txt', options={'HIDDEN'})
    backgrounds: BoolProperty(name="Background Images", default=True, description="Show each camera's photo behind its "
                              "view. Photos of a lens that distorts are shown as they are: they fit the view in the "
                              "middle and drift off towards the edges, while fitting takes the distortion out")
    up_axis: EnumProperty(name="Up Axis", description="The up direction of the data set; choose the same for splats "
                                                      "that were fitted to it", items=photo_cameras.UP_AXES)
    set_resolution: BoolProperty(name="Set Resolution",
                                 description="Give the scene the first photo's resolution, so that "
                                             "the camera's view has its frame", default=True)

    def execute(self, context):
        path = bpy.path.abspath(self.filepath)
        try:
            views, problem = photo_cameras.open_views(sources.context(), path)
        except StippleError as error:
            self.report({'ERROR'}, str(error))
            return {'CANCELLED'}
        frame = photo_cameras.chosen_frame(path, self.up_axis)
        name = os.path.basename(os.path.normpath(path if os.path.isdir(path) else os.path.dirname(path)))
        collection = bpy.data.collections.new(f'{name} Cameras')
        context.scene.collection.children.link(collection)
        objects = photo_cameras.add(views, collection, frames.to_world(frame), self.backgrounds)
        first = views.camera(0)
        if self.set_resolution and first.width:
            render = context.scene.render
            render.resolution_x, render.resolution_y, render.resolution_percentage = first.width, first.height, 100
            render.pixel_aspect_x = render.pixel_aspect_y = 1.0
        if context.scene.camera is None:
            context.scene.camera = objects[0]
        self._report(views, problem, collection)
        return {'FINISHED'}

    def _report(self, views, problem, collection):
        count = len(views)
        if problem is not None:
            self.report({'WARNING'}, f'Cameras without photos: {problem}')
        distorted = sum(views.view_info(i).is_distorted for i in range(count))
        if distorted and self.backgrounds:
            self.report({'WARNING'}, f'{distorted} of {count} photos are distorted by their lens; they fit the view in '
                        'the middle only')
        uneven = sum(not photo_cameras.are_square(views.camera(i)) for i in range(count))
        if uneven:
            self.report({'WARNING'}, f'{uneven} of {count} cameras have pixels that are not square; their height is '
                        'shown as if they were')
        self.report({'INFO'}, f"{count} cameras in '{collection.name}'")


classes = (STIPPLE_OT_cameras_import,)
