# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh takes the shape of objects as Cycles renders them and keeps its faces."""

import bpy
from bpy.props import IntProperty

from ...cycles_functions import CyclesRender
from ...jobs import ViewsFirst
from ...scene import adapting
from ...scene.fit import adapting_to_views, view_task
from .adapting_to_views import AdaptToViewsOperator
from .mesh_adapt import other_objects, require_own_mesh

_WIDTH_PX = 350


class STIPPLE_OT_mesh_adapt_to_renders(ViewsFirst, AdaptToViewsOperator, bpy.types.Operator):
    """Give the active mesh the shape of the other selected objects by moving its vertices. Cycles renders these from all
    around, whatever they are made of. Faces, UV maps, weights and materials stay. Esc keeps the shape so far"""

    bl_idname = 'stipple.mesh_adapt_to_renders'
    bl_label = "Adapt Mesh to Renders"
    bl_options = {'REGISTER', 'UNDO', 'PRESET'}

    view_count: IntProperty(name="Views", description="Number of images that are rendered, from cameras all around the "
                            "objects. More of them see more of what is hidden, and take longer", default=24, min=2,
                            soft_max=200, max=4096)
    samples: IntProperty(name="Samples", description="Samples per pixel of an image", default=16, min=1, soft_max=1024)
    seed: IntProperty(name="Seed", description="Another seed turns the cameras to other places", default=0, min=0)

    @classmethod
    def further_problem(cls, context):
        if CyclesRender is None:
            return 'This Blender was built without Cycles, which renders the images'
        others = other_objects(context)
        if not others:
            return 'Select the objects to render first, then the mesh that takes their shape'
        if not any(map(adapting.can_render, others)):
            return 'Nothing that is selected beside the mesh can be rendered by Cycles'
        return ''

    def invoke(self, context, _event):
        self._asked = True
        return context.window_manager.invoke_props_dialog(self, width=_WIDTH_PX)

    def start(self, context):
        obj = context.view_layer.objects.active
        sources = [other for other in other_objects(context) if adapting.can_render(other)]
        for source in sources:
            require_own_mesh(obj, source)
        is_one = len(sources) == 1
        self._images_name = (f'{self.view_count} renders of '
                             + (f"'{sources[0].name}'" if is_one else f'{len(sources)} objects'))
        adapting.require_shown_instances(sources, context.view_layer)
        self._begin(obj, f'Adapted to {sources[0].name if is_one else "Renders"}')
        if self.alignment == 'NONE':
            adapting.require_nearness(self._template, sources, context.evaluated_depsgraph_get())
        rig = view_task.RigSettings(self.view_count, self.image_size, self.samples, self.seed)
        return adapting_to_views.AdaptToViewsTask(context, sources, rig, self._start_by_views)

    def finish(self, context, job):
        super().finish(context, job.result)
        if job.cut_count:
            self.report({'WARNING'}, f'Something reaches over the edge of {job.cut_count} of {self.view_count} renders and '
                        'is cut there; it lies outside of the boxes of its objects, as hair and displacement may')

    def draw(self, _context):
        self._draw(('result', 'view_count', 'image_size', 'samples', 'density', 'strength', 'smoothness', 'steps',
                    'drawing', 'alignment', 'preview', 'seed'))

    def _tell(self, _context, report):
        self._say_difference(self._images_name, report)


classes = (STIPPLE_OT_mesh_adapt_to_renders,)
