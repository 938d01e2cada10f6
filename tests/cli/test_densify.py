"""`stipple densify`: more splats where pictures ask for them, without a fit."""
import json

import pytest
from fit_dataset import dataset, error, figures, help_of, run  # noqa: F401


@pytest.fixture(scope='module')
def coarse(dataset, tmp_path_factory):  # noqa: F811
    """Fewer splats than the pictures show."""
    path = tmp_path_factory.mktemp('coarse') / 'coarse.ply'
    run('fit', dataset, path, '--iterations', 40, '--gaussians', 40, '--sh-degree', 0)
    return path


def count(path):
    return json.loads(run('info', path, '--json').stdout)['count']


def test_adds_splats_up_to_the_cap(dataset, coarse, tmp_path):  # noqa: F811
    out = tmp_path / 'out.ply'
    before = count(coarse)
    seen = figures(run('densify', coarse, out, '--dataset', dataset, '--strategy', 'adaptive(threshold=1e-7)',
                       '--max-splats', before + 7, '--events', 2).stdout)
    assert int(seen['gaussians_before']) == before
    assert int(seen['gaussians']) == count(out) == before + 7


def test_flags_are_understood_by_what_they_were_called(dataset, coarse, tmp_path):  # noqa: F811
    for name, cap, memory in (('former', '--gaussians', '--picture-memory'),
                              ('present', '--max-splats', '--image-memory')):
        run('densify', coarse, tmp_path / f'{name}.ply', '--dataset', dataset, '--strategy', 'adaptive(threshold=1e-7)',
            cap, count(coarse) + 5, memory, 1)
    assert (tmp_path / 'former.ply').read_bytes() == (tmp_path / 'present.ply').read_bytes()
    assert '--max-splats,--gaussians' in help_of('densify')


def test_the_same_command_gives_the_same_file(dataset, coarse, tmp_path):  # noqa: F811
    files = []
    for threads in (1, 2):
        files.append(tmp_path / f'{threads}.ply')
        run('--threads', threads, 'densify', coarse, files[-1], '--dataset', dataset, '--events', 3, '--seed', 4)
    assert files[0].read_bytes() == files[1].read_bytes()


@pytest.mark.parametrize('arguments, text', [
    (('missing.ply', 'out.ply', '--dataset', '{dataset}'), 'missing.ply'),
    (('{coarse}', 'out.txt', '--dataset', '{dataset}'), 'out.txt'),
    (('{coarse}', 'out.ply', '--dataset', 'missing'), 'missing'),
    (('{coarse}', 'out.ply', '--dataset', '{dataset}', '--strategy', 'best'), "strategy is 'best'; there is adaptive"),
    (('{coarse}', 'out.ply', '--dataset', '{dataset}', '--events', 0), '--events is 0'),
    (('{coarse}', 'out.ply', '--dataset', '{dataset}', '--max-splats', 1), 'at most 1 splats are asked for'),
])
def test_one_line_says_what_is_wrong(dataset, coarse, tmp_path, arguments, text):  # noqa: F811
    given = [str(a).replace('{dataset}', str(dataset)).replace('{coarse}', str(coarse)) for a in arguments]
    given[1] = str(tmp_path / given[1])
    assert text in error('densify', *given)
    assert list(tmp_path.iterdir()) == []
