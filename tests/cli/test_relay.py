"""Anchors at key frames of a long shot, from images with times to splats at a time and a budget."""
import json
import signal
import subprocess
import time

import pytest
from fit_dataset import TOOL, dataset, error, figures, run  # noqa: F401
from test_motion import moving  # noqa: F401

# Times 0 to 1 by 1/11 seconds: key frames at 1/11, 5/11 and 9/11.
FEW = ('--model', 'relay', '--iterations', 150, '--max-anchors', 120, '--gaussians-per-anchor', 4, '--sh-degree', 0,
       '--key-frame-spacing', 0.36)


@pytest.fixture(scope='module')
def model(moving, tmp_path_factory):  # noqa: F811
    path = tmp_path_factory.mktemp('model') / 'm.stipple.safetensors'
    report = path.with_name('r.json')
    seen = figures(run('fit', moving, path, *FEW, '--report', report).stdout)
    assert float(seen['held_out_psnr']) > 12  # 3 dB above images of nothing
    settings = json.loads(report.read_text())['settings']
    assert settings['model'] == 'relay' and settings['key_frame_spacing'] == 0.36
    assert sorted(p.name for p in path.parent.iterdir()) == ['m.stipple.safetensors', 'r.json', 'r.svg']
    return path


def header_of(path):
    data = path.read_bytes()
    return json.loads(data[8:8 + int.from_bytes(data[:8], 'little')])


def splats_of(path):
    return json.loads(run('info', path, '--json').stdout)['count']


def test_a_fit_is_a_model_with_times_and_budgets(model, tmp_path):
    info = json.loads(run('info', model, '--json').stdout)
    assert info['kind'] == 'key frames of anchors'
    clip = json.loads(header_of(model)['__metadata__']['clip'])
    assert (clip['frames'], clip['spacing'], clip['first_key']) == (12, 4, 1)  # one frame before them, two behind
    assert (info['time_begin'], info['time_end']) == (0, 1)
    for name, seconds, anchors in (('begin', 0, 60), ('again', -7, 60), ('middle', 0.5, 60), ('few', 0.5, 20)):
        run('decode', model, tmp_path / f'{name}.ply', '--time', seconds, '--anchors', anchors)
    files = {name: (tmp_path / f'{name}.ply').read_bytes() for name in ('begin', 'again', 'middle', 'few')}
    assert files['begin'] == files['again'] and len(set(files.values())) == 3
    assert 0 < splats_of(tmp_path / 'few.ply') < splats_of(tmp_path / 'middle.ply')
    assert 'is allowed' in error('decode', model, tmp_path / 'many.ply', '--anchors', 100000)


def test_a_killed_fit_goes_on_with_the_same_bits(moving, model, tmp_path):  # noqa: F811
    out = tmp_path / 'm.stipple.safetensors'
    checkpoint = tmp_path / 'm.stipple.safetensors.checkpoint.safetensors'
    command = [str(part) for part in (TOOL, 'fit', moving, out, *FEW, '--checkpoint-interval', 7)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    frames = tmp_path / (checkpoint.name + '.frames')
    deadline = time.monotonic() + 60
    while not (frames / 'key1.stage2.safetensors').exists() and process.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert checkpoint.exists() and not out.exists()
    run('fit', moving, out, *FEW, '--resume')
    assert not checkpoint.exists() and not frames.exists()
    for source, name in ((model, 'a'), (out, 'b')):
        run('decode', source, tmp_path / f'{name}.ply', '--time', 0.5)
    assert (tmp_path / 'a.ply').read_bytes() == (tmp_path / 'b.ply').read_bytes()


def test_key_frames_that_are_gone_are_named(moving, tmp_path):  # noqa: F811
    out = tmp_path / 'm.stipple.safetensors'
    command = [str(part) for part in (TOOL, 'fit', moving, out, *FEW, '--checkpoint-interval', 7)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    frames = tmp_path / 'm.stipple.safetensors.checkpoint.safetensors.frames'
    deadline = time.monotonic() + 60
    while not (frames / 'key0.stage3.safetensors').exists() and process.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    process.wait()
    for file in frames.iterdir():
        file.unlink()
    assert 'is not there' in error('fit', moving, out, *FEW, '--resume')


@pytest.mark.parametrize('blend', ('linear', 'none', 'plateau'))
def test_other_ways_to_share_a_time(moving, blend, tmp_path):  # noqa: F811
    out = tmp_path / 'm.stipple.safetensors'
    run('fit', moving, out, *FEW, '--key-frame-blend', blend, '--no-growth-by-level')
    run('render', out, '--camera', moving / 'transforms.json', '--view', 0, '--time', 0.4, '-o', tmp_path / 'x.png')


def test_a_clip_shorter_than_one_spacing_has_one_key_frame(moving, tmp_path):  # noqa: F811
    out = tmp_path / 'm.stipple.safetensors'
    run('fit', moving, out, *FEW[:-1], 5)
    assert b'"key.0.' in out.read_bytes() and b'"key.1.' not in out.read_bytes()


def test_levels_of_growth_are_in_order(moving, tmp_path):  # noqa: F811
    out = tmp_path / 'm.stipple.safetensors'
    run('fit', moving, out, *FEW, '--middle-level-rank', 0.2, '--high-level-rank', 0.9, '--high-level-weight', 0)
    message = error('fit', moving, tmp_path / 'x.stipple.safetensors', *FEW, '--middle-level-rank', 0.9)
    assert 'ranks of 0.9 and 0.8' in message and 'the lower one first' in message
    assert not (tmp_path / 'x.stipple.safetensors').exists()


def test_it_refuses_views_of_one_time_and_what_does_not_concern_it(dataset, moving, tmp_path):  # noqa: F811
    assert 'times' in error('fit', dataset, tmp_path / 'x.stipple.safetensors', *FEW)
    assert 'have none' in error('fit', moving, tmp_path / 'x.stipple.safetensors', *FEW, '--strategy', 'temporal')
