# SPDX-License-Identifier: GPL-3.0-or-later
"""Training of networks on a collection of objects."""

from ctypes import byref, c_char_p

from .handle import new_handle, path_bytes
from .job import Job
from .structs import StippleTrainBudget, StippleTrainFigures


def start_encoding(context, weights_path, object_path, token_count=0):
    """Job: an object, by its folder in a collection or by a .ply of points with colours, becomes a Model;
    Model.of_job(job) gives it."""
    return Job(context.library, new_handle(context.library, 'stipple_encode_start', context.pointer,
                                           path_bytes(weights_path), path_bytes(object_path), token_count))


class Training(Job):
    """A training that runs; its results are files in the folder that its config names."""

    @classmethod
    def start(cls, context, config_path, resume=False):
        """Raises StippleError for a config that is refused, and where a checkpoint is left or missing."""
        return cls(context.library, new_handle(context.library, 'stipple_train_start', context.pointer,
                                               path_bytes(config_path), int(resume)))

    def figures(self):
        """StippleTrainFigures as they are now. Never waits."""
        figures = StippleTrainFigures()
        self._check(self.library.stipple_train_figures(self.pointer, byref(figures)))
        return figures

    def notes(self):
        """Sentences on what the user should know."""
        found = []
        for index in range(self.figures().note_count):
            text = c_char_p()
            self._check(self.library.stipple_train_note(self.pointer, index, byref(text)))
            found.append(text.value.decode())
        return found

    def budgets(self):
        """[StippleTrainBudget] of the result, ascending, once it has ended."""
        found = []
        for index in range(self.figures().budget_count):
            budget = StippleTrainBudget()
            self._check(self.library.stipple_train_budget(self.pointer, index, byref(budget)))
            found.append(budget)
        return found
