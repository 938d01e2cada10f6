"""`stipple train`: from a collection of objects to the weights of networks, stopped, resumed, refused."""
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from ball_collection import config, objects, write_ball, write_png  # noqa: F401
from fit_dataset import TOOL, error, run

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import pipeline_weights  # noqa: E402


@pytest.fixture
def given(objects, tmp_path):
    """Writes a config beside the collection, and returns its path."""
    (tmp_path / 'objects').symlink_to(objects)

    def write(name='config.json', **changes):
        path = tmp_path / name
        path.write_text(json.dumps(config(**changes)))
        return path

    return write


def stopped_after_a_checkpoint(config, checkpoint, number):
    """A training that a signal ended when it had written a checkpoint: (exit status, what it said)."""
    process = subprocess.Popen([TOOL, 'train', config], stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 60
    while not checkpoint.exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(number)
    return process.wait(60), process.stderr.read()


def parts(**steps):
    """Those of config(), each with as many steps as are given for its stage; others are left out."""
    return [dict(part, steps=steps[part['stage']]) for part in config()['parts'] if part['stage'] in steps]


def test_learns_objects_that_it_has_never_seen(given, tmp_path):
    seen = json.loads(run('train', given(), '--json').stdout)
    assert seen['steps'] == 560 and seen['skipped_steps'] == 0
    assert seen['objects'] == 4 and seen['held_out_objects'] == 2
    # After the first 40 steps with images it has 13.7 dB, in the end 16.5: four balls say little of other tints.
    assert seen['held_out_psnr_128_anchors'] > 15.5
    assert seen['held_out_psnr_8_anchors'] < seen['held_out_psnr_128_anchors']
    folder = tmp_path / 'result'
    assert sorted(path.name for path in folder.iterdir()) == ['report.json', 'report.svg', 'weights.safetensors']
    report = json.loads((folder / 'report.json').read_text())
    assert [row['anchors'] for row in report['by_budget']] == [8, 16, 32, 64, 128]
    structure = report['by_step']['structure']
    assert sum(structure[50:60]) < 0.75 * sum(structure[:10])
    assert report['measures'][-1]['psnr'] > report['measures'][0]['psnr'] + 1.5
    # Of the balls that it learns from it knows more; and these choose what is kept.
    assert report['by_budget'][-1]['training_psnr'] > 18
    best = max(report['measures'], key=lambda row: row['training_psnr'])
    assert report['best_step'] == best['step']
    assert report['settings']['parts.1.steps'] == 480 and report['settings']['network.follows_spacing'] == 1
    assert '<svg' in (folder / 'report.svg').read_text()[:300]


def test_goes_on_bit_for_bit_from_where_it_was_stopped(given, tmp_path):
    short = dict(parts=parts(structure=40, attributes=160), checkpoint_interval=30)
    run('train', given('whole.json', out='whole', **short))
    stopped = given('stopped.json', out='stopped', **short)
    checkpoint = tmp_path / 'stopped/checkpoint.stipple.safetensors'
    status, said = stopped_after_a_checkpoint(stopped, checkpoint, signal.SIGINT)
    assert status == 128 + signal.SIGINT
    assert f"'stipple train {stopped} --resume' goes on" in said
    assert not (tmp_path / 'stopped/weights.safetensors').exists()
    assert 'left from a training that was stopped' in error('train', stopped)
    run('train', stopped, '--resume')
    same = [(tmp_path / folder / 'weights.safetensors').read_bytes() for folder in ('whole', 'stopped')]
    assert same[0] == same[1]
    first, second = (json.loads((tmp_path / folder / 'report.json').read_text()) for folder in ('whole', 'stopped'))
    assert first['by_step']['loss'] == second['by_step']['loss']
    assert first['measures'] == second['measures'] and first['by_budget'] == second['by_budget']
    assert not checkpoint.exists()


def test_a_killed_training_goes_on_from_its_last_checkpoint(given, tmp_path):
    short = dict(parts=parts(structure=40, attributes=160), checkpoint_interval=30)
    path = given(**short)
    checkpoint = tmp_path / 'result/checkpoint.stipple.safetensors'
    assert stopped_after_a_checkpoint(path, checkpoint, signal.SIGKILL)[0] == -signal.SIGKILL
    before = checkpoint.read_bytes()
    # Of another training, or of other objects, nothing is taken.
    other = given('other.json', seed=2, **short)
    assert "'seed' is 2, the checkpoint has 1" in error('train', other, '--resume')
    (tmp_path / 'fewer').mkdir()
    for ball in sorted((tmp_path / 'objects/balls').iterdir())[:5]:
        shutil.copytree(ball, tmp_path / 'fewer/balls' / ball.name)
    assert 'other objects' in error('train', given('fewer.json', collection='fewer', **short), '--resume')
    assert checkpoint.read_bytes() == before
    run('train', path, '--resume')
    assert (tmp_path / 'result/weights.safetensors').exists()


def test_products_in_bfloat16_learn_about_as_much(given, tmp_path, monkeypatch):
    path = given(precision='bfloat16')
    monkeypatch.setenv('STIPPLE_MATRIX_BACKEND', 'highway')
    assert 'in bfloat16 are asked for and not to be had here, because STIPPLE_MATRIX_BACKEND' in error('train', path)
    assert not (tmp_path / 'result').exists()
    monkeypatch.delenv('STIPPLE_MATRIX_BACKEND')
    process = subprocess.run([TOOL, 'train', path, '--json'], capture_output=True, text=True, timeout=300)
    if 'not to be had here' in process.stderr:
        pytest.skip(process.stderr.strip())
    assert process.returncode == 0, process.stderr
    seen = json.loads(process.stdout)
    # As test_learns_objects_that_it_has_never_seen() in float32, which gets 16.5 dB.
    assert seen['skipped_steps'] == 0 and seen['held_out_psnr_128_anchors'] > 15.5
    settings = json.loads((tmp_path / 'result/report.json').read_text())['settings']
    assert settings['precision'] == 'bfloat16' and settings['parts.1.loss_scale'] == 'dynamic'
    # What was learned is run in float32, as any other weights.
    monkeypatch.setenv('STIPPLE_MATRIX_BACKEND', 'highway')
    ball = sorted((tmp_path / 'objects/balls').iterdir())[0]
    run('encode', tmp_path / 'result/weights.safetensors', ball, tmp_path / 'ball.ply', '--anchors', '50')


@pytest.mark.parametrize('changes, message', [
    ({'sed': 1}, "'sed' is not known; 'seed' is the nearest that is"),
    ({'network': {'head': 2}}, "'network.head' is not known; 'network.heads' is the nearest that is"),
    ({'parts': [{'stage': 'joint', 'learningrate': 1}]},
     "'parts.0.learningrate' is not known; 'parts.0.learning_rate' is the nearest that is"),
    ({'xyzzy': 1}, "'xyzzy' is not known"),
    ({'seed': 'one'}, "'seed' is 'one'; a number is needed"),
    ({'collection': 7}, "'collection' is a number; a text is needed"),
    ({'points': 1.5}, "'points' is 1.5; a whole number"),
    ({'points': 0}, 'the number of points of an object is 0; 1 to 16384 is allowed'),
    ({'held_out': 1}, "'held_out' is 1"),
    ({'measure_interval': 0}, "'measure_interval' is 0; 1 or more is allowed"),
    ({'network': {'gaussians': 2}}, 'the number of Gaussians of an anchor is 2; 4 to 32 is allowed'),
    ({'network': {'head_width': 18}}, 'the width of a head is 18; a multiple of 4 is needed'),
    ({'parts': [{'stage': 'splats'}]}, "'parts.0.stage' is 'splats'; structure, attributes or joint is allowed"),
    ({'parts': [{'stage': 'joint', 'batch': 0}]}, 'part 0: the number of objects in a step is 0'),
    ({'precision': 'float16'}, "'precision' is 'float16'; float32 or bfloat16 is allowed"),
    ({'parts': [{'loss_scale': 'static'}]}, "'parts.0.loss_scale' is 'static'; none or dynamic is allowed"),
    ({'parts': [{'loss_scale_start': 200}]}, 'part 0: the logarithm of the first scale of losses is 200'),
    ({'collection': 'nowhere'}, "nowhere' cannot be read"),
])
def test_what_cannot_be_trained_is_refused(given, changes, message):
    assert message in error('train', given(**changes))


def test_a_config_that_is_none_is_refused(given, tmp_path):
    path = tmp_path / 'bad.json'
    path.write_text('{"seed": 1')
    assert str(path) in error('train', path)
    path.write_text('[1]')
    assert 'a JSON object is expected' in error('train', path)
    path.write_text('{}')
    assert '"collection", the folder of objects, is missing' in error('train', path)
    assert 'nothing.json' in error('train', tmp_path / 'nothing.json')


def test_nothing_of_another_kind_is_written_over(given, tmp_path):
    path = given()
    (tmp_path / 'result').mkdir()
    for name in ('weights.safetensors', 'report.json'):
        (tmp_path / 'result' / name).write_text('mine')
        assert name in error('train', path)
        assert (tmp_path / 'result' / name).read_text() == 'mine'
        (tmp_path / 'result' / name).unlink()


def test_objects_that_teach_nothing_are_left_out_with_a_reason(given, tmp_path):
    folder = tmp_path / 'mixed'
    for name in ('good', 'empty', 'opaque', 'flat', 'lost', 'torn'):
        write_ball(folder / name, (0.9, 0.3, 0.2), views=4)
    for i in range(4):
        write_png(folder / f'empty/images/{i:04}.png', np.zeros((32, 32, 4), np.uint8))
        write_png(folder / f'opaque/images/{i:04}.png', np.full((32, 32, 4), 255, np.uint8))
    (folder / 'flat/points.ply').write_text('ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n'
                                            'property float y\nproperty float z\nend_header\n0 0 0\n')
    (folder / 'lost/points.ply').unlink()
    (folder / 'torn/transforms.json').write_text('{"frames": [')
    path = given(collection='mixed', parts=parts(structure=20))
    notes = run('train', path).stderr
    for name, reason in (('empty', 'all of its 4 images are empty'), ('opaque', 'has no alpha'),
                         ('flat', 'no extent'), ('lost', 'points.ply'), ('torn', 'transforms.json')):
        line = next(line for line in notes.splitlines() if f"Object '{name}' is left out" in line)
        assert reason in line, line
    assert 'too few to hold any out' in notes
    shutil.rmtree(folder / 'good')
    assert 'has no object that can be learned from' in error('train', given(collection='mixed', out='none'))
    (tmp_path / 'void').mkdir()
    assert 'no folder in it has a transforms.json' in error('train', given(collection='void', out='none'))


def test_a_full_disk_loses_no_checkpoint(given, tmp_path):
    """What cannot be written is a note while it runs."""
    path = given(parts=parts(structure=40), checkpoint_interval=10)
    limit = 'ulimit -f 20; trap "" XFSZ; exec "$0" "$@"'  # 20 KiB a file: a checkpoint has more
    result = subprocess.run(['bash', '-c', limit, str(TOOL), 'train', str(path)], capture_output=True, text=True,
                            timeout=120)
    assert result.returncode == 1
    assert 'A checkpoint could not be written' in result.stderr
    assert result.stderr.count('A checkpoint could not be written') == 1
    assert 'weights.safetensors' in result.stderr.splitlines()[-1]
    assert not any(name.startswith('weights') for name in os.listdir(tmp_path / 'result'))


def test_an_unseen_object_decodes_at_any_budget_where_it_was(given, tmp_path):
    run('train', given())
    weights = tmp_path / 'result/weights.safetensors'
    model, splats = tmp_path / 'ball.stipple.safetensors', tmp_path / 'ball.ply'
    ball = tmp_path / 'objects/balls/5'  # of 0.2 times the size, around (5, -2, 1), held out
    run('encode', weights, ball, model)
    info = json.loads(run('--weights', weights.parent, 'info', model, '--json').stdout)
    assert info['least_anchors'] == 32
    for anchors in (40, 120):
        run('--weights', weights.parent, 'decode', model, splats, '--anchors', anchors)
        seen = json.loads(run('info', splats, '--json').stdout)
        assert seen['count'] == 4 * anchors
        for axis, middle in enumerate((5, -1, -2)):  # as files have it: x right, y down, z forward
            assert seen['bounds_min'][axis] == pytest.approx(middle - 0.08, abs=0.03)
            assert seen['bounds_max'][axis] == pytest.approx(middle + 0.08, abs=0.03)
    # Points alone are enough, and give the same.
    run('encode', weights, ball / 'points.ply', tmp_path / 'points.ply', '--anchors', 120)
    assert (tmp_path / 'points.ply').read_bytes() == splats.read_bytes()
    # Against an image that was never learned from.
    drawn, upright = tmp_path / 'view.png', tmp_path / 'upright.ply'
    run('convert', splats, upright, '--frame', 'RFU')
    run('render', upright, '--camera', ball / 'transforms.json', '--view', 0, '--colour', 'display', '-o', drawn)
    compared = json.loads(run('compare', drawn, ball / 'images/0000.png', '--json').stdout)
    assert compared['psnr'] > 13
    assert 'was not written by a training' in error('encode', model, ball, splats)
    assert '1 to 400, the number of points' in error('encode', weights, ball, splats, '--tokens', 401)
    assert "'ball.txt' is neither splats nor a model" in error('encode', weights, ball, 'ball.txt')
    (tmp_path / 'grey.ply').write_text('ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n'
                                       'property float z\nend_header\n0 0 0\n')
    assert 'no extent' in error('encode', weights, tmp_path / 'grey.ply', splats)


FLOW = {'steps': 120, 'batch': 4, 'warm_up': 10, 'learning_rate': 2e-3, 'mean_decay': 0.97, 'heads': 2,
        'head_width': 16, 'blocks': 2, 'noise_refiners': 1, 'context_refiners': 1, 'rotary_width': 8, 'canvas': 32,
        'patch': 8}


def test_an_image_becomes_splats_by_networks_of_ones_own(given, tmp_path):
    folder, view = tmp_path / 'result', tmp_path / 'objects/balls/5/images/0001.png'
    run('train', given(parts=parts(structure=60, attributes=300), flow=FLOW))
    report = json.loads((folder / 'report.json').read_text())
    loss = [value for value, part in zip(report['by_step']['loss'], report['by_step']['part']) if part == 2]
    assert report['parts'] == ['structure', 'attributes', 'flow'] and len(loss) == 120
    assert sum(loss[-20:]) < 0.8 * sum(loss[:20])
    splats, again, other = (tmp_path / f'{name}.ply' for name in ('splats', 'again', 'other'))
    seen = json.loads(run('generate', view, splats, '--weights', folder, '--steps', 10, '--json').stdout)
    assert seen['gaussians'] == 4 * 128  # of the largest budget that was learned
    run('generate', view, again, '--weights', folder, '--steps', 10)
    run('generate', view, other, '--weights', folder, '--steps', 10, '--seed', 7)
    assert splats.read_bytes() == again.read_bytes() != other.read_bytes()
    # Without an image, the seed alone tells what comes.
    first, second = tmp_path / 'first.ply', tmp_path / 'second.ply'
    for path, seed in ((first, 1), (second, 2)):
        run('random', path, '--weights', folder, '--steps', 10, '--seed', seed)
    assert first.read_bytes() != second.read_bytes()
    # A metre tall or wide, upright on the origin, as those of the published networks.
    info = json.loads(run('info', splats, '--json').stdout)
    sides = [high - low for low, high in zip(info['bounds_min'], info['bounds_max'])]
    assert 0.6 < max(sides) < 1.2  # Splats of networks that have hardly learned stand out from the surface.
    check = run('generate', view, splats, '--weights', folder, '--check', '--steps', 1).stdout
    assert check.count('trained by stipple') == 2 and check.count('not needed') == 2
    # The decoder of another training does not fit, and says so.
    run('train', given('other.json', out='second', seed=3, parts=parts(structure=20)))
    shutil.copy(tmp_path / 'second/weights.safetensors', folder / 'weights.safetensors')
    assert 'are of different trainings' in error('generate', view, splats, '--weights', folder)


def test_weights_of_half_the_size_make_the_same_splats(given, tmp_path):
    run('train', given(parts=parts(structure=30, attributes=60), flow=dict(FLOW, steps=20)))
    large, small = tmp_path / 'result', tmp_path / 'small'
    small.mkdir()
    for name in ('weights.safetensors', 'flow.safetensors'):
        run('shrink', large / name, small / name)
        # The header, names and shapes, keeps its size.
        assert (small / name).stat().st_size < 0.62 * (large / name).stat().st_size
    places = []
    for folder in (large, small):
        run('random', tmp_path / 'made.ply', '--weights', folder, '--steps', 4, '--anchors', 40)
        info = json.loads(run('info', tmp_path / 'made.ply', '--json').stdout)
        places.append(info['bounds_min'] + info['bounds_max'])
    assert places[0] == pytest.approx(places[1], abs=0.02)
    ball = tmp_path / 'objects/balls/5'
    assert 'points.ply' in error('shrink', ball / 'points.ply', small / 'weights.safetensors')
    assert 'points.ply' in error('shrink', large / 'weights.safetensors', ball / 'points.ply')
    assert (small / 'weights.safetensors').exists() and (ball / 'points.ply').stat().st_size > 1000


def test_a_flow_goes_on_bit_for_bit(given, tmp_path):
    short = dict(parts=parts(structure=20), flow=dict(FLOW, steps=400), checkpoint_interval=30)
    run('train', given('whole.json', out='whole', **short))
    path = given('stopped.json', out='stopped', **short)
    checkpoint = tmp_path / 'stopped/checkpoint.stipple.safetensors'
    assert stopped_after_a_checkpoint(path, checkpoint, signal.SIGTERM)[0] == 128 + signal.SIGTERM
    run('train', path, '--resume')
    for name in ('weights.safetensors', 'flow.safetensors'):
        assert (tmp_path / 'whole' / name).read_bytes() == (tmp_path / 'stopped' / name).read_bytes()


@pytest.mark.parametrize('changes, message', [
    ({'canvas': 100}, '"flow": '), ({'patch': 5}, 'the side of a patch is 5 pixels'),
    ({'batch': 0}, 'the number of objects in a step of the flow is 0'),
    ({'head_width': 7}, 'the width of a head of the flow is 7'),
    ({'step': 1}, "'flow.step' is not known; 'flow.steps' is the nearest that is")])
def test_a_flow_that_cannot_be_trained_is_refused(given, changes, message):
    assert message in error('train', given(flow={**FLOW, **changes}))


def test_a_flow_begins_with_networks_that_are_there(given, tmp_path):
    run('train', given('first.json', out='first', parts=parts(structure=30, attributes=120)))
    first = tmp_path / 'first/weights.safetensors'
    fields = {key: value for key, value in config(out='second', start='first/weights.safetensors', flow=FLOW).items()
              if key not in ('network', 'parts')}
    path = tmp_path / 'second.json'
    path.write_text(json.dumps(fields))
    seen = json.loads(run('train', path, '--json').stdout)
    assert seen['steps'] == 120
    report = json.loads((tmp_path / 'second/report.json').read_text())
    before = json.loads((tmp_path / 'first/report.json').read_text())
    # The autoencoder stays as it was.
    assert [row['psnr'] for row in report['by_budget']] == [row['psnr'] for row in before['by_budget']]
    run('generate', tmp_path / 'objects/balls/2/images/0000.png', tmp_path / 'x.ply', '--weights', tmp_path / 'second',
        '--steps', 4)
    # With parts, it is learned further.
    path.write_text(json.dumps({**fields, 'out': 'third', 'parts': parts(attributes=60), 'flow': {}}))
    seen = json.loads(run('train', path, '--json').stdout)
    assert seen['steps'] == 60 and seen['held_out_psnr_128_anchors'] > before['by_budget'][-1]['psnr'] - 0.5
    # So that a flow stays right, its latents may be kept, bit for bit; decoders are learned further all the same.
    kept = [dict(part, keeps_encoder=1) for part in parts(attributes=60)]
    path.write_text(json.dumps({**fields, 'out': 'kept', 'parts': kept, 'flow': {}}))
    run('train', path)
    latents, encoders = [], []
    for name in ('first', 'third', 'kept'):
        encoders.append(pipeline_weights.read(tmp_path / name / 'weights.safetensors'))
        run('encode', tmp_path / name / 'weights.safetensors', tmp_path / 'objects/balls/2', tmp_path / 'x.safetensors')
        latents.append(pipeline_weights.read(tmp_path / 'x.safetensors')['latent.tokens'])
    assert latents[0] == latents[2] != latents[1]
    changed = [name for name in encoders[0] if encoders[0][name] != encoders[2][name]]
    assert len(changed) > 20 and not [name for name in changed if name.startswith('encoder.')]
    # The flow of 'second' goes with the decoders that were learned from its latents, and with no others.
    for name in ('first', 'kept', 'third'):
        shutil.copy(tmp_path / 'second/flow.safetensors', tmp_path / name / 'flow.safetensors')
    run('shrink', tmp_path / 'kept/weights.safetensors', tmp_path / 'half.safetensors')
    (tmp_path / 'half.safetensors').replace(tmp_path / 'kept/weights.safetensors')
    for name in ('first', 'kept'):
        run('random', tmp_path / 'x.ply', '--weights', tmp_path / name, '--steps', 2)
    assert 'are of different trainings' in error('random', tmp_path / 'x.ply', '--weights', tmp_path / 'third')
    for changes, message in (({'flow': {}}, 'the flow alone is learned'),
                             ({'network': {'follows_spacing': 0}}, 'without "parts" nothing is learned'),
                             ({'parts': [dict(kept[0], weight_decay=0.1)]}, 'the weight decay is 0.1'),
                             ({'parts': [dict(kept[0], keeps_encoder=2)]}, "'parts.0.keeps_encoder' is 2"),
                             ({'network': {'heads': 2}}, '"network" and "start" are both given'),
                             ({'start': 'nothing.safetensors'}, 'nothing.safetensors'),
                             ({'start': 'objects/balls/0/points.ply'}, 'points.ply')):
        path.write_text(json.dumps({**fields, 'out': 'none', **changes}))
        assert message in error('train', path)
    assert first.exists()


def test_a_flow_is_learned_further(given, tmp_path):
    run('train', given('first.json', out='first', parts=parts(structure=30, attributes=60), flow=FLOW))
    run('train', given('other.json', out='other', parts=parts(structure=20), flow=dict(FLOW, steps=12)))
    fields = {key: value for key, value in config(out='second', start='first/weights.safetensors').items()
              if key not in ('network', 'parts')}
    further = {'steps': 60, 'batch': 4, 'warm_up': 5, 'learning_rate': 1e-3, 'mean_decay': 0.9,
               'start': 'first/flow.safetensors'}
    path = tmp_path / 'second.json'
    path.write_text(json.dumps({**fields, 'flow': further}))
    run('train', path)
    report = {name: json.loads((tmp_path / name / 'report.json').read_text()) for name in ('first', 'second')}
    loss = {name: [value for value, part in zip(of['by_step']['loss'], of['by_step']['part'])
                   if of['parts'][part] == 'flow'] for name, of in report.items()}
    # It goes on where the first one ended, not where that began.
    assert len(loss['second']) == 60
    assert sum(loss['second'][:20]) < 0.9 * sum(loss['first'][:20])
    first, second = (pipeline_weights.read(tmp_path / name / 'flow.safetensors') for name in ('first', 'second'))
    assert first.keys() == second.keys() and first != second
    run('generate', tmp_path / 'objects/balls/2/images/0000.png', tmp_path / 'x.ply', '--weights', tmp_path / 'second',
        '--steps', 4)
    without = {key: value for key, value in fields.items() if key != 'start'}
    kept = [dict(part, keeps_encoder=1) for part in parts(attributes=60)]
    for changes, message in (({'flow': {**further, 'heads': 2}}, '"flow" has sizes and "start"'),
                             ({'flow': {**further, 'steps': 0}, 'parts': kept}, 'but 0 steps'),
                             ({'flow': further, 'parts': parts(attributes=60)}, 'which all parts have to keep'),
                             ({'flow': {**further, 'start': 'other/flow.safetensors'}}, 'not learned of the latents'),
                             ({'flow': {**further, 'start': 'first/weights.safetensors'}}, 'is not of a flow'),
                             ({'flow': {**further, 'start': 'nothing.safetensors'}}, 'nothing.safetensors')):
        path.write_text(json.dumps({**fields, 'out': 'none', **changes}))
        assert message in error('train', path), message
    path.write_text(json.dumps({**without, 'out': 'none', 'flow': further}))
    assert 'which all parts have to keep' in error('train', path)
