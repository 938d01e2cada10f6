# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats of an object get the detail that views show, by a trained network."""

import os

import bpy
from bpy.props import IntProperty, StringProperty

from ... import preferences
from ...binding.errors import invalid
from ...jobs import JobOperator, ViewsFirst
from ...scene.fit import densifying, fitting
from ...scene.source import decoded, edits, splat_data

# What a training of detail calls its weights.
_FILE = 'detail.safetensors'


def _weights_path(chosen):
    """The file that was chosen, the one in the folder of the Preferences, or the one that came with the add-on. Errors:
    StippleError."""
    if chosen:
        return bpy.path.abspath(chosen)
    folder = preferences.chosen_weights_folder()
    for one in filter(None, (folder, preferences.shipped_weights_folder())):
        path = os.path.join(one, _FILE)
        if os.path.exists(path):
            return path
    if not folder:
        raise invalid(f'No folder of weights is chosen: choose the one with {_FILE} in the Preferences of Stipple.')
    raise invalid(f"{_FILE} is not in '{folder}'; 'stipple train' with \"detail\" writes it.")


class STIPPLE_OT_add_detail(ViewsFirst, JobOperator, bpy.types.Operator):
    """Give the active object's splats the detail that a few renders of the selected objects, or photographs of a data
    set, show: a trained network turns coarse splats into finer ones in one pass"""

    bl_idname = 'stipple.add_detail'
    bl_label = "Add Detail"
    bl_options = {'REGISTER', 'UNDO'}

    max_splats: IntProperty(name="Splats", description="Maximum number of splats; 0 makes every splat finer", default=0,
                            min=0, max=100000000)
    view_count: IntProperty(name="Views", description="Images that the network looks at, spread evenly; 0 is as "
                            "many as it was trained with", default=0, min=0, max=64)
    weights: StringProperty(name="Weights", description=f"File of the network; empty for {_FILE} in the folder of the "
                            "Preferences, or the one that comes with the add-on", subtype='FILE_PATH')

    @classmethod
    def poll(cls, context):
        return (context.mode == 'OBJECT' and splat_data.is_splat_object(context.object)
                and context.object.data.library is None and not fitting.state.is_running)

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, context):
        self._object = context.object
        edits.refuse_sequence(self._object)
        edits.refuse_moving(self._object)
        settings = context.scene.stipple.fit
        path = _weights_path(self.weights)
        objects = [] if settings.views_from == 'DATASET' else fitting.seen_objects(context)
        cloud = decoded.full_cloud(self._object.data)
        self._count = cloud.info().count
        chosen = {'max_splats': self.max_splats, 'view_count': self.view_count}
        return densifying.DetailTask(context, objects, settings, self._object, cloud, path, chosen)

    def finish(self, _context, job):
        model, cloud = job.result
        count = densifying.replace(self._object, model, cloud)
        self.report({'INFO'}, f"{count:,} splats in '{self._object.name}', {self._count:,} before")


classes = (STIPPLE_OT_add_detail,)
