"""Anchors with features, from images to splats at a budget."""
import json

import pytest
from fit_dataset import dataset, error, figures, run  # noqa: F401

FEW = ('--model', 'scaffold', '--iterations', 120, '--max-anchors', 200, '--gaussians-per-anchor', 5, '--sh-degree', 1)


@pytest.fixture(scope='module')
def model(dataset, tmp_path_factory):  # noqa: F811
    path = tmp_path_factory.mktemp('model') / 'm.stipple.safetensors'
    report = path.with_name('r.json')
    seen = figures(run('fit', dataset, path, *FEW, '--report', report).stdout)
    assert float(seen['held_out_psnr']) > 12  # 3 dB above images of nothing
    report = json.loads(report.read_text())
    assert report['model'] == report['settings']['model'] == 'scaffold'
    assert report['settings']['most_anchors'] == 200
    assert 'strategy' not in report['settings']
    # Every octave of budgets is measured, and the best is that of all anchors within 0.1 dB.
    by_budget = report['by_budget']
    assert len(by_budget) > 3 and by_budget[-1]['psnr'] > max(row['psnr'] for row in by_budget) - 0.1
    return path


def test_a_fit_is_a_model_with_budgets(model):
    info = json.loads(run('info', model, '--json').stdout)
    assert info['kind'] == 'anchors with features'
    assert 1 < info['anchors'] <= 200


def splats_of(path):
    return json.loads(run('info', path, '--json').stdout)['count']


def test_it_decodes_at_any_budget(model, tmp_path):
    anchors = json.loads(run('info', model, '--json').stdout)['anchors']
    counts = []
    for budget in (1, anchors // 2, anchors):
        run('decode', model, tmp_path / f'{budget}.ply', '--anchors', budget)
        counts.append(splats_of(tmp_path / f'{budget}.ply'))
    assert counts == sorted(counts)
    assert counts[0] <= 5 and anchors < counts[-1] <= 5 * anchors
    assert f'1 to {anchors} is allowed' in error('decode', model, tmp_path / 'many.ply', '--anchors', anchors + 1)


def test_it_renders_and_converts(model, dataset, tmp_path):  # noqa: F811
    run('render', model, '--camera', dataset / 'transforms.json', '--view', 0, '-o', tmp_path / 'all.png')
    assert (tmp_path / 'all.png').stat().st_size > 100
    run('decode', model, tmp_path / 'a.ply')
    run('convert', tmp_path / 'a.ply', tmp_path / 'a.spz')
    assert splats_of(tmp_path / 'a.spz') == splats_of(tmp_path / 'a.ply')


def test_it_fits_to_a_file_of_splats(dataset, tmp_path):  # noqa: F811
    run('fit', dataset, tmp_path / 'all.ply', *FEW)
    run('fit', dataset, tmp_path / 'few.ply', *FEW, '--budget', 10)
    assert 0 < splats_of(tmp_path / 'few.ply') <= 50 < splats_of(tmp_path / 'all.ply')


def test_it_refuses_what_does_not_concern_it(dataset, tmp_path):  # noqa: F811
    assert 'belongs to' in error('fit', dataset, tmp_path / 'x.ply', *FEW, '--no-density-gradient')
    assert 'have none' in error('fit', dataset, tmp_path / 'x.ply', *FEW, '--strategy', 'adaptive')
    assert '--max-anchors' in run('fit', dataset, tmp_path / 'x.ply', '--model', 'scaffold', '--max-anchors', 0,
                                  status=1).stderr
