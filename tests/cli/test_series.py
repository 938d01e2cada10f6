"""Fits to scenes that move, of the layouts that real data sets have."""
import json
import math
import re
import shutil
import struct

import pytest
from fit_dataset import dataset, error, figures, help_of, run  # noqa: F401

FEW = ('--model', 'motion', '--iterations', 60, '--gaussians', 200, '--sh-degree', 0)
CAMERAS, FRAMES = 5, 6


def npy(rows):
    """The bytes of a .npy file of rows of doubles."""
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({len(rows)}, {len(rows[0])}), }}".ljust(117) + '\n'
    return (b'\x93NUMPY\x01\x00' + struct.pack('<H', len(header)) + header.encode() +
            b''.join(struct.pack(f'<{len(row)}d', *row) for row in rows))


def llff_row(matrix, height, width, focal):
    """A camera of transforms.json (right, up, backwards) as LLFF has it: down, right, backwards."""
    row = []
    for r, size in zip(range(3), (height, width, focal)):
        right, up, back, place = matrix[r]
        row += [-up, right, back, place, size]
    return row + [1.0, 9.0]


@pytest.fixture(scope='module')
def frames(dataset, tmp_path_factory):  # noqa: F811
    """cam00/0000.png to cam04/0005.png of an object that goes up and down, and the cameras that stand around it."""
    folder = tmp_path_factory.mktemp('frames')
    scene = json.loads((dataset / 'transforms.json').read_text())
    scene['frames'] = scene['frames'][:CAMERAS]
    distance = math.dist(*[[row[3] for row in json.loads((dataset / 'transforms.json').read_text())['frames'][i][
        'transform_matrix'][:3]] for i in (0, 6)]) / 2
    for c in range(CAMERAS):
        (folder / f'cam{c:02}').mkdir()
        scene['frames'][c]['file_path'] = f'cam{c:02}/0000.png'
    for f in range(FRAMES):
        lower = json.loads(json.dumps(scene))
        for frame in lower['frames']:
            frame['transform_matrix'][1][3] -= 0.1 * distance * math.sin(math.tau * f / FRAMES)
        (folder / 'lower.json').write_text(json.dumps(lower))
        for c in range(CAMERAS):
            run('render', dataset / 'truth.ply', '--camera', folder / 'lower.json', '--view', c, '--colour', 'display',
                '-o', folder / f'cam{c:02}' / f'{f:04}.png')
    (folder / 'lower.json').unlink()
    return folder, scene


@pytest.fixture
def videos(frames, tmp_path):
    """The layout of Neural 3D Video."""
    folder, scene = frames
    shutil.copytree(folder, tmp_path / 'set')
    rows = [llff_row(frame['transform_matrix'], scene['h'], scene['w'], scene['fl_x']) for frame in scene['frames']]
    (tmp_path / 'set' / 'poses_bounds.npy').write_bytes(npy(rows))
    return tmp_path / 'set'


@pytest.fixture
def first_frames(frames, tmp_path):
    """transforms.json of each camera's first frame."""
    folder, scene = frames
    shutil.copytree(folder, tmp_path / 'first')
    (tmp_path / 'first' / 'transforms.json').write_text(json.dumps(scene))
    return tmp_path / 'first'


def info(path):
    return json.loads(run('info', path, '--json').stdout)


def test_info_tells_cameras_frames_and_times(videos, first_frames):
    for folder in (videos, first_frames):
        told = info(folder)
        assert (told['count'], told['cameras'], told['frames']) == (CAMERAS * FRAMES, CAMERAS, FRAMES)
        assert told['time_begin'] == 0
        assert told['time_end'] == pytest.approx((FRAMES - 1) / 30, abs=1e-6)  # six digits are printed


def test_a_fit_holds_out_whole_cameras_and_measures_what_moves(videos, tmp_path):
    result = run('fit', videos, tmp_path / 'm.stipple.safetensors', *FEW, '--holdout', 2, '--report',
                 tmp_path / 'r.json')
    assert '30 of 30 images are used, of 6 times, 0 s to 0.166667 s, by 5 cameras of several images' in result.stderr
    assert '2 cameras are learned from and 3 held out: cam00, cam02, cam04 (18 of 30 images)' in result.stderr
    seen = figures(result.stdout)
    # What moves is seen by fewer steps, and is harder, than the black around it.
    assert 5 < float(seen['held_out_moving_psnr']) < float(seen['held_out_psnr'])
    report = json.loads((tmp_path / 'r.json').read_text())
    assert report['training_views'] == 12
    assert report['by_budget'][0]['moving_psnr'] < report['by_budget'][0]['psnr']
    told = info(tmp_path / 'm.stipple.safetensors')
    assert (told['time_begin'], told['time_end']) == (0, pytest.approx(5 / 30, abs=1e-6))


def test_a_camera_is_held_out_by_name(videos, tmp_path):
    out = tmp_path / 'm.stipple.safetensors'
    result = run('fit', videos, out, *FEW, '--held-out-cameras', ' cam00 ')
    assert '4 cameras are learned from and 1 held out: cam00 (6 of 30 images)' in result.stderr
    assert error('fit', videos, out, *FEW, '--held-out-cameras', 'left').endswith(
        "'left' is to be held out; cameras are called cam00 to cam04")
    assert 'say both what is held out' in error('fit', videos, out, *FEW, '--held-out-cameras', 'cam00', '--holdout', 0)


def test_too_few_cameras_are_all_learned_from(first_frames, tmp_path):
    result = run('fit', first_frames, tmp_path / 'm.stipple.safetensors', *FEW)
    assert 'none of the 5 cameras is held out; figures are of views that are learned from' in result.stderr
    assert 'training_psnr' in figures(result.stdout)


def test_frames_and_images_are_chosen(videos, tmp_path):
    out = tmp_path / 'm.stipple.safetensors'
    result = run('fit', videos, out, *FEW, '--frames', '1:5:2', '--frame-rate', 10, '--max-images', 12)
    assert '12 of 30 images are used, of 3 times, 0.1 s to 0.5 s, by 5 cameras' in result.stderr
    for frames, message in (('7:9', 'frames 7 to 9 are asked for; there are frames 0 to 5'),
                            ('3', "--frames is '3'; FIRST:LAST or FIRST:LAST:STEP"),
                            ('0:a', "--frames is '0:a'"),
                            ('0:4:0', 'the step of frames is 0'),
                            ('4:2', 'the last one may not come before the first')):
        assert message in error('fit', videos, out, *FEW, '--frames', frames), frames
    assert '--frame-rate must be above 0' in error('fit', videos, out, *FEW, '--frame-rate', 0)
    one = error('fit', videos, out, *FEW, '--frames', '2:2')
    assert 'all views have the same time' in one


def test_splats_that_stand_still_see_the_first_frames_only(videos, tmp_path):
    still = run('fit', videos, tmp_path / 's.ply', '--iterations', 20, '--gaussians', 100, '--sh-degree', 0)
    assert 'of several images' not in still.stderr
    chosen = run('fit', videos, tmp_path / 't.ply', '--iterations', 20, '--gaussians', 100, '--sh-degree', 0, '--frames',
                 '3:3')
    assert '5 of 30 images are used' in chosen.stderr


def test_an_image_is_drawn_from_a_camera_of_the_set(videos, dataset, tmp_path):  # noqa: F811
    """The cameras of poses_bounds.npy are those of transforms.json."""
    for name, camera in (('llff', videos), ('json', dataset / 'transforms.json')):
        run('render', dataset / 'truth.ply', '--camera', camera, '--view', 3, '--colour', 'display', '-o',
            tmp_path / f'{name}.png')
    assert (tmp_path / 'llff.png').read_bytes() == (tmp_path / 'json.png').read_bytes()


def test_bad_sets_are_refused_in_one_sentence(videos, tmp_path):
    out = tmp_path / 'm.stipple.safetensors'
    (videos / 'cam05.mp4').write_bytes(b'video')
    for c in range(CAMERAS):
        (videos / f'cam{c:02}').rename(videos / f'.hidden{c:02}')
    assert re.search(r'holds 1 videos \(cam05.mp4 is the first\).*ffmpeg', error('fit', videos, out, *FEW))
    (videos / 'cam05.mp4').unlink()
    assert 'beside it are 0 folders of numbered images' in error('fit', videos, out, *FEW)
    for c in range(CAMERAS):
        (videos / f'.hidden{c:02}').rename(videos / f'cam{c:02}')
    (videos / 'cam02' / '0003.png').unlink()
    assert 'cam02 lacks 1 (3 is the first)' in run('fit', videos, out, *FEW).stderr
    whole = (videos / 'poses_bounds.npy').read_bytes()
    (videos / 'poses_bounds.npy').write_bytes(whole[:-8])
    assert 'poses_bounds.npy is a damaged .npy file: its header says 5 x 17' in error('fit', videos, out, *FEW)
    assert not list(tmp_path.glob('m.stipple*.checkpoint*'))


@pytest.fixture
def d_nerf(frames, tmp_path):
    """One camera at a time, files without extensions, times from 0 to 1, and three files."""
    folder, scene = frames
    at = 0
    for part, count in (('train', 12), ('val', 2), ('test', 4)):
        listed = {'camera_angle_x': 2 * math.atan(scene['w'] / 2 / scene['fl_x']), 'frames': []}
        (tmp_path / 'd' / part).mkdir(parents=True)
        for i in range(count):
            camera, frame = at * 3 % CAMERAS, at % FRAMES
            shutil.copy(folder / f'cam{camera:02}' / f'{frame:04}.png', tmp_path / 'd' / part / f'r_{i:03}.png')
            listed['frames'].append({'file_path': f'./{part}/r_{i:03}', 'rotation': 0.1, 'time': frame / (FRAMES - 1),
                                     'transform_matrix': scene['frames'][camera]['transform_matrix']})
            at += 1
        (tmp_path / 'd' / f'transforms_{part}.json').write_text(json.dumps(listed))
    return tmp_path / 'd'


def test_the_layout_of_d_nerf_is_fitted_by_its_own_split(d_nerf, tmp_path):
    told = info(d_nerf)
    assert (told['train'], told['validation'], told['test']) == (12, 2, 4)
    assert (told['frames'], told['time_begin'], told['time_end']) == (FRAMES, 0, 1)
    run('fit', d_nerf, tmp_path / 'm.stipple.safetensors', *FEW, '--report', tmp_path / 'r.json')
    report = json.loads((tmp_path / 'r.json').read_text())
    assert (report['training_views'], report['measured_views'], report['measured_on']) == (12, 4, 'held-out views')


def test_help_tells_the_flags_of_series():
    text = ' '.join(help_of('fit').split())
    for flag in ('--frames FIRST:LAST[:STEP]', '--frame-rate', '--max-images', '--held-out-cameras NAMES'):
        assert flag in text
    assert 'Default: 30' in text
