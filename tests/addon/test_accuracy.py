# SPDX-License-Identifier: GPL-3.0-or-later
"""Accuracy from a script: levels, knobs, every combination, and what is refused."""

import itertools
import json
import math

import numpy as np
import pytest

from stipple.binding.accuracy import (AccuracyMeasurement, accuracy, accuracy_knobs, accuracy_level_name,
                                      accuracy_verdict)
from stipple.binding.cloud import Cloud, SplatArrays
from stipple.binding.errors import CancelledError, StippleError
from stipple.binding.model import DecodeSettings, Model
from stipple.binding.renderer import Renderer
from stipple.binding.structs import (AccuracyLevel, CameraModel, LowPass, OutputColour, Precision, Projection,
                                     RenderMethod, Sampling, SplatOrder, StippleAccuracy, StippleCamera)

WIDTH, HEIGHT, COUNT = 40, 30, 60


def camera_of(scale=1):
    camera = StippleCamera(width=WIDTH * scale, height=HEIGHT * scale, fx=30 * scale, fy=30 * scale,
                           cx=WIDTH / 2 * scale, cy=HEIGHT / 2 * scale, near_plane=0.01, far_plane=100)
    camera.world_to_camera[:] = [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 2.5, 0, 0, 0, 1]
    return camera


@pytest.fixture(scope='module')
def cloud(context):
    random = np.random.default_rng(3)
    return Cloud.create(context, SplatArrays(
        random.uniform(-1, 1, (COUNT, 3)).astype(np.float32), random.normal(size=(COUNT, 4)).astype(np.float32),
        random.uniform(0.03, 0.3, (COUNT, 3)).astype(np.float32), random.uniform(0.2, 0.95, COUNT).astype(np.float32),
        random.uniform(-0.6, 0.6, (COUNT, 9, 3)).astype(np.float32)))


@pytest.fixture(scope='module')
def renderer(context):
    return Renderer(context)


def drawn(renderer, cloud, chosen=None, scale=1, **options):
    options = renderer.options(output_colour=OutputColour.COMPOSITED, accuracy=chosen, **options)
    task = renderer.start([(cloud, np.eye(4))], camera_of(scale), options, with_depth=False)
    task.job.wait()
    return task.colour


def test_levels_are_what_they_say(library, renderer, cloud):
    final = drawn(renderer, cloud, accuracy(library))
    assert np.array_equal(final, drawn(renderer, cloud))
    reference = drawn(renderer, cloud, accuracy(library, AccuracyLevel.REFERENCE))
    assert np.array_equal(reference, drawn(renderer, cloud, method=RenderMethod.RAYS_UNLIMITED))
    errors = [np.abs(drawn(renderer, cloud, accuracy(library, level)) - reference).mean()
              for level in (AccuracyLevel.DRAFT, AccuracyLevel.PREVIEW, AccuracyLevel.FINAL)]
    assert errors[0] > errors[1] > errors[2] > 0
    assert [accuracy_level_name(library, level) for level in AccuracyLevel] == ['draft', 'preview', 'final',
                                                                                'reference']


def test_double_is_the_reference_of_the_tiled_renderer(library, renderer, cloud):
    double = drawn(renderer, cloud, accuracy(library, precision=Precision.DOUBLE))
    # Both are double; sums differ by the float32 of the result.
    assert np.abs(double - drawn(renderer, cloud, method=RenderMethod.REFERENCE)).max() < 2e-7


def test_every_combination_draws_what_its_double_draws(library, renderer, cloud):
    combinations = itertools.product(SplatOrder, Projection, (1 / 255, 0.05, 1e-6), (0, 4), (1.0, 0.5),
                                     (Sampling.AS_TRAINED, Sampling.MIP, Sampling.SAMPLES))
    for order, projection, min_alpha, degree, share, sampling in combinations:
        knobs = dict(order=order, projection=projection, min_alpha=min_alpha, sh_degree_limit=degree,
                     budget_share=share, antialiasing=sampling,
                     samples_per_side=2 if sampling == Sampling.SAMPLES else 1)
        picture = drawn(renderer, cloud, accuracy(library, **knobs))
        double = drawn(renderer, cloud, accuracy(library, precision=Precision.DOUBLE, **knobs))
        assert np.isfinite(picture).all() and picture[..., 3].min() >= 0 and picture[..., 3].max() <= 1, knobs
        # A splat whose alpha is at the cut-off to float32 may be in one of the two alone.
        assert np.abs(picture - double).max() < 1e-4 + min_alpha, knobs
        assert np.abs(picture - double).mean() < 2e-5, knobs


def test_samples_are_a_larger_picture_averaged(library, renderer, cloud):
    large = drawn(renderer, cloud, scale=3)
    averaged = large.reshape(HEIGHT, 3, WIDTH, 3, 4).mean((1, 3))
    sampled = drawn(renderer, cloud, accuracy(library, antialiasing=Sampling.SAMPLES, samples_per_side=3))
    assert np.abs(sampled - averaged).max() < 2e-7


def test_share_is_the_cloud_merged_to_so_many(library, context, renderer, cloud):
    job = Model.from_cloud_start(context, cloud, view_count=0)
    job.wait()
    half = Model.of_job(job).decode(DecodeSettings(COUNT // 2))
    assert np.array_equal(drawn(renderer, cloud, accuracy(library, budget_share=0.5)), drawn(renderer, half))


@pytest.mark.parametrize('knobs, text', [
    (dict(level=7), 'level is 7; 0 to 3 is allowed'),
    (dict(order=2), 'order is 2; 0 to 1 is allowed'),
    (dict(projection=9), 'projection is 9; 0 to 1 is allowed'),
    (dict(antialiasing=3), 'antialiasing is 3; 0 to 2 is allowed'),
    (dict(precision=2), 'precision is 2; 0 to 1 is allowed'),
    (dict(sh_degree_limit=5), 'sh_degree_limit is 5; 0 to 4 is allowed'),
    (dict(samples_per_side=0), 'samples_per_side is 0; 1 to 16 is allowed'),
    (dict(samples_per_side=17), 'samples_per_side is 17; 1 to 16 is allowed'),
    (dict(samples_per_side=4), 'samples_per_side is 4 without antialiasing by samples'),
    (dict(min_alpha=0), 'min_alpha is 0; a number above 0 and below 1 is allowed'),
    (dict(min_alpha=float('nan')), 'min_alpha is nan; a number above 0'),
    (dict(budget_share=0), 'budget_share is 0; a number above 0 and up to 1 is allowed'),
    (dict(budget_share=1.5), 'budget_share is 1.5; a number above 0 and up to 1'),
])
def test_bad_knobs_are_refused(library, renderer, cloud, knobs, text):
    with pytest.raises(StippleError, match=text.replace('.', r'\.')):
        accuracy(library, **knobs)
    made = accuracy(library)
    for name, value in knobs.items():
        setattr(made, name, value)
    with pytest.raises(StippleError, match='options->accuracy->' + text.replace('.', r'\.')):
        drawn(renderer, cloud, made)


def test_contradictions_are_refused(library, renderer, cloud):
    with pytest.raises(StippleError, match='level is reference with a knob below it'):
        accuracy(library, AccuracyLevel.REFERENCE, precision=Precision.FLOAT)
    with pytest.raises(StippleError, match=r'options->method is 2 beside options->accuracy'):
        drawn(renderer, cloud, accuracy(library), method=RenderMethod.RAYS)
    with pytest.raises(StippleError, match=r'options->low_pass is 1, and options->accuracy asks for mip'):
        drawn(renderer, cloud, accuracy(library, antialiasing=Sampling.MIP), low_pass=LowPass.CLASSIC)
    large = camera_of()
    large.width = 65536
    options = renderer.options(accuracy=accuracy(library, antialiasing=Sampling.SAMPLES, samples_per_side=2))
    with pytest.raises(StippleError, match='131072 samples wide; at most 65536 is allowed'):
        renderer.start([(cloud, np.eye(4))], large, options, with_depth=False)
    with pytest.raises(TypeError, match="no knob 'speed'"):
        accuracy(library, speed=1)


def test_every_knob_says_its_bound(library):
    knobs = accuracy_knobs(library)
    fields = {name for name, *_ in StippleAccuracy._fields_} - {'struct_size'}
    assert {knob.name for knob in knobs} == fields
    for knob in knobs:
        assert knob.label and knob.bound.endswith('.') and len(knob.bound) > 40
        assert knob.has_bound != knob.bound.startswith('No bound')


def test_verdicts_are_words(library):
    assert [accuracy_verdict(library, psnr) for psnr in (float('inf'), 45, 38, 30, 29.9)] == [
        'looks identical', 'looks identical', 'hard to see', 'visible side by side', 'obvious']


@pytest.fixture(scope='module')
def report(context, cloud):
    job = AccuracyMeasurement.start(context, [(cloud, np.eye(4))], camera_of(), repetitions=3)
    job.wait()
    return job.report()


def psnr_of(picture, reference):
    return -10 * math.log10(((picture.astype(np.float64) - reference) ** 2).mean())


def test_measured_errors_are_those_of_the_pictures(library, renderer, cloud, report):
    reference = drawn(renderer, cloud, accuracy(library, AccuracyLevel.REFERENCE))
    assert report.info.compared_pixels == WIDTH * HEIGHT and report.info.splat_count == COUNT
    for row in report.rows[:-1]:
        picture = drawn(renderer, cloud, row.setting)
        assert row.psnr == pytest.approx(psnr_of(picture, reference), abs=1e-6), row.name
        assert row.largest_error == pytest.approx(np.abs(picture - reference).max(), abs=1e-7), row.name
        ordered = np.sort(np.abs(picture - reference), axis=None)
        assert row.error_99_9 == pytest.approx(ordered[math.ceil(0.999 * ordered.size) - 1], abs=1e-7), row.name
        assert row.seconds_low <= row.seconds <= row.seconds_high and row.repetitions == 3
    assert report.rows[-1].name == 'reference' and math.isinf(report.rows[-1].psnr)
    assert [row.name for row in report.rows[:4]] == ['draft', 'preview', 'final', 'final + degree 0']
    assert report.rows[0].splat_count == COUNT // 4


def test_the_front_has_what_nothing_beats(report):
    for row in report.rows:
        beaten = any(other.seconds <= row.seconds and other.psnr >= row.psnr and (other.seconds, -other.psnr) != (
            row.seconds, -row.psnr) for other in report.rows)
        assert row.is_on_front != beaten, row.name


def test_a_setting_is_chosen_by_time_or_by_quality(report):
    fast = report.best_within(report.rows[0].seconds)
    assert fast.psnr == max(row.psnr for row in report.rows if row.seconds <= report.rows[0].seconds)
    assert report.best_within(1e9).name == 'reference'
    good = report.cheapest_above(report.rows[2].psnr)
    assert good.seconds == min(row.seconds for row in report.rows if row.psnr >= report.rows[2].psnr)
    with pytest.raises(StippleError, match=r'no setting draws this view within 1e-06 ms; the fastest, .*, needs .* ms'):
        report.best_within(1e-9)
    with pytest.raises(StippleError, match='the time budget is -1 s; more than 0 is allowed'):
        report.best_within(-1)
    with pytest.raises(StippleError, match='the PSNR asked for is inf dB'):
        report.cheapest_above(math.inf)


def test_a_quality_that_nothing_has_is_refused(library, context, cloud):
    far = accuracy(library, AccuracyLevel.REFERENCE, sh_degree_limit=0)
    job = AccuracyMeasurement.start(context, [(cloud, np.eye(4))], camera_of(), settings=[far], repetitions=1)
    job.wait()
    report = job.report()
    assert [row.name for row in report.rows] == ['reference + degree 0', 'reference']
    assert report.cheapest_above(1e6).name == 'reference'  # its own picture has no error


def test_reports_are_written_by_extension(report, tmp_path):
    for extension in ('json', 'csv', 'svg'):
        report.save(tmp_path / f'report.{extension}')
    read = json.loads((tmp_path / 'report.json').read_text())
    assert [row['name'] for row in read['settings']] == [row.name for row in report.rows]
    assert read['settings'][-1]['psnr'] is None and read['settings'][0]['knobs']['share'] == '0.25'
    lines = (tmp_path / 'report.csv').read_text().splitlines()
    assert len(lines) == len(report.rows) + 1 and lines[1].startswith('"draft",')
    svg = (tmp_path / 'report.svg').read_text()
    assert svg.startswith('<svg') and 'milliseconds' in svg and '>preview<' in svg
    with pytest.raises(StippleError, match=r'has no extension of a report; \.json, \.csv and \.svg are allowed'):
        report.save(tmp_path / 'report.txt')
    picture = report.draw(1.0)
    assert picture.shape == (520, 840, 4) and picture.min() < 0.3 and (picture[..., 3] == 1).all()


def test_a_large_picture_is_compared_in_blocks(library, context, renderer, cloud):
    double = accuracy(library, precision=Precision.DOUBLE)
    job = AccuracyMeasurement.start(context, [(cloud, np.eye(4))], camera_of(8), settings=[accuracy(library), double],
                                    reference_pixels=8192, repetitions=2, max_seconds=0.02)
    job.wait()
    report = job.report()
    assert report.info.compared_pixels == 8192  # two blocks of 64 x 64, of 320 x 240 pixels
    final, exact, reference = report.rows
    assert not final.is_estimated and reference.is_estimated
    assert exact.psnr == pytest.approx(final.psnr, abs=0.01)
    assert exact.is_estimated == (exact.repetitions == 1) and exact.seconds > 0


def test_a_panorama_is_measured_along_rays(library, context, cloud):
    camera = camera_of()
    camera.model = CameraModel.EQUIRECTANGULAR
    camera.fx, camera.fy = WIDTH / (2 * math.pi), HEIGHT / math.pi  # pixels per radian, all around
    placed = [(cloud, np.eye(4))]
    job = AccuracyMeasurement.start(context, placed, camera, repetitions=1)
    job.wait()
    report = job.report()
    names = [row.name for row in report.rows]
    assert len(set(names)) == len(names) and 'final + projection ray' in names and names[-1] == 'reference'
    assert all(row.setting.projection == Projection.RAY for row in report.rows)
    with pytest.raises(StippleError, match='projection affine needs a perspective or orthographic camera'):
        AccuracyMeasurement.start(context, placed, camera, settings=[accuracy(library)])


def test_measuring_refuses_what_it_cannot_measure(library, context, renderer, cloud):
    empty = Cloud.create(context, SplatArrays(*(np.zeros((0, n), np.float32) for n in (3, 4, 3)),
                                              np.zeros(0, np.float32), np.zeros((0, 1, 3), np.float32)))
    for instances in ([], [(empty, np.eye(4))]):
        with pytest.raises(StippleError, match='the instances have 0 splats; measuring needs at least 1'):
            AccuracyMeasurement.start(context, instances, camera_of())
    placed = [(cloud, np.eye(4))]
    for fields, text in ((dict(repetitions=0), 'repetitions is 0; 1 to 1000'),
                         (dict(max_seconds=0), 'max_seconds is 0 s; more than 0 is allowed')):
        with pytest.raises(StippleError, match=text):
            AccuracyMeasurement.start(context, placed, camera_of(), **fields)
    with pytest.raises(StippleError, match=r'render->accuracy is set'):
        AccuracyMeasurement.start(context, placed, camera_of(), renderer.options(accuracy=accuracy(library)))
    bad = accuracy(library)
    bad.samples_per_side = 0
    with pytest.raises(StippleError, match=r'options->settings\[1\]->samples_per_side is 0; 1 to 16 is allowed'):
        AccuracyMeasurement.start(context, placed, camera_of(), settings=[accuracy(library), bad])


def test_measuring_stops_when_it_is_cancelled(library, context, cloud):
    job = AccuracyMeasurement.start(context, [(cloud, np.eye(4))], camera_of(20), repetitions=1000, max_seconds=1000)
    job.cancel()
    with pytest.raises(CancelledError):
        job.wait()
    with pytest.raises(StippleError, match='has not ended well'):
        job.report()
