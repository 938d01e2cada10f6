# SPDX-License-Identifier: GPL-3.0-or-later
"""Splat files become splat objects, bit for bit."""

import os
from dataclasses import dataclass

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, StringProperty
from bpy_extras.io_utils import ImportHelper
from mathutils import Matrix

from .. import binding, preferences, version
from ..binding.errors import StippleError
from ..jobs import JobOperator, Task
from ..scene.sequence import frames, numbered, sequences, series_folder
from ..scene.source import formats, source_paths, source_settings, sources, splat_data, sync


@dataclass
class _Loaded:
    """What was read of a chosen file. split: what became of one that holds a series."""

    given: str
    path: str
    frame_count: int
    splats: object
    model: object = None  # of an asset file
    split: object = None  # a series_folder.Split
    times: int = 0        # at which a file that was not split has splats


class STIPPLE_OT_splats_import(JobOperator, bpy.types.Operator, ImportHelper):
    """Import Gaussian splats from files, or fitted ones with their budgets from asset files"""

    bl_idname = 'stipple.splats_import'
    bl_label = "Import Splats"
    bl_options = {'REGISTER', 'UNDO', 'PRESET'}

    filename_ext = formats.USUAL_EXTENSION
    filter_glob: StringProperty(options={'HIDDEN', 'SKIP_SAVE'})
    files: CollectionProperty(type=bpy.types.OperatorFileListElement, options={'HIDDEN', 'SKIP_SAVE'})
    directory: StringProperty(subtype='DIR_PATH', options={'HIDDEN', 'SKIP_SAVE'})
    up_axis: EnumProperty(name="Up Axis", description="The up direction of the files; the objects are rotated, and "
                                                      "their data stay as they are", items=preferences.UP_AXES)

    as_sequence: BoolProperty(name="As Sequence", default=False,
                              description="Numbered files become one object that shows one of them in each frame. A "
                                          "single chosen file stands for all of its series. Of a file of USD that "
                                          "holds a series, the frames become files beside the .blend")

    _asked = False

    def invoke(self, context, event):
        if self.directory and self.files:  # dropped into a window
            return self.run_in_window(context)
        self._asked = True
        self.filter_glob = formats.glob((*formats.read_extensions(), sources.MODEL_SUFFIX))
        return ImportHelper.invoke(self, context, event)

    def execute(self, context):
        if self._asked and not bpy.app.background:
            self._remember()
            return self.run_in_window(context)
        return JobOperator.execute(self, context)

    def start(self, _context):
        native, paths = sources.context(), self._paths()
        chosen = numbered.series_of(paths) if self.as_sequence else [(path, 1) for path in paths]
        places = {path: source_paths.place_for(_name(path))[:-len(sources.MODEL_SUFFIX)] for path, _ in chosen}

        def work(task):
            loaded, failed = [], []
            for i, (path, frame_count) in enumerate(chosen):
                def advance(part, stage, i=i):
                    task.advance((i + part) / len(chosen), stage)
                advance(0, f'Reading {os.path.basename(path)}')
                try:
                    loaded.append(_read(native, path, frame_count, places[path] if self.as_sequence else '', advance))
                except StippleError as error:
                    failed.append(error)
            if not loaded:
                raise failed[0]
            return loaded, failed
        return Task(work)

    def finish(self, context, job):
        loaded, failed = job.result
        for other in list(context.view_layer.objects.selected):
            other.select_set(False)
        for one in loaded:
            obj = self._object(context, one)
            context.collection.objects.link(obj)
            obj.select_set(True)
            context.view_layer.objects.active = obj
            if one.frame_count > 1:
                try:
                    sync.write_shown(obj.data)
                except StippleError as error:
                    failed.append(error)
            if one.times > 1:
                self.report({'WARNING'}, f"'{os.path.basename(one.path)}' holds splats at {one.times:,} times, of "
                                         "which the first is shown; As Sequence imports all")
        for error in failed:
            self.report({'WARNING'}, str(error))
        total = sum(splat_data.count(o.data) for o in context.view_layer.objects.selected)
        where = f"'{obj.name}'" if len(loaded) == 1 else f'{len(loaded)} objects'
        in_all = sum(one.frame_count for one in loaded)
        files = '' if in_all == len(loaded) else f' of {in_all} files'
        self.report({'INFO'}, f'{total:,} splats in {where}{files}')

    def _object(self, context, loaded):
        form, path, splats, model = formats.of_path(loaded.given), loaded.path, loaded.splats, loaded.model
        name = _name(loaded.given)
        if loaded.frame_count > 1 and loaded.split is None:
            name = os.path.basename(numbered.parse(path).prefix).rstrip('_-. ') or name
        data = splat_data.new_data(name)
        with sync.paused():
            if loaded.frame_count > 1:
                sequences.attach(data, path, loaded.frame_count, of_models=model is not None)
            elif model is not None:
                sources.remember_model(path, model)
                sources.attach_asset(data, path, model.settings())
            else:
                sources.attach_cloud(data, path)
            if loaded.split is not None:
                render = context.scene.render
                timing = loaded.split.timing(render.fps / render.fps_base)
                data.stipple.frame_start, data.stipple.frame_speed = timing
        if model is None:
            sync.write(data, splats, '')
        else:
            sync.write_decoded(data, splats)
        obj = splat_data.new_object(data.name, data)
        axis = self.up_axis if self.up_axis != 'AUTO' or form is None else preferences.up_axis(form.name)
        # What was made of meshes or views stands upright; splats of a file stand as it says.
        own = frames.WORLD if source_settings.of(data.stipple).counts_anchors else splats.frame
        frame = own if axis == 'AUTO' else frames.UP_AXES[axis]
        obj.matrix_world = Matrix(frames.to_world(frame).tolist())
        return obj

    def _paths(self):
        if self.directory and self.files:
            return [os.path.join(bpy.path.abspath(self.directory), entry.name) for entry in self.files]
        return [bpy.path.abspath(self.filepath)]

    def _remember(self):
        """What the dialog was left with is the next default of its files' formats."""
        for form in {formats.of_path(path) for path in self._paths()} - {None}:
            if self.up_axis != 'AUTO':
                preferences.remember_up_axis(form.name, self.up_axis)


def _name(path):
    """A file's name without the extension of its format."""
    name = os.path.basename(path)
    form = formats.of_path(path)
    extensions = form.extensions if form else (sources.MODEL_SUFFIX, os.path.splitext(name)[1])
    extension = next((e for e in extensions if name.lower().endswith(e)), '')
    return name[:len(name) - len(extension)]


def _read(native, path, frame_count, place, advance):
    """A _Loaded. place: where the files of a series go that lies in one file, '' for its first frame alone."""
    if path.lower().endswith(sources.MODEL_SUFFIX):
        model = binding.model.Model.load(native, path)
        decoded = model.decode(sources.first_settings(model.settings()))
        return _Loaded(path, path, frame_count, decoded.columns(), model)
    form = formats.of_path(path)
    if form is None or not form.holds_times:
        return _Loaded(path, path, frame_count, binding.cloud.Cloud.load(native, path).columns())
    reader = binding.series_file.SeriesReader.open(native, path)
    if place and reader.count > 1:
        split = series_folder.split(reader, place, advance)
        first = binding.cloud.Cloud.load(native, split.path)
        return _Loaded(path, split.path, split.count, first.columns(), split=split)
    return _Loaded(path, path, frame_count, reader.read(0)[0].columns(), times=reader.count)


classes = (STIPPLE_OT_splats_import,)
if version.HAS_FILE_HANDLERS:
    class STIPPLE_FH_splats(bpy.types.FileHandler):
        bl_idname = 'STIPPLE_FH_splats'
        bl_label = "Gaussian Splats"
        bl_import_operator = 'stipple.splats_import'
        bl_export_operator = 'stipple.splats_export'
        bl_file_extensions = ';'.join((*formats.DROPPED_EXTENSIONS, '.safetensors'))

        @classmethod
        def poll_drop(cls, context):
            return context.area is not None and context.area.type in {'VIEW_3D', 'OUTLINER'}

    classes += (STIPPLE_FH_splats,)
