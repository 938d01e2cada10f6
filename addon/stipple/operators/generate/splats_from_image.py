# SPDX-License-Identifier: GPL-3.0-or-later
"""The object in an image becomes splats."""

import os

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ImportHelper

from ... import binding
from ...scene.generate import image_task
from ...scene.source import sources
from .generating import GenerateAtCursor


class STIPPLE_OT_splats_from_image(GenerateAtCursor, bpy.types.Operator, ImportHelper):
    """Make splats of the object in an image, by networks whose weights you download yourself"""

    bl_idname = 'stipple.splats_from_image'
    bl_label = "Splats from Image"
    bl_options = {'REGISTER', 'UNDO', 'PRESET'}

    filename_ext = '.png'
    filter_glob: StringProperty(default='*.png;*.jpg;*.jpeg;*.webp;*.tif;*.tiff;*.exr',
                                options={'HIDDEN', 'SKIP_SAVE'})
    mask: StringProperty(name="Mask", description="Path of an image that is white, or opaque, on the object, for images "
                         "without transparency", options={'SKIP_SAVE'})
    def invoke(self, context, event):
        self._asked = True
        return ImportHelper.invoke(self, context, event)

    def start(self, context):
        settings = self._settings(self.size)
        native = sources.context()
        path = bpy.path.abspath(self.filepath)
        mask_path = bpy.path.abspath(self.mask) if self.mask else ''
        image = binding.image.Image.load(native, path)
        mask = binding.image.Image.load(native, mask_path) if mask_path else None
        identity = b''.join(_identity(one) for one in (path, mask_path) if one)
        self._location = tuple(context.scene.cursor.location)
        return image_task.ImageTask(image, mask, identity, settings, self.seed_count, self.anchors, self.keep_best)

    def draw(self, context):
        self.layout.use_property_split = True
        self.layout.prop(self, 'mask')
        self.layout.prop(self, 'size')
        self._draw_settings(self.layout, context)

    def _name(self):
        return os.path.splitext(os.path.basename(self.filepath))[0] + ' Splats'


def _identity(path):
    status = os.stat(path)
    return f'{os.path.abspath(path)}:{status.st_size}:{status.st_mtime_ns};'.encode('utf-8', 'surrogateescape')


classes = (STIPPLE_OT_splats_from_image,)
