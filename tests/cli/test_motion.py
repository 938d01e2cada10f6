"""Splats that move, from images with times to splats at a time."""
import json
import math
import subprocess
import time

import pytest
from fit_dataset import TOOL, dataset, error, figures, run  # noqa: F401

FEW = ('--model', 'motion', '--iterations', 150, '--gaussians', 300, '--sh-degree', 0)


@pytest.fixture(scope='module')
def moving(dataset, tmp_path_factory):  # noqa: F811
    """The same object, which goes up and down while the images are taken, one at each time: a camera that is lower by
    as much sees the same image."""
    folder = tmp_path_factory.mktemp('moving')
    scene = json.loads((dataset / 'transforms.json').read_text())
    distance = math.dist(*[[row[3] for row in scene['frames'][i]['transform_matrix'][:3]] for i in (0, 6)]) / 2
    for i, frame in enumerate(scene['frames']):
        frame['time'] = i / 11
        frame['transform_matrix'][1][3] -= 0.1 * distance * math.sin(math.tau * i / 11)
    (folder / 'lower.json').write_text(json.dumps(scene))
    (folder / 'images').mkdir()
    for i, frame in enumerate(scene['frames']):
        run('render', dataset / 'truth.ply', '--camera', folder / 'lower.json', '--view', i, '--colour', 'display', '-o',
            folder / 'images' / f'{i:02}.png')
        frame['transform_matrix'][1][3] += 0.1 * distance * math.sin(math.tau * i / 11)
    (folder / 'transforms.json').write_text(json.dumps(scene))
    return folder


@pytest.fixture(scope='module')
def model(moving, tmp_path_factory):
    path = tmp_path_factory.mktemp('model') / 'm.stipple.safetensors'
    report = path.with_name('r.json')
    seen = figures(run('fit', moving, path, *FEW, '--report', report).stdout)
    assert float(seen['held_out_psnr']) > 12  # 3 dB above images of nothing
    report = json.loads(report.read_text())
    assert report['model'] == 'motion'
    assert report['settings']['model'] == 'motion'
    assert report['strategy']
    return path


def test_a_fit_of_moving_splats_is_a_model_with_times(model):
    info = json.loads(run('info', model, '--json').stdout)
    assert info['kind'] == 'moving splats'
    assert 0 < info['count'] <= 300
    assert (info['time_begin'], info['time_end']) == (0, 1)


def splats_of(path):
    return json.loads(run('info', path, '--json').stdout)['count']


def test_it_decodes_at_any_time(model, tmp_path):
    count = splats_of(model)
    for name, seconds in (('begin', 0), ('again', -7), ('middle', 0.27), ('end', 1)):
        run('decode', model, tmp_path / f'{name}.ply', '--time', seconds)
        assert splats_of(tmp_path / f'{name}.ply') == count
    files = {name: (tmp_path / f'{name}.ply').read_bytes() for name in ('begin', 'again', 'middle', 'end')}
    assert files['begin'] == files['again']
    assert len(set(files.values())) == 3
    assert f'1 to {count} is allowed' in error('decode', model, tmp_path / 'many.ply', '--anchors', count + 1)


def test_it_decodes_at_any_budget_with_the_tree_of_its_fit(model, tmp_path):
    count = splats_of(model)
    assert b'tree.parents' in model.read_bytes()
    for name, budget, seconds in (('few', ('--anchors', 7), 0.27), ('half', ('--ratio', 0.5), 0.27),
                                  ('later', ('--ratio', 0.5), 0.8)):
        run('decode', model, tmp_path / f'{name}.ply', *budget, '--time', seconds)
    assert splats_of(tmp_path / 'few.ply') == 7
    assert splats_of(tmp_path / 'half.ply') == splats_of(tmp_path / 'later.ply') == round(count / 2)
    assert (tmp_path / 'half.ply').read_bytes() != (tmp_path / 'later.ply').read_bytes()


def without_tree(path, out):
    """The asset as versions before trees wrote it."""
    data = path.read_bytes()
    size = int.from_bytes(data[:8], 'little')
    header, kept, tensors = json.loads(data[8:8 + size]), {}, b''
    for name, tensor in header.items():
        if name.startswith('tree.'):
            continue
        kept[name] = tensor
        if name != '__metadata__':
            first, last = tensor['data_offsets']
            tensor['data_offsets'] = [len(tensors), len(tensors) + last - first]
            tensors += data[8 + size + first:8 + size + last]
    text = json.dumps(kept).encode()
    text += b' ' * (-len(text) % 8)
    out.write_bytes(len(text).to_bytes(8, 'little') + text + tensors)


def test_an_asset_without_a_tree_decodes_to_the_same(model, tmp_path):
    old = tmp_path / 'old.stipple.safetensors'
    without_tree(model, old)
    assert b'tree.' not in old.read_bytes()
    for name, path in (('with', model), ('without', old)):
        run('decode', path, tmp_path / f'{name}.ply', '--ratio', 0.25, '--time', 0.4)
    assert (tmp_path / 'with.ply').read_bytes() == (tmp_path / 'without.ply').read_bytes()


def test_an_image_is_of_its_time(moving, model, tmp_path):
    for name, seconds in (('begin', 0), ('middle', 0.27)):
        run('decode', model, tmp_path / f'{name}.ply', '--time', seconds)
        camera = ('--camera', moving / 'transforms.json', '--view', 0, '--colour', 'display')
        run('render', tmp_path / f'{name}.ply', *camera, '-o', tmp_path / f'{name}_file.png')
        run('render', model, *camera, '--time', seconds, '-o', tmp_path / f'{name}.png')
        assert (tmp_path / f'{name}.png').read_bytes() == (tmp_path / f'{name}_file.png').read_bytes()
    assert (tmp_path / 'begin.png').read_bytes() != (tmp_path / 'middle.png').read_bytes()


def test_a_conversion_would_lose_the_motion(model, tmp_path):
    assert error('convert', model, tmp_path / 'still.ply').endswith(
        'holds splats that move; stipple decode --time makes those of one time')


def test_it_comes_back_from_a_copy_bit_for_bit(model, tmp_path):
    run('decode', model, tmp_path / 'copy.stipple.safetensors')
    assert (tmp_path / 'copy.stipple.safetensors').read_bytes() == model.read_bytes()


def test_a_splat_file_of_it_is_its_begin(moving, model, tmp_path):
    run('fit', moving, tmp_path / 'fitted.ply', *FEW)
    run('decode', model, tmp_path / 'decoded.ply', '--time', 0)
    assert (tmp_path / 'fitted.ply').read_bytes() == (tmp_path / 'decoded.ply').read_bytes()


def test_a_killed_fit_resumes_bit_for_bit(moving, tmp_path):
    steps = ('--model', 'motion', '--iterations', 400, '--gaussians', 300, '--sh-degree', 0)
    whole, out = (tmp_path / f'{name}.stipple.safetensors' for name in ('whole', 'out'))
    run('fit', moving, whole, *steps)
    checkpoint = tmp_path / (out.name + '.checkpoint.safetensors')
    process = subprocess.Popen([TOOL, *map(str, ('fit', moving, out, *steps, '--checkpoint-every', 5))],
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while not checkpoint.exists() and time.monotonic() < deadline:
        time.sleep(0.001)
    process.kill()
    process.wait(timeout=60)
    assert checkpoint.exists() and not out.exists()
    # Of other times it is another fit.
    scene = json.loads((moving / 'transforms.json').read_text())
    scene['frames'][3]['time'] += 0.01
    other = tmp_path / 'other'
    other.mkdir()
    (other / 'images').symlink_to(moving / 'images')
    (other / 'transforms.json').write_text(json.dumps(scene))
    assert 'is of a fit to other views' in error('fit', other, out, *steps, '--resume')
    run('fit', moving, out, *steps, '--resume')
    assert out.read_bytes() == whole.read_bytes()
    assert not checkpoint.exists()


def test_images_without_times_are_refused_with_what_is_missing(dataset, tmp_path):  # noqa: F811
    message = error('fit', dataset, tmp_path / 'm.stipple.safetensors', *FEW)
    assert "all views have the same time" in message and "'time' of a frame in transforms.json" in message


def test_options_of_fields_are_refused(moving, tmp_path):
    assert error('fit', moving, tmp_path / 'm.stipple.safetensors', *FEW, '--anchors', 64).endswith(
        'belongs to --model field')


def test_a_series_of_a_model_plays_from_its_first_time_to_its_last(model, tmp_path):
    seen = json.loads(run('series', model, tmp_path / 'film.usda', '--frame-rate', 8, '--anchors', 20, '--json').stdout)
    assert seen == {'frames': 9, 'splats': 9 * 20}
    text = (tmp_path / 'film.usda').read_text()
    assert 'startTimeCode = 1\n' in text and 'endTimeCode = 9\n' in text


def test_a_series_says_what_it_cannot_take(model, tmp_path):
    run('decode', model, tmp_path / 'a.ply', '--anchors', 20)
    assert '--anchors is of models' in error('series', tmp_path / 'a.ply', tmp_path / 'a.usda', '--anchors', 5)
    assert 'one model' in error('series', model, model, tmp_path / 'a.usda')
    assert 'a file to write' in error('series', model)
    assert '.usdz can' in error('series', model, tmp_path / 'a.ply')
    assert 'frames per second' in error('series', model, tmp_path / 'a.usda', '--frame-rate', 0)
    assert not (tmp_path / 'a.usda').exists()


def test_one_file_becomes_files_of_its_frames_again(model, tmp_path):
    run('series', model, tmp_path / 'film.usdz', '--frame-rate', 8, '--anchors', 20, '--first', 98)
    seen = json.loads(run('series', tmp_path / 'film.usdz', tmp_path / 'walk_##.ply', '--first', 98, '--json').stdout)
    assert seen == {'frames': 9, 'splats': 9 * 20}
    assert sorted(f.name for f in tmp_path.glob('walk_*')) == sorted(f'walk_{i:02}.ply' for i in range(98, 107))
    run('decode', model, tmp_path / 'last.usdz', '--anchors', 20, '--time', 1)
    run('convert', tmp_path / 'last.usdz', tmp_path / 'last.ply')
    assert (tmp_path / 'walk_106.ply').read_bytes() == (tmp_path / 'last.ply').read_bytes()
    assert (tmp_path / 'walk_98.ply').read_bytes() != (tmp_path / 'last.ply').read_bytes()


def test_what_cannot_be_split_is_named(model, tmp_path):
    run('decode', model, tmp_path / 'a.ply', '--anchors', 20)
    assert 'is no file that may hold a series' in error('series', tmp_path / 'a.ply', tmp_path / 'b#.ply')
    assert 'two places for a number' in error('series', tmp_path / 'a.ply', tmp_path / 'b#c#.ply')
    assert 'one file of USD' in error('series', tmp_path / 'a.ply', tmp_path / 'a.ply', tmp_path / 'b#.ply')
