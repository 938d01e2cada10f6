"""`stipple fit`: from pictures to splats and models, stopped, killed and resumed."""
import json
import signal
import subprocess
import time

import pytest
from fit_dataset import TOOL, dataset, error, figures, run  # noqa: F401

FEW = ('--iterations', 60, '--gaussians', 300, '--sh-degree', 0)


def test_fits_splats_and_reports(dataset, tmp_path):
    result = run('fit', dataset, tmp_path / 'out.ply', *FEW, '--report', tmp_path / 'r.json')
    seen = figures(result.stdout)
    assert seen['iterations'] == '60'
    assert float(seen['held_out_psnr']) > 12  # 3 dB above pictures of nothing
    assert 0 < json.loads(run('info', tmp_path / 'out.ply', '--json').stdout)['count'] <= 300
    report = json.loads((tmp_path / 'r.json').read_text())
    assert report['settings']['max_splats'] == 300
    assert len(report['by_iteration']['loss']) == 60
    assert sorted(path.name for path in tmp_path.iterdir()) == ['out.ply', 'r.json', 'r.svg']


def test_a_model_decodes_at_any_budget(dataset, tmp_path):
    model = tmp_path / 'm.stipple.safetensors'
    run('fit', dataset, model, *FEW)
    run('decode', model, tmp_path / 'few.ply', '--anchors', 20)
    assert json.loads(run('info', tmp_path / 'few.ply', '--json').stdout)['count'] == 20
    run('fit', dataset, tmp_path / 'cut.ply', *FEW, '--budget', 30)
    assert json.loads(run('info', tmp_path / 'cut.ply', '--json').stdout)['count'] == 30


def test_lists_strategies_and_parts():
    lines = run('fit', '--strategies').stdout.splitlines()
    names = [line.split()[0] for line in lines if line.startswith('  ')]
    assert names[0] == 'adaptive'
    assert {'absolute', 'learned_density', 'long_axis_split'} <= set(names)
    assert lines.index('strategies') < lines.index('parts, after a strategy and +')
    assert all(len(line.split()) > 4 for line in lines if line.startswith('  '))


def test_memory_holds_the_count(dataset, tmp_path):
    steps = ('--iterations', 300, '--sh-degree', 0, '--strategy', 'adaptive(threshold=1e-9)')
    free, held = (int(figures(run('fit', dataset, tmp_path / f'{name}.ply', *steps, *more).stdout)['gaussians'])
                  for name, more in (('free', ()), ('held', ('--memory', 1))))
    # 12 pictures of 48 x 36 in half of it; a splat of degree 0 takes 978 bytes.
    assert held <= 2**20 / 978 < free


def test_a_field_decodes_at_any_budget(dataset, tmp_path):
    model = tmp_path / 'f.stipple.safetensors'
    few = ('--model', 'field', '--iterations', 40, '--anchors', 64, '--gaussians-per-anchor', 4)
    run('fit', dataset, model, *few, '--report', tmp_path / 'r.json')
    seen = json.loads(run('info', model, '--json').stdout)
    assert (seen['kind'], seen['most_anchors'], seen['gaussians_per_anchor']) == ('learned field', 64, 4)
    for anchors in (16, 200):
        run('decode', model, tmp_path / 'out.ply', '--anchors', anchors)
        assert json.loads(run('info', tmp_path / 'out.ply', '--json').stdout)['count'] == 4 * anchors
    report = json.loads((tmp_path / 'r.json').read_text())
    assert report['measures'][-1]['density_entropy'] > 0
    assert [row['budget'] for row in report['by_budget']] == [64]
    run('fit', dataset, tmp_path / 'small.ply', *few, '--budget', 20)
    assert json.loads(run('info', tmp_path / 'small.ply', '--json').stdout)['count'] == 80


def start(*arguments):
    return subprocess.Popen([TOOL, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def wait_for(path):
    deadline = time.monotonic() + 60
    while not path.exists() and time.monotonic() < deadline:
        time.sleep(0.001)
    assert path.exists()


def test_a_killed_fit_resumes_bit_for_bit(dataset, tmp_path):
    steps = ('--iterations', 300, '--gaussians', 300, '--sh-degree', 0)
    run('fit', dataset, tmp_path / 'whole.ply', *steps)
    out = tmp_path / 'out.ply'
    checkpoint = tmp_path / 'out.ply.checkpoint.safetensors'
    process = start('fit', dataset, out, *steps, '--checkpoint-every', 5)
    wait_for(checkpoint)
    process.kill()
    process.communicate(timeout=60)
    assert process.returncode == -signal.SIGKILL
    assert not out.exists()
    run('fit', dataset, out, *steps, '--resume')
    assert out.read_bytes() == (tmp_path / 'whole.ply').read_bytes()
    assert not checkpoint.exists()


def test_ctrl_c_keeps_the_best(dataset, tmp_path):
    out = tmp_path / 'out.ply'
    checkpoint = tmp_path / 'out.ply.checkpoint.safetensors'
    steps = ('--iterations', 100000, '--gaussians', 300, '--sh-degree', 0)
    process = start('fit', dataset, out, *steps, '--checkpoint-every', 5)
    wait_for(checkpoint)
    process.send_signal(signal.SIGINT)
    stdout, stderr = process.communicate(timeout=60)
    assert process.returncode == 0, stderr
    assert '--resume goes on' in stderr
    assert 5 <= int(figures(stdout)['iterations']) < 100000
    assert json.loads(run('info', out, '--json').stdout)['count'] > 0
    assert checkpoint.exists()
    before = checkpoint.read_bytes()
    assert 'go on with --resume' in error('fit', dataset, out, *steps)
    assert 'iterations was 100000; now it is 50' in error('fit', dataset, out, '--iterations', 50, '--gaussians', 300,
                                                          '--sh-degree', 0, '--resume')
    assert checkpoint.read_bytes() == before


@pytest.mark.parametrize('arguments, text', [
    (('missing', 'out.ply'), 'missing'),
    (('{dataset}', 'out.txt'), 'out.txt'),
    (('{dataset}', 'out.ply', '--resume'), 'out.ply.checkpoint.safetensors'),
    (('{dataset}', 'out.ply', '--strategy', 'best'), 'adaptive'),
    (('{dataset}', 'out.ply', '--anchors', 100), '--model field'),
    (('{dataset}', 'out.ply', '--model', 'field', '--gaussians', 100), '--model explicit'),
    (('{dataset}', 'out.ply', '--iterations', 0), '--iterations is 0'),
    (('{dataset}', 'out.ply', '--strategy', 'learned_density'), 'explicit splats do not have'),
    (('{dataset}', 'out.ply', '--model', 'field', '--strategy', 'adaptive'), 'there is learned_density'),
    (('{dataset}', 'out.ply', '--model', 'field', '--strategy', 'learned_density', '--no-density-gradient'), 'both'),
    (('{dataset}', 'out.ply', '--memory', 0.001), 'max_bytes is 1048'),
    (('{dataset}', 'out.ply', '--sh-degree', 5), 'sh_degree is 5'),
    (('{dataset}', 'out.ply', '--downscale', 0), 'downscale'),
])
def test_one_line_says_what_is_wrong(dataset, tmp_path, arguments, text):
    given = [str(a).replace('{dataset}', str(dataset)) for a in arguments]
    given[1] = str(tmp_path / given[1])
    assert text in error('fit', *given)
    assert list(tmp_path.iterdir()) == []
