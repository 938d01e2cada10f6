"""A training of "detail", and `stipple detail`, which uses what it has learned."""
import json
import os
import shutil
import signal
import subprocess
import time

import numpy as np
import pytest
from ball_collection import objects  # noqa: F401
from fit_dataset import TOOL, error, run

STEPS = 60


def config(out, **changes):
    detail = {'steps': STEPS, 'learning_rate': 3e-3, 'warm_up': 5, 'mean_decay': 0.9, 'least_splats': 32,
              'most_splats': 64, 'views': 3, 'seen': 2, 'heads': 2, 'head_width': 8, 'blocks': 1, 'patch': 16,
              'fit_steps': 40, 'fit_splats': 300, **changes.pop('detail', {})}
    return {'collection': 'objects', 'out': out, 'held_out': 3, 'measure_interval': 20, 'measured_objects': 2,
            'checkpoint_interval': 10, 'points': 64, 'detail': detail, **changes}


@pytest.fixture(scope='module')
def trained(objects, tmp_path_factory):  # noqa: F811
    """(folder with the collection and "result", what the training said)."""
    folder = tmp_path_factory.mktemp('detail')
    shutil.copytree(objects, folder / 'objects')
    (folder / 'config.json').write_text(json.dumps(config('result')))
    seen = json.loads(run('train', folder / 'config.json', '--json').stdout)
    return folder, seen


def ball(trained):
    return sorted((trained[0] / 'objects/balls').iterdir())[2]  # held out


def coarse(trained):
    """A fitted ball, cut to 64 splats, where the object is."""
    path = trained[0] / 'coarse_64.ply'
    if not path.exists():
        run('fit', ball(trained), path, '--iterations', 60, '--gaussians', 64, '--start', 64, '--sh-degree', 0)
    return path


def moved(ply):
    """The same splats, a kilometre away."""
    start = ply.index(b'end_header\n') + len(b'end_header\n')
    width = ply[:start].count(b'property float')
    rows = np.frombuffer(ply[start:], '<f4').reshape(-1, width).copy()
    rows[:, 0] += 1000
    return ply[:start] + rows.tobytes()


def test_finer_splats_show_more_than_coarse_ones(trained):
    folder, seen = trained
    assert seen['steps'] == STEPS and seen['skipped_steps'] == 0
    assert seen['objects'] == 4 and seen['held_out_objects'] == 2
    assert seen['held_out_psnr_256_splats'] > seen['held_out_coarse_psnr_64_splats']
    report = json.loads((folder / 'result/report.json').read_text())
    assert [row['anchors'] for row in report['by_budget']] == [128, 256]
    assert report['by_budget'][1]['coarse_splats'] == 64
    assert report['measures'][-1]['step'] == STEPS
    assert report['settings']['detail.steps'] == STEPS and 'parts.0.stage' not in report['settings']
    loss = report['by_step']['loss']
    assert sum(loss[-15:]) < sum(loss[:15])
    names = sorted(path.name for path in (folder / 'result').iterdir())
    assert names == ['detail.safetensors', 'fits_40_300_1', 'report.json', 'report.svg']


def test_goes_on_bit_for_bit_from_where_it_was_stopped(trained):
    folder = trained[0]
    shutil.copytree(folder / 'result/fits_40_300_1', folder / 'stopped/fits_40_300_1')
    path = folder / 'stopped.json'
    path.write_text(json.dumps(config('stopped')))
    checkpoint = folder / 'stopped/checkpoint.stipple.safetensors'
    process = subprocess.Popen([TOOL, 'train', path], stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 60
    while not checkpoint.exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    assert process.wait(60) == 128 + signal.SIGINT
    process.stderr.close()
    other = folder / 'other.json'
    other.write_text(json.dumps(config('stopped', detail={'least_finer': 0.5})))
    assert "'detail.least_finer' is 0.5, the checkpoint has 0.25" in error('train', other, '--resume')
    run('train', path, '--resume')
    whole, stopped = ((folder / name / 'detail.safetensors').read_bytes() for name in ('result', 'stopped'))
    assert whole == stopped
    assert not checkpoint.exists()


def test_an_object_brings_its_own_coarse_splats(trained, tmp_path):
    """coarse.ply is taken in the place of a fit, and moved with its object."""
    shutil.copytree(trained[0] / 'objects', tmp_path / 'objects')
    for folder in (tmp_path / 'objects/balls').iterdir():
        run('fit', folder, folder / 'coarse.ply', '--iterations', 20, '--gaussians', 80, '--sh-degree', 0)
    (tmp_path / 'config.json').write_text(json.dumps(config('result', detail={'steps': 8})))
    seen = json.loads(run('train', tmp_path / 'config.json', '--json').stdout)
    assert sorted(path.name for path in (tmp_path / 'result').iterdir()) == ['detail.safetensors', 'report.json',
                                                                           'report.svg']
    # In another place than its images it would show next to nothing.
    assert seen['held_out_coarse_psnr_64_splats'] > 12
    (tmp_path / 'objects/balls' / ball(trained).name / 'coarse.ply').write_bytes(b'ply\nnothing')
    assert 'coarse.ply' in error('train', tmp_path / 'config.json')


def test_adds_detail_to_splats_in_one_pass(trained, tmp_path):
    files = []
    for threads in (1, 2):
        files.append(tmp_path / f'{threads}.ply')
        seen = json.loads(run('--threads', threads, 'detail', coarse(trained), ball(trained), files[-1], '--weights',
                              trained[0] / 'result/detail.safetensors', '--json').stdout)
    assert seen['gaussians'] == 4 * seen['gaussians_before']
    assert files[0].read_bytes() == files[1].read_bytes()
    before = seen['gaussians_before']
    out = tmp_path / 'some.ply'
    seen = json.loads(run('detail', coarse(trained), ball(trained), out, '--weights',
                          trained[0] / 'result/detail.safetensors', '--splats', before + 31, '--views', 2,
                          '--json').stdout)
    assert seen['gaussians'] == before + 30  # ten became four each
    assert json.loads(run('info', out, '--json').stdout)['count'] == before + 30


@pytest.mark.parametrize('changes, text', [
    ({'splats': 'missing.ply'}, 'missing.ply'),
    ({'dataset': 'missing'}, 'missing'),
    ({'out': 'out.txt'}, 'out.txt'),
    ({'weights': 'missing.safetensors'}, 'missing.safetensors'),
    ({'weights': '{splats}'}, 'coarse_64.ply'),
    ({'weights': '{broken}'}, 'broken.safetensors'),
    ({'more': ('--splats', 1)}, 'the number of splats is 1; of 64 splats this network makes 67 to 256'),
    ({'more': ('--views', 65)}, 'the number of views is 65; 0 to 64 is allowed'),
    ({'splats': '{far}'}, 'shows any of the splats'),
])
def test_one_line_says_what_is_wrong(trained, tmp_path, changes, text):
    folder = trained[0]
    weights = folder / 'result/detail.safetensors'
    broken = folder / 'broken.safetensors'
    broken.write_bytes(weights.read_bytes()[:5000])
    far = folder / 'far.ply'
    far.write_bytes(moved(coarse(trained).read_bytes()))
    names = {'splats': coarse(trained), 'broken': broken, 'far': far}
    given = {'splats': '{splats}', 'dataset': str(ball(trained)), 'out': 'out.ply', 'weights': str(weights), **changes}
    filled = {key: value.format(**names) if isinstance(value, str) else value for key, value in given.items()}
    filled['out'] = str(tmp_path / filled['out'])
    assert text in error('detail', filled['splats'], filled['dataset'], filled['out'], '--weights', filled['weights'],
                         *given.get('more', ()))
    assert not os.listdir(tmp_path)


@pytest.mark.parametrize('changes, message', [
    ({'parts': [{'stage': 'joint'}]}, '"detail" and "parts" are both given'),
    ({'flow': {'steps': 1}}, '"detail" and "flow" are both given'),
    ({'detail': {'step': 1}}, "'detail.step' is not known; 'detail.steps' is the nearest that is"),
    ({'detail': {'steps': 0}}, "'detail.steps' is 0; 1 or more is allowed"),
    ({'detail': {'children': 3}}, 'the number of children of a splat is 3; 1, 2, 4 or 8 is allowed'),
    ({'detail': {'least_splats': 99}}, 'the largest number of coarse splats is 64; 99 to'),
])
def test_what_cannot_be_trained_is_refused(trained, tmp_path, changes, message):
    (tmp_path / 'objects').symlink_to(trained[0] / 'objects')
    (tmp_path / 'config.json').write_text(json.dumps(config('result', **changes)))
    assert message in error('train', tmp_path / 'config.json')
    assert not (tmp_path / 'result').exists()


def test_weights_of_detail_are_no_autoencoder(trained, tmp_path):
    weights = trained[0] / 'result/detail.safetensors'
    assert 'holds a network that adds detail' in error('encode', weights, ball(trained),
                                                      tmp_path / 'out.stipple.safetensors')
    (tmp_path / 'config.json').write_text(json.dumps({'collection': str(trained[0] / 'objects'), 'out': 'result',
                                                      'start': str(weights), 'flow': {'steps': 999}}))
    assert 'holds a network that adds detail' in error('train', tmp_path / 'config.json')
