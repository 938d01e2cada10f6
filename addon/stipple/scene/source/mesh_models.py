# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes become the model that splats are decoded from, or splats that were fitted to images of them."""

from ... import binding
from ...binding import structs
from ...jobs import Task
from . import masks, source_settings, sources

REFINE_STEPS = 200
REFINE_TEXT = ("Fit the splats to images of the meshes: edges and textures get sharper, which takes some ten seconds. "
               "Afterwards the number of splats can be lowered, not raised")


def start(native, mesh, settings, detail_weight, refine):
    """A job that makes the model, for model_of(). settings: DecodeSettings with the seed; a refined model is a tree of
    the splats that they give."""
    making = binding.model.Model.from_mesh_start(native, mesh, detail_weight, settings.seed)
    if not refine:
        return making

    def work(task):
        model = binding.model.Model.of_job(task.run(making, 0.0, 0.1))
        splats = binding.cloud.Cloud.of_job(task.run(model.decode_start(settings), 0.1, 0.15))
        refining = task.run(binding.model.refine_start(splats, mesh, REFINE_STEPS), 0.15, 0.85)
        refined = binding.cloud.Cloud.of_job(refining)
        return binding.model.Model.of_job(task.run(binding.model.Model.from_cloud_start(native, refined), 0.85, 1.0))
    return Task(work)


def model_of(job):
    return job.result if isinstance(job, Task) else binding.model.Model.of_job(job)


def made_with(stipple):
    """The settings that the present source was made with, where it is refined, or that show it."""
    known, gaussians = source_settings.of(stipple), stipple.gaussians_per_anchor
    anchors = max(1, stipple.source_count // gaussians) if known.counts_splats else stipple.anchors
    return binding.model.DecodeSettings(anchors, gaussians, structs.AnchorOrder[stipple.order], stipple.seed)


def show_all(stipple, made):
    """The budget of a source that has just been refined, or is no longer: what it was made with."""
    stipple.anchors = made.anchors
    if stipple.refine:
        stipple.budget_by, stipple.ratio, stipple.ratio_render = 'RATIO', 1.0, 1.0


def attach(data, path, objects, model):
    """Notes a model of meshes as the source of a datablock, and what it was made with."""
    stipple, settings = data.stipple, model.settings()
    sources.attach_model(data, path, objects, settings)
    stipple.source_refine = stipple.refine
    masks.clear(data)  # which of its splats were hidden
    if stipple.refine:
        stipple.source_count = settings.maximum_budget
