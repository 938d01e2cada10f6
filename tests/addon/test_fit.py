# SPDX-License-Identifier: GPL-3.0-or-later
"""Fitting through the binding: figures, a preview, the result, a report, a resumed fit."""

import json
import math
import time

import numpy as np
import pytest

from stipple.binding.errors import CancelledError, StippleError
from stipple.binding.fit import Fit, check_places, fit_memory_bound, fit_option_table, fit_options
from stipple.binding.model import DecodeSettings
from stipple.binding.strategies import check_strategy, strategies, strategy_parts
from stipple.binding.structs import (MAX_ANCHORS, BudgetUnit, ColourSpace, FitModel, FitOptionKind, FitQuality,
                                     FitShell, StippleCamera, StippleFitOptions, Transfer)
from stipple.binding.views import Views


def camera(angle):
    made = StippleCamera(width=32, height=24, fx=30, fy=30, cx=16, cy=12, near_plane=0.01, far_plane=100.0)
    c, s = math.cos(angle), math.sin(angle)
    matrix = (c, 0, s, 0, 0, -1, 0, 0, s, 0, -c, 3, 0, 0, 0, 1)
    for i, value in enumerate(matrix):
        made.world_to_camera[i] = value
    return made


@pytest.fixture
def views(context):
    """A red ball of radius 0.5 from ten sides."""
    y, x = np.mgrid[0:24, 0:32] + 0.5
    inside = ((x - 16) ** 2 + (y - 12) ** 2 < 5.0 ** 2).astype(np.float32)
    rgba = np.stack((0.8 * inside, 0.1 * inside, 0.1 * inside, inside), axis=-1)
    made = Views.create(context, ColourSpace.DISPLAY)
    for i in range(10):
        made.add(camera(2 * math.pi * i / 10), rgba, transfer=Transfer.SRGB, name=f'v{i}')
    rng = np.random.default_rng(1)
    points = rng.normal(size=(50, 3))
    points *= 0.5 / np.linalg.norm(points, axis=1, keepdims=True)
    made.set_points(points, np.full((50, 3), 0.5))
    return made


def options(context, **fields):
    values = dict(iterations=60, max_splats=200, sh_degree=0, measure_interval=10)
    return fit_options(context.library, **{**values, **fields})


def test_fits_and_reports(context, views, tmp_path):
    fit = Fit.start(context, views, options(context))
    fit.wait()
    figures = fit.figures()
    assert figures.iteration == 60
    assert figures.best_psnr > 15
    cloud = fit.result()
    assert 0 < cloud.info().count <= 200
    fit.save_report(tmp_path / 'r.json')
    report = json.loads((tmp_path / 'r.json').read_text())
    assert len(report['by_iteration']['loss']) == 60
    assert report['measured_views'] == 2
    assert (tmp_path / 'r.svg').read_text().startswith('<svg ')
    assert fit.notes() == []


def test_a_cancel_keeps_the_best(context, views):
    fit = Fit.start(context, views, options(context, iterations=1000000))
    deadline = time.monotonic() + 60
    preview = None
    while preview is None and time.monotonic() < deadline:
        preview = fit.preview()
        time.sleep(0.002)
    assert preview.info().count > 0
    fit.cancel()
    with pytest.raises(CancelledError):
        fit.wait()
    assert fit.result().info().count > 0


def test_a_field_decodes_at_any_budget(context, views):
    fit = Fit.start(context, views, options(context, model=FitModel.FIELD, iterations=30, min_anchors=16,
                                            max_anchors=64, gaussians_per_anchor=4))
    fit.wait()
    assert fit.result(32).info().count == 128
    model = fit.model()
    info = model.info()
    assert (info.kind_label, info.max_anchors, info.gaussians_per_anchor) == (b'learned field', 64, 4)
    settings = model.settings()
    assert (settings.budget_unit, settings.maximum_learned_budget, settings.default_budget) == (BudgetUnit.ANCHORS, 64,
                                                                                                64)
    assert settings.minimum_gaussians_per_anchor == settings.maximum_gaussians_per_anchor == 4
    # A field is drawn from as it has learned, in one order.
    assert (settings.has_order, settings.has_seed, settings.takes_mask, settings.has_time) == (0, 1, 0, 0)
    assert model.decode(DecodeSettings(anchors=20)).info().count == 80


@pytest.mark.parametrize('shell', FitShell)
def test_a_field_has_a_shell_where_it_is_asked_for(context, views, shell):
    fit = Fit.start(context, views, options(context, model=FitModel.FIELD, iterations=10, min_anchors=16,
                                            max_anchors=256, shell=shell))
    fit.wait()
    farthest = np.abs(fit.result().read().positions).max()
    assert farthest > 5 if shell == FitShell.ON else farthest < 2  # Auto: views have alpha


def test_resumes_only_the_same_fit(context, views, tmp_path):
    path = tmp_path / 'ä.checkpoint.safetensors'
    Fit.start(context, views, options(context, checkpoint_path=path, checkpoint_interval=30)).wait()
    assert path.is_file()
    other = Fit.start(context, views, options(context, checkpoint_path=path, resume=1, iterations=61))
    with pytest.raises(StippleError, match='iterations was 60; now it is 61'):
        other.wait()


def test_no_file_of_another_kind_is_replaced(context, views, tmp_path):
    model, report = tmp_path / 'model.safetensors', tmp_path / 'ä.json'
    for path in (model, report):
        path.write_bytes(b'something else')
    with pytest.raises(StippleError,
                       match='model.safetensors is a file of another kind, which a checkpoint would replace'):
        Fit.start(context, views, options(context, checkpoint_path=model))
    with pytest.raises(StippleError, match='model.safetensors is a file of another kind'):
        check_places(context.library, checkpoint_path=model)
    with pytest.raises(StippleError, match='ä.json is a file of another kind'):
        check_places(context.library, report)
    with pytest.raises(StippleError, match="no folder '/nowhere'"):
        check_places(context.library, '/nowhere/r.json')
    check_places(context.library, tmp_path / 'new.json', tmp_path / 'new.safetensors')
    check_places(context.library)
    assert sorted(tmp_path.iterdir()) == [model, report]
    fit = Fit.start(context, views, options(context))
    fit.wait()
    with pytest.raises(StippleError, match='ä.json is a file of another kind'):
        fit.save_report(report)
    assert report.read_bytes() == b'something else'


def test_presets_grow_with_quality(context):
    chosen = [fit_options(context.library, model, quality) for model in FitModel for quality in FitQuality]
    assert [o.iterations for o in chosen[:3]] == sorted({o.iterations for o in chosen[:3]})
    assert chosen[0].max_splats < chosen[2].max_splats
    assert chosen[3].model == FitModel.FIELD
    assert chosen[3].max_anchors < chosen[5].max_anchors


def test_every_field_is_an_option_and_every_option_a_field(context):
    fields = [name.removesuffix('_utf8') for name,
              _ in StippleFitOptions._fields_ if name not in ('struct_size', 'reserved')]
    table = fit_option_table(context.library)
    assert sorted(option.name for option in table) == sorted(fields)


def test_defaults_and_presets_are_those_of_the_table(context):
    table = fit_option_table(context.library)
    assert next(option for option in table if option.name == 'max_anchors').maximum == MAX_ANCHORS

    def text(option, value):
        if option.kind == FitOptionKind.CHOICE:
            return option.choices[value]
        if option.kind == FitOptionKind.BYTES and value:
            return f'{value >> 30}GiB' if value % 2**30 == 0 else f'{value >> 20}MiB'
        if option.kind == FitOptionKind.TEXT:
            return (value or b'').decode()
        return f'{value:g}' if option.kind == FitOptionKind.NUMBER else str(value)

    for model in FitModel:
        for quality in FitQuality:
            made = fit_options(context.library, model, quality)
            for option in table:
                field = 'strategy_utf8' if option.name == 'strategy' else option.name
                if field == 'checkpoint_path' or option.name == 'model':
                    continue
                wanted = option.presets[model][quality]
                assert text(option, getattr(made, field)) == (option.default if wanted is None else wanted), option.name


def test_unknown_names_are_errors(context, views):
    with pytest.raises(TypeError, match="no option 'iteration'"):
        fit_options(context.library, iteration=3)
    with pytest.raises(StippleError, match='adaptive'):
        Fit.start(context, views, options(context, strategy='best')).wait()


def test_lists_strategies_and_parts(context):
    known = strategies(context.library)
    assert known[0].name == 'adaptive'
    assert [entry.name for entry in known if entry.model == FitModel.FIELD] == ['learned_density']
    parts = {entry.name: entry for entry in strategy_parts(context.library)}
    # Files keep a part under its bit: these never change, and no other part gets one of them.
    bits = ('edge_aware_score', 'long_axis_split', 'volume_split', 'recovery_pruning', 'growth_control',
            'multi_step_update', 'opacity_correction', 'filter_3d', 'visibility_weighted_score', 'lifespan_threshold',
            'offset_warp', 'splat_dropout')
    assert [parts[name].bit for name in bits] == list(range(len(bits)))
    assert len({entry.bit for entry in parts.values()}) == len(parts) and all(e.bit < 31 for e in parts.values())
    assert all(entry.bit is None for entry in known)
    growth = parts['growth_control']
    assert (growth.label, growth.decides) == ('Growth Control', 'how many splats there may be')
    assert [(s.name, s.default, s.minimum, s.is_whole) for s in growth.settings] == [('splats', 0, 0, True)]
    threshold, = known[0].settings
    assert (threshold.name, threshold.minimum, threshold.maximum, threshold.is_whole) == ('threshold', 1e-9, 1e9, False)
    assert 1e-5 < threshold.default < 1e-3
    check_strategy(context.library, 'adaptive+long_axis_split')
    with pytest.raises(StippleError, match="part is 'nothing'"):
        check_strategy(context.library, 'adaptive+nothing')


def test_memory_grows_with_the_cap(context, views):
    small, large = (fit_memory_bound(views, options(context, max_splats=n)) for n in (1000, 100000))
    assert large - small > 99000 * 4 * 14
