# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure what accuracy costs in the present view, and choose a setting from it."""

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty, StringProperty

from .. import binding
from ..binding.errors import StippleError
from ..jobs import JobOperator
from ..scene.fit import fit_reports
from ..scene.source import sources
from ..scene.view import measured_quality, quality, rendered_view


class STIPPLE_OT_accuracy_measure(JobOperator, bpy.types.Operator):
    """Draw what the scene's camera sees with all settings alternately, on this machine, and compare the images with
    the reference"""

    bl_idname = 'stipple.accuracy_measure'
    bl_label = "Measure Camera View"
    bl_options = {'REGISTER'}

    repetitions: IntProperty(name="Repetitions", description="Number of timings of each setting", default=7, min=1,
                             max=1000)
    most_seconds: FloatProperty(name="Time", description="Seconds after which no further round of timings begins",
                                default=60.0, min=0.1, subtype='TIME_ABSOLUTE', unit='TIME_ABSOLUTE')
    filepath: StringProperty(name="Report", description="File for the report (.json, .csv or .svg); empty for none",
                             subtype='FILE_PATH')

    @classmethod
    def poll(cls, context):
        if context.scene.camera is None:
            cls.poll_message_set('The scene has no camera')
            return False
        return True

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, context):
        self._scene = context.scene
        view = rendered_view.gather(context)
        render = binding.renderer.Renderer(sources.context()).options(blend_space=view.picture.blend_space,
                                                                      background=view.picture.background)
        return binding.accuracy.AccuracyMeasurement.start(sources.context(), view.placed, view.camera, render,
                                                          repetitions=self.repetitions, max_seconds=self.most_seconds)

    def finish(self, context, job):
        report = job.report()
        if self.filepath:
            report.save(bpy.path.abspath(self.filepath))
        measured_quality.keep(self._scene, report)
        image = measured_quality.plot(self._scene)
        if not bpy.app.background:
            fit_reports.show_if_wanted(context, image)
            for area in context.screen.areas:
                area.tag_redraw()
        front = sum(row.is_on_front for row in report.rows)
        self.report({'INFO'}, f'{len(report.rows)} settings measured; {front} of them are the best for their time')


class STIPPLE_OT_accuracy_choose(bpy.types.Operator):
    bl_idname = 'stipple.accuracy_choose'
    bl_label = "Choose Quality"
    bl_description = "Choose a setting from what was measured, and store it for the viewport or for renders"
    bl_options = {'REGISTER', 'UNDO'}

    column: EnumProperty(name="For", description="What the chosen setting is stored for", items=quality.COLUMNS,
                         default='RENDER')
    by: EnumProperty(name="Choose", description="What limits the choice",
                     items=(('TIME', "Best Within", "Choose the best setting that takes no more than this many "
                                                    "milliseconds"),
                            ('QUALITY', "Cheapest Above", "Choose the fastest setting that reaches this many dB")))
    milliseconds: FloatProperty(name="Milliseconds", description="Time that one image may take", default=100.0, min=0.0,
                                soft_max=10000.0)
    decibels: FloatProperty(name="PSNR", description="Quality in dB: from 45 on the image looks identical, from 38 on"
                                                     " the difference is hard to see",
                            default=38.0, min=0.0, soft_max=100.0)

    @classmethod
    def poll(cls, context):
        if measured_quality.of(context.scene) is None:
            cls.poll_message_set('Nothing has been measured yet')
            return False
        return True

    def invoke(self, context, _event):
        return context.window_manager.invoke_props_dialog(self)

    def execute(self, context):
        report = measured_quality.of(context.scene).report
        try:
            if self.by == 'TIME':
                row = report.best_within(self.milliseconds / 1000)
            else:
                row = report.cheapest_above(self.decibels)
        except StippleError as error:
            self.report({'ERROR'}, str(error))
            return {'CANCELLED'}
        quality.store(quality.column(context.scene, self.column), row.setting)
        self.report({'INFO'}, f'{row.name}: {1000 * row.seconds:.3g} ms, {measured_quality.decibels(row.psnr)}')
        return {'FINISHED'}


class STIPPLE_OT_accuracy_show(bpy.types.Operator):
    """Show the plot of what was measured, error against time, in an Image Editor"""

    bl_idname = 'stipple.accuracy_show'
    bl_label = "Show Plot"

    @classmethod
    def poll(cls, context):
        if bpy.app.background:
            cls.poll_message_set('There is no window to show it in')
            return False
        if measured_quality.plot_of(context.scene) is None:
            cls.poll_message_set('Nothing has been measured yet')
            return False
        return True

    def execute(self, context):
        fit_reports.show(context, measured_quality.plot_of(context.scene))
        return {'FINISHED'}


classes = (STIPPLE_OT_accuracy_measure, STIPPLE_OT_accuracy_choose, STIPPLE_OT_accuracy_show)
