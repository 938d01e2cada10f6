# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh takes the shape of objects that are rendered from all around."""

from ...binding.errors import invalid
from ...binding.structs import ColourSpace
from . import view_rigs
from .view_task import ViewTask

# Images of a file hold no more, and what shines more would outweigh the outlines.
_BRIGHTEST = 1.0


class AdaptToViewsTask(ViewTask):
    """Result: the Adaptation, which has ended well."""

    parts = {'views': 0.40, 'use': 0.60}
    colour_space = ColourSpace.LINEAR
    cast = staticmethod(view_rigs.meets_nothing)

    def __init__(self, context, objects, rig, adapt):
        """rig: view_task.RigSettings. adapt(views) starts the Adaptation."""
        super().__init__(context, objects, rig)
        self._adapt = adapt
        self._shows_something = False
        self.cut_count = 0  # of images whose edge something reaches over

    def preview(self):
        """The newest shape (Mesh), each once, or None."""
        return None if self.job is None else self.job.preview()

    def finish(self):
        """Ends soon: with the shape that the mesh has, or with nothing while views are rendered."""
        if self.job is None:
            self.cancel()
        else:
            self.job.finish()

    def _add_points(self, _views):
        """None: only images count."""
        return iter(())

    def _add_view(self, views, seen, shot):
        seen.linear[..., :3] = seen.linear[..., :3].clip(0, _BRIGHTEST * seen.linear[..., 3:])
        alpha = seen.linear[..., 3]
        self._shows_something |= bool(alpha.any())
        self.cut_count += any(edge.any() for edge in (alpha[0], alpha[-1], alpha[:, 0], alpha[:, -1]))
        views.add(seen.camera, seen.linear, name=shot.name)

    def _use(self, views):
        if not self._shows_something:
            raise invalid('The renders are empty; at least one selected object, and a collection that it is in, have to '
                          'be shown in renders.')
        self.job = self._adapt(views)
        yield from self._until_done(self.job, 'use')
        self.result = self.job
