# SPDX-License-Identifier: GPL-3.0-or-later
"""All budgets of an animation are decoded before it is played or rendered."""

import itertools
import time

import bpy

from ..binding import structs
from ..binding.errors import CancelledError, StippleError
from ..jobs import JobOperator, Task
from ..scene.source import cloud_cache, decoded, exporting, frame_budgets, source_settings, sources, splat_data


class STIPPLE_OT_decode_budgets(JobOperator, bpy.types.Operator):
    """Decode each budget that the splats have in the scene's range of frames, in the viewport and in renders, and keep
    the splats in memory: playing and rendering then wait for no decoding"""

    bl_idname = 'stipple.decode_budgets'
    bl_label = "Prepare Budgets"
    bl_options = {'REGISTER'}

    @classmethod
    def poll(cls, context):
        obj = context.object
        if not splat_data.is_splat_object(obj):
            return False
        stipple = obj.data.stipple
        return source_settings.of(stipple).has_budget and not stipple.is_sequence and not stipple.edited

    def invoke(self, context, _event):
        return self.run_in_window(context)

    def start(self, context):
        data = context.object.data
        sources.check_unchanged(data)
        self._name, self._settings = context.object.name, frame_budgets.gather(context, data)
        self._size = cloud_cache.bytes_of(sum(one.most_splats for one in self._settings), splat_data.degree(data))
        kept = decoded.cache_limit()
        if self._size > kept:
            raise StippleError(f"{self._what()} take {exporting.megabytes(self._size)}, and at most "
                               f"{exporting.megabytes(kept)} are kept; choose a larger Budget Cache (or Memory Limit) "
                               "in Preferences > Add-ons > Stipple, fewer frames, or smaller budgets.",
                               structs.Status.ERROR_MEMORY_LIMIT)
        decoder, allowed = decoded.Decoder(data), sources.context().memory_limit()
        return Task(lambda task: self._work(task, decoder, allowed))

    def _work(self, task, decoder, allowed):
        """In the task's thread. Returns (budgets that were not decoded before, seconds)."""
        settings, begin, made, ready = self._settings, time.monotonic(), 0, 0
        # Where work stands: splats are a fair measure of it.
        ends = [0, *itertools.accumulate((one.most_splats for one in settings))]
        try:
            model = decoder.model(lambda job: task.run(job, 0.0, 0.0, 'Reading the source'))
            needed = self._size + max(model.decode_memory_bound(one) for one in settings)
            if needed > allowed:
                raise StippleError(f"{self._what()} and their decoding take {exporting.megabytes(needed)}; the memory "
                                   f"limit is {exporting.megabytes(allowed)}.", structs.Status.ERROR_MEMORY_LIMIT)
            for i, one in enumerate(settings):
                part, stage = (ends[i] / ends[-1], ends[i + 1] / ends[-1]), f'budget {i + 1} of {len(settings)}'
                task.advance(part[0], stage)
                made += not decoder.is_kept(one)
                decoder.cloud(one, lambda job: task.run(job, *part, stage))
                ready = i + 1
        except CancelledError:
            raise CancelledError(f"Cancelled: of {self._what()}, {ready} are decoded and stay so") from None
        return made, time.monotonic() - begin

    def finish(self, _context, job):
        made, seconds = job.result
        self.report({'INFO'}, f"{self._what()} are decoded, {made} of them now, in {seconds:.1f} s; they take "
                              f"{exporting.megabytes(self._size)} of memory")

    def _what(self):
        count = len(self._settings)
        return f"{count:,} budget{'' if count == 1 else 's'} of '{self._name}'"


classes = (STIPPLE_OT_decode_budgets,)
