# SPDX-License-Identifier: GPL-3.0-or-later
"""Images to splats through the binding, with the small networks of a golden."""

import sys
from ctypes import byref
from pathlib import Path

import numpy as np
import pytest

from stipple.binding.errors import CancelledError, StippleError
from stipple.binding.generate import Generation, estimate, generate_options
from stipple.binding.image import Image
from stipple.binding.model import DecodeSettings, Model
from stipple.binding.structs import JobState, NoiseSource, Status, StippleGenerateFigures, Transfer

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import pipeline_weights  # noqa: E402

SMALL = {'canvas_size': pipeline_weights.CANVAS, 'token_count': pipeline_weights.TOKENS,
         'steps': pipeline_weights.STEPS}


@pytest.fixture(scope='module')
def weights(tmp_path_factory):
    folder = tmp_path_factory.mktemp('weights')
    pipeline_weights.split(folder)
    return folder


@pytest.fixture
def image(context):
    width, height, rgba = pipeline_weights.image()
    pixels = np.frombuffer(rgba, np.uint8).reshape(height, width, 4).astype(np.float32) / 255
    pixels[..., :3] *= pixels[..., 3:]
    return Image.create(context, pixels, Transfer.SRGB)


def test_an_image_becomes_a_model(context, weights, image):
    options = generate_options(context.library, weights, preview_steps=1, preview_anchors=32, **SMALL)
    job = Generation.start(context, image, None, options)
    job.wait()
    figures = job.figures()
    assert (figures.step, figures.steps, figures.resumed_step) == (4, 4, 0)
    assert figures.preview_step == 3 and figures.seconds > 0
    assert job.preview().info().count == 32 * 32 and job.preview() is None
    names = [name for name, _ in job.stages()]
    assert 'structure.features' in names and names[-1].startswith('splats.')
    stage = dict(job.stages())['latent']
    assert stage.count == 64 * 16 and stage.minimum < stage.mean < stage.maximum
    model = Model.of_job(job)
    assert model.settings().default_gaussians_per_anchor == 32
    cloud = model.decode(DecodeSettings(40))
    assert cloud.info().count == 40 * 32


def test_another_seed_takes_over_what_the_encoders_said(context, weights, image):
    def started(seed, encoded_by=None):
        job = Generation.start(context, image, None, generate_options(context.library, weights, seed=seed, **SMALL),
                               encoded_by)
        job.wait()
        return job
    first = started(42)
    second, alone = started(43, first), started(43)
    for job, encodes in ((first, True), (second, False), (alone, True)):
        stages = dict(job.stages())
        assert (stages['structure.features'].operations > 1e6) == encodes
        assert (stages['colour.moments'].operations > 1e6) == encodes
    assert dict(second.stages())['latent'].mean == dict(alone.stages())['latent'].mean


def test_noise_of_another_kind_gives_another_object(context, weights, image):
    made = []
    for source in NoiseSource:
        job = Generation.start(context, image, None, generate_options(context.library, weights, noise_source=int(source),
                                                                      **SMALL))
        job.wait()
        made.append(dict(job.stages())['latent'].mean)
    assert made[0] != made[1]


def test_cancelling_is_a_status_of_its_own(context, weights, image):
    job = Generation.start(context, image, None, generate_options(context.library, weights, **{**SMALL, 'steps': 1000}))
    job.cancel()
    with pytest.raises(CancelledError):
        job.wait()
    assert job.poll()[0] == JobState.CANCELLED


def test_estimates_are_of_the_networks_that_are_there(context, weights):
    few = estimate(context, generate_options(context.library, weights, **SMALL))
    many = estimate(context, generate_options(context.library, weights, **{**SMALL, 'steps': 400}))
    assert few.weight_bytes == sum(path.stat().st_size for path in weights.iterdir())
    assert 0 < few.seconds < many.seconds and few.bytes > 0


def test_what_is_wrong_is_said_before_it_starts(context, weights, image, tmp_path):
    def refused(match, status=Status.ERROR_INVALID_ARGUMENT, **changed):
        fields = {'weights_folder': weights, **SMALL, **changed}
        folder = fields.pop('weights_folder')
        with pytest.raises(StippleError, match=match) as error:
            Generation.start(context, image, None, generate_options(context.library, folder, **fields))
        assert error.value.status == status
    refused('steps', steps=0)
    refused('canvas', canvas_size=1000)
    refused('uses_mean_colour', uses_mean_colour=2)
    refused('size', size=-1.0)
    refused('TripoSplat flow network', weights_folder=tmp_path)
    with pytest.raises(StippleError, match='a mask and no image'):
        Generation.start(context, None, image, generate_options(context.library, weights, **SMALL))


def test_figures_of_another_job_are_refused(context, weights):
    from stipple.binding.weights import Weights
    job = Weights.find(context, weights).check_start()
    assert context.library.stipple_generate_figures(job.pointer, byref(StippleGenerateFigures())) \
        == Status.ERROR_INVALID_ARGUMENT
    job.wait()


def test_a_folder_that_the_context_knows_need_not_be_given(context, weights, image):
    context.set_weights_folder(str(weights))
    options = generate_options(context.library, weights, **SMALL)
    options.weights_folder_utf8 = None
    Generation.start(context, image, None, options).wait()
    context.set_weights_folder('')
    with pytest.raises(StippleError, match='huggingface'):
        Generation.start(context, image, None, options)
