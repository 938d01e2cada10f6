# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh takes the shape of another object and keeps its faces."""

import time

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ... import binding
from ...binding import structs
from ...binding.errors import invalid
from ...jobs import JobOperator
from ...scene import adapting
from ...scene.source import splat_data

_PREVIEW_SECONDS = 0.5
RESULTS = (('SHAPE_KEY', "Shape Key", "The new shape is a shape key of the mesh, at a value of 1. The other shape keys "
            "go to 0"), ('APPLY', "Apply", "The vertices of the mesh move; its old shape is not kept"))
DENSITIES = (('ADAPTIVE', "Adaptive", "Vertices are drawn to where the shape is complex"),
              ('UNIFORM', "Uniform", "All edges become about as long as each other"),
              ('OFF', "Off", "Vertices go wherever the target pulls them"))
_ALIGNMENTS = (('NONE', "None", "The mesh lies over the target already"),
               ('SIZE', "Location and Size", "The mesh gets the target's middle and size first"),
               ('RIGID', "Location and Rotation", "The mesh is moved and turned to fit the target first, or its "
                "landmarks where there are three or more"),
               ('SIMILARITY', "Location, Rotation and Size", "The mesh is moved, turned and scaled to fit the target "
                "first, or its landmarks where there are three or more"))


class AdaptOperator(JobOperator):
    """Mix-in of what moves the vertices of the active mesh: a preview on the way, and Esc that keeps it."""

    escape_text = 'Esc keeps the shape so far'
    from_mix = False  # whether shape keys count as they are mixed
    _shown_at = 0.0

    result: EnumProperty(name="Result", description="Where the new shape goes", items=RESULTS)
    preview: BoolProperty(name="Preview", description="Show the mesh on its way", default=True)

    @classmethod
    def poll(cls, context):
        problem = problem_of(context) or cls.further_problem(context)
        if problem:
            cls.poll_message_set(problem)
        return not problem

    @classmethod
    def further_problem(cls, _context):
        """Why the operator cannot run on the active object, which is a mesh that could be adapted, or ''."""
        return ''

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def modal(self, context, event):
        if event.type == 'ESC':
            self._job.finish()
            return {'RUNNING_MODAL'}
        result = super().modal(context, event)
        if self._job is not None and event.type == 'TIMER' and self.preview:
            self._show()
        return result

    def cancel(self, context):
        super().cancel(context)
        self._shown.take_back()

    def finish(self, context, job):
        self._shown.write(self._template.local(binding.mesh.Mesh.of_job(job)))
        self._tell(context, binding.mesh_adapt.adapt_report(job))

    def _begin(self, obj, key_name):
        self._template = adapting.template_of(obj, self.result, self.from_mix)
        self._shown = adapting.Shown(self._template, self.result, key_name)

    def _show(self):
        """Brings the mesh up to date, now and then."""
        if time.monotonic() - self._shown_at < _PREVIEW_SECONDS or self._shown.problem():
            return
        self._shown_at = time.monotonic()
        mesh = self._job.preview()
        if mesh is not None:
            self._shown.write(self._template.local(mesh))

    def _failed(self, error):
        if getattr(self, '_shown', None) is not None:
            self._shown.take_back()
        return super()._failed(error)

    def _draw(self, names):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        for name in names:
            if name == 'landmarks':
                layout.prop_search(self, name, bpy.data, 'collections')
            elif name != 'strength' or getattr(self, 'density', '') != 'OFF':
                layout.prop(self, name)


class TargetedOperator(AdaptOperator):
    """Mix-in of what takes the shape of something else."""

    strength: FloatProperty(name="Strength", description="How strongly edges are shortened and evened out against what "
                            "pulls the vertices to the surface", default=1.5, min=0.0, soft_max=10.0)
    smoothness: FloatProperty(name="Smoothness", description="Larger values move broad parts of the mesh as one, and "
                              "let detail come later", default=10.0, min=0.0, soft_max=100.0)
    steps: IntProperty(name="Steps", description="More steps come closer, and take longer", default=800, min=1,
                       soft_min=50, soft_max=5000, max=1000000)
    points: IntProperty(name="Points", description="Points that the surface of the target is measured at. More of them "
                        "show finer detail, and take longer", default=20000, min=1, soft_min=1000, soft_max=200000,
                        max=1 << 24)
    seed: IntProperty(name="Seed", description="Another seed measures the surface at other points", default=0, min=0)

    def _start(self, target, landmarks=(), **settings):
        return binding.mesh_adapt.start_adapt(self._template.native(), target, landmarks, strength=self.strength,
                                              smoothness=self.smoothness, steps=self.steps,
                                              target_count=self.points, seed=self.seed, **settings)


class STIPPLE_OT_mesh_adapt(TargetedOperator, bpy.types.Operator):
    """Give the active mesh the shape of the other selected object by moving its vertices: a mesh, a point cloud or
    splats. Faces, UV maps, weights and materials stay. Esc keeps the shape so far"""

    bl_idname = 'stipple.mesh_adapt'
    bl_label = "Adapt Mesh to Target"
    bl_options = {'REGISTER', 'UNDO', 'PRESET'}

    density: EnumProperty(name="Density", description="Where vertices go along the surface", items=DENSITIES)
    alignment: EnumProperty(name="Alignment", description="What is done to the whole mesh first", items=_ALIGNMENTS)
    landmarks: StringProperty(name="Landmarks", description="Collection of empties. Each one says where the vertex "
                              "belongs that weighs most in the vertex group of its name")
    symmetric: FloatProperty(name="Symmetric", description="How much the mesh is drawn to the target wherever it is, "
                             "and not only the target to the mesh. Above 0, no part of it stays away from the target",
                             default=0.0, min=0.0, soft_max=1.0)

    @classmethod
    def further_problem(cls, context):
        return _problem_of_targets(context)

    def start(self, context):
        obj = context.view_layer.objects.active
        target = other_objects(context)[0]
        require_own_mesh(obj, target)
        self._target_name = target.name
        self._begin(obj, f'Adapted to {target.name}')
        return self._start(adapting.target_of(target, context.evaluated_depsgraph_get()),
                           adapting.landmarks_of(obj, self.landmarks), density=structs.MeshDensity[self.density],
                           alignment=structs.MeshAlignment[self.alignment], symmetric_weight=self.symmetric)

    def draw(self, _context):
        self._draw(('result', 'density', 'strength', 'smoothness', 'steps', 'points', 'alignment', 'landmarks',
                    'symmetric', 'preview', 'seed'))

    def _tell(self, context, report):
        if report.turned_normals:
            self.report({'WARNING'}, f"The normals of '{self._target_name}' point inwards where those of "
                        f"'{self._template.name}' point outwards, or the other way round; they were taken turned")
        before, after = (length_text(context, value) for value in (report.distance_before, report.distance_after))
        self.report({'INFO'}, f"'{self._template.name}' was {before} away from '{self._target_name}' on average, and "
                    f'is {after} away now')


def problem_of(context):
    """Why the active object cannot take another shape now, or ''."""
    active = context.view_layer.objects.active
    if active is None or active.type != 'MESH' or splat_data.is_splat_object(active):
        return 'The active object is no mesh'
    if context.mode != 'OBJECT':
        return 'Go to Object Mode first'
    return ''


def other_objects(context):
    """What is selected beside the active object."""
    active = context.view_layer.objects.active
    return [obj for obj in context.view_layer.objects.selected if obj != active]


def require_own_mesh(obj, target):
    """Errors: StippleError where an object changes with the mesh that takes its shape."""
    if target.data is not None and target.data == obj.data:
        raise invalid(f"'{target.name}' and '{obj.name}' share one mesh, so that the target would change too; make "
                      'it a single user first.')


def _problem_of_targets(context):
    count = len(other_objects(context))
    if count == 0:
        return 'Select the target first, then the mesh that takes its shape'
    return '' if count == 1 else f'{count} targets are selected; one is allowed'


def length_text(context, value):
    """A length of the scene, as Blender writes it."""
    unit = context.scene.unit_settings
    if unit.system == 'NONE':
        return f'{value:.4g}'
    return bpy.utils.units.to_string(unit.system, 'LENGTH', value * unit.scale_length, precision=4)


classes = (STIPPLE_OT_mesh_adapt,)
