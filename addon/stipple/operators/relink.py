# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats whose source file has moved or changed get it again, with their settings and their mask."""

import bpy
from bpy.props import BoolProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from .. import binding
from ..binding.errors import StippleError, invalid
from ..jobs import JobOperator
from ..scene.sequence import numbered
from ..scene.source import (decoded, formats, masks, selections, source_paths, source_settings, sources, splat_data,
                            sync)


class STIPPLE_OT_relink(JobOperator, bpy.types.Operator, ImportHelper):
    """Read the source of the active splats from another place, or again where it has changed. Budget, mask and all
    other settings stay"""

    bl_idname = 'stipple.relink'
    bl_label = "Relink Source"
    bl_options = {'REGISTER', 'UNDO'}

    filename_ext = formats.USUAL_EXTENSION
    filter_glob: StringProperty(options={'HIDDEN', 'SKIP_SAVE'})
    other_count: BoolProperty(name="Accept Another Count",
                              description="Take a file of another number of splats, too; a "
                                          "mask, which says for each splat whether it is hidden, is cleared then",
                              default=False)

    again: BoolProperty(name="Again", description="Read the present source again, without asking for a file",
                        default=False, options={'HIDDEN', 'SKIP_SAVE'})

    _asked = False

    @classmethod
    def poll(cls, context):
        obj = context.object
        return (splat_data.is_splat_object(obj) and context.mode == 'OBJECT' and obj.data.library is None
                and source_settings.of(obj.data.stipple).has_source)

    def invoke(self, context, event):
        data = context.object.data
        self.filepath = source_paths.file_of(data)
        if self.again:
            return self.run_in_window(context)
        self._asked = True
        self.filter_glob = formats.glob((*formats.read_extensions(), sources.MODEL_SUFFIX))
        return ImportHelper.invoke(self, context, event)

    def execute(self, context):
        if self._asked and not bpy.app.background:
            return self.run_in_window(context)
        return JobOperator.execute(self, context)

    def start(self, context):
        data = context.object.data
        self._data = data
        self._path = source_paths.file_of(data) if self.again else source_paths.absolute(self.filepath)
        if data.stipple.is_sequence and numbered.parse(self._path) is None:
            raise invalid(f"'{self._path}' has no number in its name, which the files of a series need.")
        return _noun(data.stipple).load_start(sources.context(), self._path)

    def finish(self, _context, job):
        data, stipple = self._data, self._data.stipple
        known, made = source_settings.of(stipple), _noun(stipple).of_job(job)
        found = source_settings.of_model(made.settings()) if known.has_budget else known
        if found.counts_splats != known.counts_splats:
            holds = 'splats with a budget' if found.counts_splats else 'splats of a mesh or a field'
            raise invalid(f"'{self._path}' holds {holds}, "
                          f"but '{data.name}' was made the other way; import it as an object of its own.")
        info = made.info()
        count = info.leaf_count if known.has_budget else info.count
        clears_mask = False
        edited = stipple.edited or sync.is_edited(data)
        if not known.counts_anchors and not stipple.is_sequence and not edited:
            before = _count_before(data)
            if count != before and not self.other_count:
                raise invalid(f"'{self._path}' has {count:,} splats; the source of '{data.name}' had {before:,}. "
                              f"Choose "
                              'another file, or Accept Another Count.')
            clears_mask = count != before
        names = ('source', 'source_stamp', 'source_count', *source_settings.PROPERTIES)
        kept = {name: getattr(stipple, name) for name in names}
        try:
            with sync.paused():
                if known.counts_anchors or known.has_time or found.has_time:
                    source_settings.note_model(stipple, found)
                stipple.source = source_paths.stored(self._path)
                stipple.source_stamp = sources.stamp(self._path)
                if known.counts_splats and clears_mask:
                    stipple.source_count = count
            if not edited:  # what was changed by hand is never written over
                self._write(data, made, clears_mask)
        except StippleError:
            with sync.paused():
                for name, value in kept.items():
                    setattr(stipple, name, value)
            raise
        if stipple.source_stamp != kept['source_stamp'] and selections.takes_mask(data):
            selections.clear(data)  # bits of other splats
        sync.problems.pop(data.name, None)
        self.report({'INFO'}, f"'{data.name}' comes from '{self._path}' now: {count:,} splats")

    @staticmethod
    def _write(data, made, clears_mask):
        stipple = data.stipple
        if stipple.is_sequence:
            sync.write_shown(data)
            return
        if clears_mask:
            masks.clear(data)
        splats = sources.masked(made, data) if source_settings.of(stipple).as_they_are else decoded.decode_data(
            data, sources.decode_settings(stipple))
        sync.write_decoded(data, splats.columns())


def _noun(stipple):
    """What the files of a source are."""
    return binding.model.Model if source_settings.of(stipple).has_budget else binding.cloud.Cloud


def _count_before(data):
    """Splats of the source as it was read."""
    if source_settings.of(data.stipple).counts_splats:
        return data.stipple.source_count
    counts = masks.counts(data)
    return splat_data.count(data) if counts is None else counts[0]


classes = (STIPPLE_OT_relink,)
