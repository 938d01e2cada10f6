# SPDX-License-Identifier: GPL-3.0-or-later
"""What the operators have in common that make splats of images: settings, previews, objects."""

import time

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from ...binding.errors import CancelledError, StippleError
from ...jobs import JobOperator
from ...panels.fit import duration, size
from ...panels.text import draw_text
from ...scene.generate import image_task, placing, weights_table
from ...scene.source import source_paths, sources, splat_data, sync

_PREVIEW_SECONDS = 1.0
CANVASES = (('1024', "1024", "What the networks were trained with last"),
            ('512', "512", "Fewer tokens of the image: faster. The networks saw this size in early stages of their "
                           "training alone"))


class GenerateOperator(JobOperator):
    """Mix-in. The operator gives start(context) → ImageTask, and places objects by _matrix(index)."""

    shown_settings = ('steps', 'guidance', 'tokens', 'canvas', 'seed', 'seed_count', 'keep_best', 'match_colours',
                      'anchors', 'show_previews')
    has_image = True
    escape_text = 'Esc stops; the same settings go on from there'

    steps: IntProperty(name="Steps", description="Steps from noise to the object. Time grows with them", default=20,
                       min=1, max=1000, soft_min=10, soft_max=50)
    guidance: FloatProperty(name="Guidance", description="How much more than plainly the image is followed. Up to 1 "
                            "takes half the time", default=3.0, min=0.0, max=100.0, soft_min=1.0, soft_max=10.0)
    tokens: IntProperty(name="Tokens", description="Size of the latent. The published network was trained with 1,024 to "
                        "8,192; fewer are faster", default=8192, min=1, max=65536, soft_min=1024, soft_max=8192)
    canvas: EnumProperty(name="Image Size", description="Pixels of the image that the networks see", items=CANVASES)
    seed: IntProperty(name="Seed", description="Another seed gives another object that fits the image", default=42,
                      min=0)
    seed_count: IntProperty(name="Seeds", description="How many seeds, from Seed on, are made and put side by side",
                            default=1, min=1, max=64, soft_max=8)
    keep_best: BoolProperty(name="Keep the Best", description="Of the seeds, keep only the object that looks most like "
                            "the image", default=False)
    match_colours: BoolProperty(name="Match Colors", description="Lead the colors of the object closer to those of the "
                                "image. Networks that were learned from a collection can do this, such as those that "
                                "come with Stipple", default=False)
    anchors: IntProperty(name="Anchors", description="Budget of the splats at first, in anchors that each become several "
                         "splats; 0 for what the decoder was trained with. It can be changed afterwards", default=0,
                         min=0, soft_max=8192)
    show_previews: BoolProperty(name="Previews", description="Show the object now and then while it is made. Each costs "
                                "a few seconds", default=True)

    _shown_at = 0.0
    _names = ()  # of objects that previews are shown in, by index

    def _settings(self, wanted_size):
        return image_task.GenerateSettings(self.steps, self.guidance, self.tokens, int(self.canvas), self.seed,
                                           wanted_size, self.show_previews, self.match_colours)

    def modal(self, context, event):
        result = super().modal(context, event)
        if self._job is not None and event.type == 'TIMER':
            self._show(context)
        return result

    def cancel(self, context):
        super().cancel(context)
        self._remove_previews()

    def finish(self, context, job):
        for other in list(context.view_layer.objects.selected):
            other.select_set(False)
        for index, made in enumerate(job.result):
            obj = self._object(context, index)
            self._attach(obj, made)
            obj.select_set(True)
            context.view_layer.objects.active = obj
        self._names = ()
        count = sum(made.splats.count for made in job.result)
        best = f' (seed {job.result[0].seed}, the best of {self.seed_count})' if self.keep_best and self.seed_count > 1 else ''
        self.report({'INFO'}, f"{count:,} splats in {len(job.result)} object{'s' if len(job.result) > 1 else ''}{best}")

    def _attach(self, obj, made):
        path = sources.save_model(made.model, source_paths.place_for(obj.name))
        sources.remember_model(path, made.model)
        stipple = obj.data.stipple
        with sync.paused():
            sources.attach_model(obj.data, path, [], made.model.settings())
            stipple.anchors = made.decoding.anchors
            stipple.gaussians_per_anchor = made.model.settings().default_gaussians_per_anchor
        sync.write_decoded(obj.data, made.splats)

    def _object(self, context, index):
        """The object of a seed, with its preview where it has one."""
        obj = context.scene.objects.get(self._names[index]) if index < len(self._names) else None
        if obj is None:
            name = self._name()
            obj = splat_data.new_object(name, splat_data.new_data(name))
            context.collection.objects.link(obj)
        obj.matrix_world = self._matrix(index)
        return obj

    def _show(self, context):
        if time.monotonic() - self._shown_at < _PREVIEW_SECONDS:
            return
        self._shown_at = time.monotonic()
        found = self._job.preview()
        if found is None:
            return
        index, splats = found
        while len(self._names) <= index:
            self._names = (*self._names, self._object(context, len(self._names)).name)
        obj = context.scene.objects.get(self._names[index])
        if obj is not None:  # else removed by hand
            sync.write(obj.data, splats, '')

    def _failed(self, error):
        self._remove_previews()
        if isinstance(error, CancelledError):
            self.report({'INFO'}, 'Stopped; the same settings go on from the last step')
            return {'CANCELLED'}
        return super()._failed(error)

    def _remove_previews(self):
        for name in self._names:
            obj = bpy.data.objects.get(name)
            if obj is not None:
                data = obj.data
                (bpy.data.pointclouds if isinstance(data, bpy.types.PointCloud) else bpy.data.meshes).remove(data)
        self._names = ()

    def _draw_settings(self, layout, context, width_px=None):
        """width_px: of a dialog, None in a file browser."""
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column()
        for name in self.shown_settings:
            column.prop(self, name)
        box = layout.box()
        if not weights_table.is_complete():
            draw_text(box, context, 'Weights are missing: Preferences > Add-ons > Stipple says which, and where you '
                                    'get them.', 'ERROR')
            return
        try:
            cost = image_task.estimate_of(self._settings(1.0))
        except StippleError as error:
            draw_text(box, context, str(error), 'ERROR', width_px=width_px)
            return
        seconds = self.has_image * cost.image_seconds + self.seed_count * (cost.seconds - cost.image_seconds)
        draw_text(box, context, f'About {duration(seconds)} and {size(cost.bytes)} of memory here',
                  'TIME', width_px=width_px)
        draw_text(box, context, weights_table.caution(), 'INFO', width_px=width_px)


class GenerateAtCursor(GenerateOperator):
    """Mix-in for objects that stand at the 3D cursor, those of several seeds side by side. The operator sets _asked where
    it asks for its settings first; then it works in the background of a window."""

    size: FloatProperty(name="Size", description="Length of the object's largest side", default=1.0, min=0.001,
                        soft_max=100.0, unit='LENGTH')

    _asked = False

    @classmethod
    def poll(cls, context):
        return context.mode == 'OBJECT'

    def execute(self, context):
        if bpy.app.background or not self._asked:
            return super().execute(context)
        return self.run_in_window(context)

    def _matrix(self, index):
        return placing.beside(self._location, self.size, index, 1 if self.keep_best else self.seed_count)
