"""Accuracy from the command line: levels, single knobs, the report, and one-line errors."""
import csv
import json

import pytest

from test_tool import error, figures, run, write_camera, write_cube_glb


@pytest.fixture(scope='module')
def view(tmp_path_factory):
    """(splats, camera file) of a cube."""
    folder = tmp_path_factory.mktemp('view')
    write_cube_glb(folder / 'cube.glb')
    run('decode', folder / 'cube.glb', folder / 'cube.ply', '--anchors', 400)
    write_camera(folder / 'camera.json')
    return folder / 'cube.ply', folder / 'camera.json'


def picture(view, path, *options):
    splats, camera = view
    run('render', splats, '--camera', camera, '--width', 48, '--height', 36, '-o', path, *options)
    return path


def test_levels_and_knobs_change_the_picture(view, tmp_path):
    final = picture(view, tmp_path / 'final.exr')
    for level in ('draft', 'preview', 'rays', 'reference'):
        other = picture(view, tmp_path / f'{level}.exr', '--accuracy', level)
        assert 10 < figures('compare', final, other)['psnr'] < 80, level
    double = picture(view, tmp_path / 'double.exr', '--accuracy', 'double')
    assert figures('compare', final, double)['psnr'] > 90
    rays = picture(view, tmp_path / 'knobs.exr', '--order', 'pixel', '--projection', 'ray')
    assert figures('compare', rays, tmp_path / 'rays.exr')['max_error'] == 0
    for knob in (('--share', '0.3'), ('--samples', '2'), ('--min-alpha', '0.2')):
        other = picture(view, tmp_path / 'knob.exr', *knob)
        assert figures('compare', final, other)['max_error'] > 1e-3, knob
    former = picture(view, tmp_path / 'former.exr', '--least-alpha', '0.2')
    assert figures('compare', former, other)['max_error'] == 0


def test_a_report_is_printed_and_written(view, tmp_path):
    splats, camera = view
    out = run('accuracy', splats, '--camera', camera, '--width', 48, '--height', 36, '--repetitions', 2, '-o',
              tmp_path / 'r.json', '-o', tmp_path / 'r.csv', '-o', tmp_path / 'r.svg', '--within', 1e9, '--above',
              20).stdout
    lines = out.splitlines()
    assert lines[0].startswith('48 x 36 pixels, 1728 of them compared with the reference itself, 400 splats')
    assert any(line.startswith('preview ') for line in lines)
    assert 'best within 1e+09 ms: reference' in lines and lines[-1].startswith('cheapest above 20 dB: ')
    settings = json.loads((tmp_path / 'r.json').read_text())['settings']
    rows = list(csv.DictReader((tmp_path / 'r.csv').open()))
    assert [row['setting'] for row in rows] == [setting['name'] for setting in settings]
    assert (tmp_path / 'r.svg').read_text().startswith('<svg')


def test_voxel_sizes_report_in_the_same_form(view, tmp_path):
    out = run('accuracy', view[0], '--resolution', 48, '--repetitions', 2, '-o', tmp_path / 'v.json', '-o',
              tmp_path / 'v.csv', '-o', tmp_path / 'v.svg', '--within', 1e9, '--above', 1).stdout
    lines = out.splitlines()
    assert 'pixels of three sides compared, 400 splats' in lines[0] and 'voxels' in lines[1]
    report = json.loads((tmp_path / 'v.json').read_text())
    assert report['subject'] == 'volume'
    settings = report['settings']
    sizes = [setting['voxel_size'] for setting in settings]
    assert [size / sizes[-1] for size in sizes] == pytest.approx([8, 6, 4, 3, 2, 1.5, 1])
    assert settings[-1]['psnr'] is None and settings[-1]['largest_error'] == 0, 'the finest judges itself'
    errors = [setting['psnr'] for setting in settings[:-1]]
    assert errors[0] < errors[2] < errors[-1] and errors[0] > 5
    assert settings[0]['voxels'] < settings[-1]['voxels']
    assert f'best within 1e+09 ms: {settings[-1]["name"]}' in lines
    rows = list(csv.DictReader((tmp_path / 'v.csv').open()))
    assert [row['setting'] for row in rows] == [setting['name'] for setting in settings]
    assert 'milliseconds of a volume' in (tmp_path / 'v.svg').read_text()


def test_what_is_measured_needs_what_it_needs(view, tmp_path):
    splats, camera = view
    out = ('-o', tmp_path / 'r.json')
    assert '--camera is needed' in error('accuracy', splats, *out)
    assert 'splats or --fit REPORT is needed' in error('accuracy', '--resolution', 9, *out)
    assert '--camera measures a view' in error('accuracy', splats, '--camera', camera, '--resolution', 9, *out)
    assert 'takes no splats' in error('accuracy', splats, '--fit', camera, *out)
    assert 'is not the report of a fit' in error('accuracy', '--fit', camera, *out)
    assert '--resolution is 0; 1 to 65536' in error('accuracy', splats, '--resolution', 0, *out)
    assert 'repetitions is 0; 1 to 1000' in error('accuracy', splats, '--resolution', 9, '--repetitions', 0, *out)
    assert 'no voxel size fills this volume within' in error('accuracy', splats, '--resolution', 9, '--within', 1e-9,
                                                             *out)


@pytest.mark.parametrize('options, text', [
    (('--samples', 0), 'samples_per_side is 0; 1 to 16 is allowed'),
    (('--degree', 5), 'sh_degree_limit is 5; 0 to 4 is allowed'),
    (('--min-alpha', 1.5), 'min_alpha is 1.5; a number above 0 and below 1 is allowed'),
    (('--share', 0), 'budget_share is 0; a number above 0 and up to 1 is allowed'),
    (('--accuracy', 'reference', '--precision', 'float'), 'level is reference with a knob below it'),
    (('--samples', 4, '--antialiasing', 'mip'), 'samples_per_side is 4 without antialiasing by samples'),
])
def test_bad_knobs_are_one_line(view, tmp_path, options, text):
    splats, camera = view
    assert text in error('render', splats, '--camera', camera, '-o', tmp_path / 'out.png', *options)
    assert not (tmp_path / 'out.png').exists()


def test_an_unknown_level_names_those_there_are(view, tmp_path):
    splats, camera = view
    line = run('render', splats, '--camera', camera, '--accuracy', 'perfect', '-o', tmp_path / 'a.png', status=2).stderr
    assert 'perfect' in line and 'draft' in line and 'reference' in line


def test_a_choice_that_nothing_meets_says_what_is_needed(view, tmp_path):
    splats, camera = view
    arguments = ('accuracy', splats, '--camera', camera, '--width', 16, '--height', 12, '--repetitions', 1, '-o',
                 tmp_path / 'r.json')
    assert 'the fastest, ' in error(*arguments, '--within', 1e-7)
    assert 'no extension of a report' in error(*arguments[:-1], tmp_path / 'r.txt')
    assert not (tmp_path / 'r.txt').exists()
