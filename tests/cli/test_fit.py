"""`stipple fit`: from pictures to splats and models, stopped, killed and resumed."""
import json
import os
import resource
import shutil
import signal
import struct
import subprocess
import time
import zlib

import numpy as np
import pytest
from fit_dataset import TOOL, dataset, error, figures, help_of, run  # noqa: F401

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


def test_the_report_tells_what_iterations_cost(dataset, tmp_path):
    run('fit', dataset, tmp_path / 'out.ply', *FEW, '--report', tmp_path / 'r.json')
    lines = run('accuracy', '--fit', tmp_path / 'r.json', '-o', tmp_path / 'cost.json', '--above',
                10).stdout.splitlines()
    report, fit = (json.loads((tmp_path / name).read_text()) for name in ('cost.json', 'r.json'))
    assert report['subject'] == 'fit'
    assert [row['iteration'] for row in report['settings']] == [row['iteration'] for row in fit['measures']]
    assert report['settings'][-1]['seconds'] == pytest.approx(fit['seconds']['all'], rel=1e-4)
    assert lines[-1].startswith('cheapest above 10 dB: iteration ')


def test_a_model_decodes_at_any_budget(dataset, tmp_path):
    model = tmp_path / 'm.stipple.safetensors'
    run('fit', dataset, model, *FEW)
    run('decode', model, tmp_path / 'few.ply', '--anchors', 20)
    assert json.loads(run('info', tmp_path / 'few.ply', '--json').stdout)['count'] == 20
    run('fit', dataset, tmp_path / 'cut.ply', *FEW, '--budget', 30)
    assert json.loads(run('info', tmp_path / 'cut.ply', '--json').stdout)['count'] == 30


def test_lists_strategies_and_parts():
    lines = run('fit', '--strategies').stdout.splitlines()
    names = [line.split()[0] for line in lines if line.startswith('  ') and line[2] != ' ']
    assert names[0] == 'adaptive'
    assert {'absolute', 'learned_density', 'long_axis_split'} <= set(names)
    assert lines.index('strategies') < lines.index('parts, after a strategy and +')
    assert all(len(line.split()) > 4 for line in lines if line.startswith('  '))
    # What can be set stands under its owner, with its default and range.
    settings = lines[lines.index(next(line for line in lines if 'multi_step_update' in line)) + 1:][:2]
    assert [line.split() for line in settings] == [['few', '5,', 'of', '0', 'to', '1000'],
                                                   ['many', '20,', 'of', '0', 'to', '1000']]


def test_every_option_of_the_library_is_a_flag_with_a_help():
    lines = help_of('fit')
    for name in ('model', 'strategy', 'start-splats,--start', 'max-splats,--gaussians',
                 'min-anchors,--least-anchors', 'max-anchors,--most-anchors,--anchors',
                 'gaussians-per-anchor', 'sh-degree', 'antialias', 'density-gradient,--no-density-gradient',
                 'jitter,--no-jitter', 'shell', 'key-frame-spacing', 'key-frame-blend',
                 'growth-by-level,--no-growth-by-level', 'middle-level-rank', 'high-level-rank',
                 'middle-level-weight', 'high-level-weight', 'iterations', 'background', 'holdout', 'seed', 'ssim-share',
                 'measure-interval', 'image-bytes,--picture-bytes', 'max-bytes',
                 'checkpoint-interval,--checkpoint-every', 'checkpoint-seconds', 'resume'):
        assert f'  --{name}' in lines, name
    assert 'checkpoint-path' not in lines  # the tool says where it lies
    words = ' '.join(lines.split())  # newer releases of CLI11 break lines
    assert ('Default: 500 (fast), 2000 (balanced), 4000 (fine); of motion 1000 (fast), 4000 (balanced), 15000 (fine); '
            'of a scaffold 1000 (fast), 4000 (balanced), 10000 (fine); of a relay 6000 (fast), 15000 (balanced), '
            '30000 (fine). Range: 1 to 10000000.') in words


@pytest.mark.parametrize('former, present', [
    (('--gaussians', 200), ('--max-splats', 200)), (('--start', 50), ('--start-splats', 50)),
    (('--checkpoint-every', 5), ('--checkpoint-interval', 5)), (('--picture-memory', 1), ('--image-bytes', '1MiB')),
    (('--picture-bytes', '1MiB'), ('--image-memory', 1)), (('--memory', 1), ('--max-bytes', '1024KiB')),
    (('--model', 'field', '--least-anchors', 8, '--most-anchors', 32),
     ('--model', 'field', '--min-anchors', 8, '--max-anchors', 32)),
    (('--model', 'field', '--anchors', 32, '--no-jitter'), ('--model', 'field', '--max-anchors', 32, '--no-jitter'))],
    ids=lambda flags: flags[-2])
def test_flags_are_understood_by_what_they_were_called(dataset, tmp_path, former, present):
    for name, flags in (('former', former), ('present', present)):
        run('fit', dataset, tmp_path / f'{name}.ply', '--iterations', 20, '--sh-degree', 0, '--report',
            tmp_path / f'{name}.json', *flags)
    assert (tmp_path / 'former.ply').read_bytes() == (tmp_path / 'present.ply').read_bytes()
    settings = [json.loads((tmp_path / f'{name}.json').read_text())['settings'] for name in ('former', 'present')]
    assert settings[0] == settings[1]


def test_begins_with_as_many_splats_as_asked(dataset, tmp_path):
    run('fit', dataset, tmp_path / 'out.ply', '--iterations', 1, '--gaussians', 300, '--start', 70)
    assert json.loads(run('info', tmp_path / 'out.ply', '--json').stdout)['count'] == 70


def places(path):
    """[N,3] of a binary PLY."""
    ply = path.read_bytes()
    start = ply.index(b'end_header\n') + len(b'end_header\n')
    return np.frombuffer(ply[start:], '<f4').reshape(-1, ply[:start].count(b'property float'))[:, :3]


def test_begins_with_splats_of_a_file(dataset, tmp_path):
    coarse = tmp_path / 'coarse.ply'
    first = run('fit', dataset, coarse, '--iterations', 300, '--gaussians', 60, '--start', 60, '--holdout', 6)
    on = run('fit', dataset, tmp_path / 'on.ply', '--iterations', 1, '--gaussians', 300, '--holdout', 6, '--start-from',
             coarse)
    before, after = (float(figures(result.stdout)['held_out_psnr']) for result in (first, on))
    assert abs(after - before) < 0.5
    # A step moves them by a thousandth of the scene; a strategy may remove faint ones at once.
    ours, theirs = places(tmp_path / 'on.ply'), places(coarse)
    assert len(theirs) - 10 < len(ours) <= len(theirs)
    assert np.linalg.norm(ours[:, None] - theirs, axis=2).min(1).max() < 0.02
    # Stopped, it goes on from the same splats alone.
    out = tmp_path / 'stopped.ply'
    process = subprocess.Popen([TOOL, 'fit', dataset, out, '--iterations', '200000', '--gaussians', '300',
                                '--start-from', coarse, '--checkpoint-interval', '10'], stderr=subprocess.DEVNULL)
    checkpoint, deadline = tmp_path / 'stopped.ply.checkpoint.safetensors', time.monotonic() + 60
    while not checkpoint.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    process.kill()
    process.wait()
    again = ('fit', dataset, out, '--iterations', 200000, '--gaussians', 300, '--resume')
    assert 'began with other splats' in error(*again)
    assert 'began with other splats' in error(*again, '--start-from', tmp_path / 'on.ply')


@pytest.mark.parametrize('flags, words', [
    (('--model', 'field'), 'only a fit of explicit splats'), (('--gaussians', 20), 'there are 120 splats to begin with'),
    (('--memory', 1, '--sh-degree', 4, '--gaussians', 5000), 'max_bytes has room for'),
    (('--start-from', 'nothing.ply'), 'nothing.ply')], ids=['model', 'more than allowed', 'memory', 'no file'])
def test_a_start_that_does_not_fit_is_refused(dataset, tmp_path, flags, words):
    start = tmp_path / 'start.ply'
    run('decode', dataset / 'truth.ply', start, '--anchors', 120)
    steps = ('fit', dataset, tmp_path / 'out.ply', '--iterations', 5)
    assert words in error(*steps, *flags, *(() if '--start-from' in flags else ('--start-from', start)))
    assert not (tmp_path / 'out.ply').exists()


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


def test_a_field_has_a_shell_where_it_is_asked_for(dataset, tmp_path):
    farthest = {}
    for shell in ('on', 'off'):
        run('fit', dataset, tmp_path / f'{shell}.ply', '--model', 'field', '--iterations', 20, '--anchors', 256,
            '--shell', shell)
        bounds = json.loads(run('info', tmp_path / f'{shell}.ply', '--json').stdout)
        farthest[shell] = max(map(abs, bounds['bounds_min'] + bounds['bounds_max']))
    assert farthest['on'] > 3 * farthest['off']


def start(*arguments, environment=None, **options):
    return subprocess.Popen([TOOL, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                            env=environment, **options)


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


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_keeps_the_best(dataset, tmp_path, number):
    out = tmp_path / 'out.ply'
    checkpoint = tmp_path / 'out.ply.checkpoint.safetensors'
    steps = ('--iterations', 100000, '--gaussians', 300, '--sh-degree', 0)
    process = start('fit', dataset, out, *steps, '--checkpoint-every', 5)
    wait_for(checkpoint)
    process.send_signal(number)
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


def test_a_closed_terminal_keeps_the_best(dataset, tmp_path):
    """It sends SIGHUP, and the lines of the fit have nowhere to go any more; the shell's SIGTERM comes right behind."""
    out = tmp_path / 'out.ply'
    process = start('fit', dataset, out, '--iterations', 100000, '--gaussians', 300, '--sh-degree', 0,
                    '--checkpoint-every', 5)
    wait_for(tmp_path / 'out.ply.checkpoint.safetensors')
    process.stdout.close()
    process.stderr.close()
    process.send_signal(signal.SIGHUP)
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=60) == 0
    assert json.loads(run('info', out, '--json').stdout)['count'] > 0


def test_nohup_goes_on(dataset, tmp_path):
    process = start('fit', dataset, tmp_path / 'out.ply', '--iterations', 300, '--gaussians', 300, '--sh-degree', 0,
                    '--checkpoint-every', 5, preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
    wait_for(tmp_path / 'out.ply.checkpoint.safetensors')
    process.send_signal(signal.SIGHUP)
    stdout, stderr = process.communicate(timeout=60)
    assert process.returncode == 0, stderr
    assert figures(stdout)['iterations'] == '300'


@pytest.mark.parametrize('number, name', [(signal.SIGINT, 'Ctrl-C'), (signal.SIGTERM, 'SIGTERM'),
                                          (signal.SIGHUP, 'SIGHUP')])
def test_a_signal_before_the_first_step_leaves_nothing(dataset, tmp_path, number, name):
    """From the tool's start on, whatever it is at: one line, a status as shells have it, and no file."""
    early = 0
    for delay in (0.01, 0.02, 0.03, 0.05, 0.08, 0.13, 0.2, 0.3):
        process = start('fit', dataset, tmp_path / 'out.ply', '--iterations', 100000, '--gaussians', 300, '--sh-degree',
                        0)
        time.sleep(delay)
        process.send_signal(number)
        _, stderr = process.communicate(timeout=60)
        left = [path.name for path in tmp_path.iterdir()]
        if process.returncode == 0:
            assert 'the best so far is in' in stderr
            assert sorted(left) == ['out.ply', 'out.ply.checkpoint.safetensors']
            for leftover in left:
                (tmp_path / leftover).unlink()
            continue
        assert left == []
        if process.returncode == -number:  # before the tool has read its arguments
            continue
        early += 1
        assert process.returncode == 128 + number, stderr
        assert [line for line in stderr.splitlines() if line.startswith('stipple: ')] == [f'stipple: stopped by {name}']
    assert early > 0


def test_a_result_that_has_no_place_any_more_is_kept_elsewhere(dataset, tmp_path):
    folder, spare = tmp_path / 'gone', tmp_path / 'spare'
    folder.mkdir()
    spare.mkdir()
    process = start('fit', dataset, folder / 'out.ply', '--iterations', 100000, '--gaussians', 300, '--sh-degree', 0,
                    '--checkpoint-every', 5, environment={**os.environ, 'TMPDIR': str(spare)})
    wait_for(folder / 'out.ply.checkpoint.safetensors')
    folder.rename(tmp_path / 'moved')  # at once: a checkpoint may be on its way into it
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate(timeout=60)
    assert process.returncode == 1
    private, = spare.iterdir()  # nobody can guess its name, or write there
    assert private.stat().st_mode & 0o777 == 0o700
    assert str(process.pid) not in private.name
    kept, = private.iterdir()
    assert f"the result is in '{kept}'" in stderr.strip().splitlines()[-1]
    assert json.loads(run('info', kept, '--json').stdout)['count'] > 0


def test_a_full_disk_at_a_checkpoint_is_a_note(dataset, tmp_path):
    def limit():  # A checkpoint is larger, the result smaller: writes beyond fail as on a full disk.
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000))
    process = start('fit', dataset, tmp_path / 'out.ply', *FEW, '--checkpoint-every', 20, preexec_fn=limit)
    _, stderr = process.communicate(timeout=60)
    assert process.returncode == 0, stderr
    assert stderr.count('note: the checkpoint is not saved') == 1
    assert [path.name for path in tmp_path.iterdir()] == ['out.ply']


def test_checkpoints_that_cannot_be_read_stay_as_they_are(dataset, tmp_path):
    out = tmp_path / 'out.ply'
    checkpoint = tmp_path / 'out.ply.checkpoint.safetensors'
    steps = ('--iterations', 100000, '--gaussians', 300, '--sh-degree', 0)
    process = start('fit', dataset, out, *steps, '--checkpoint-every', 5)
    wait_for(checkpoint)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    whole, splats = checkpoint.read_bytes(), out.read_bytes()
    version = b'"stipple_version":"1.1"'
    assert version in whole
    for damaged, text in ((whole[:len(whole) // 2], 'holds'), (whole[:40], 'truncated'), (b'', 'holds 0 bytes'),
                          (whole.replace(version, version.replace(b'1', b'9')), 'version 9; version 1 is supported')):
        checkpoint.write_bytes(damaged)
        line = error('fit', dataset, out, *steps, '--resume')
        assert checkpoint.name in line and text in line
        assert (checkpoint.read_bytes(), out.read_bytes()) == (damaged, splats)


def test_no_file_of_another_kind_is_replaced(dataset, tmp_path):
    splats = tmp_path / 'scan.ply'
    run('fit', dataset, splats, *FEW)
    (tmp_path / 'curves.svg').write_text('<svg>a drawing</svg>')
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    for report, named in ((splats, 'scan.ply'), (tmp_path / 'curves.json', 'curves.svg'),
                          (tmp_path / 'curves.svg', '.json')):
        began = time.monotonic()
        line = error('fit', dataset, tmp_path / 'out.ply', '--iterations', 100000, '--report', report)
        assert named in line, line
        assert time.monotonic() - began < 20  # and not after the fit
        assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
    # A report may be made again.
    for _ in range(2):
        run('fit', dataset, tmp_path / 'out.ply', *FEW, '--report', tmp_path / 'r.json')


@pytest.fixture
def copy(dataset, tmp_path):
    shutil.copytree(dataset, tmp_path / 'copy')
    return tmp_path / 'copy'


def scene(folder, **changes):
    path = folder / 'transforms.json'
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))


def write_picture(path, pixel, width=48, height=36):
    """A PNG in one colour of 8 bits a channel."""
    def chunk(kind, data):
        return struct.pack('>I', len(data)) + kind + data + struct.pack('>I', zlib.crc32(kind + data))
    rows = (b'\0' + bytes(pixel) * width) * height
    header = struct.pack('>IIBBBBB', width, height, 8, 2 if len(pixel) == 3 else 6, 0, 0, 0)
    path.write_bytes(b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', header) + chunk(b'IDAT', zlib.compress(rows)) +
                     chunk(b'IEND', b''))


def no_camera(folder):
    scene(folder, frames=[])


def few_pictures(folder):
    for path in sorted((folder / 'images').iterdir())[2:]:
        path.unlink()


def other_size(folder):
    write_picture(folder / 'images' / '03.png', (9, 9, 9), 40, 36)


def black(folder):
    for path in (folder / 'images').iterdir():
        write_picture(path, (0, 0, 0))


def transparent(folder):
    for path in (folder / 'images').iterdir():
        write_picture(path, (0, 0, 0, 0))


@pytest.mark.parametrize('damage, text', [
    (no_camera, 'at least one camera is needed'), (few_pictures, 'at least 3 must be there'),
    (other_size, '03.png is 40 x 36 pixels; its camera is said to be 48 x 36 pixels'),
    (black, 'black everywhere'), (transparent, 'transparent everywhere')],
    ids=lambda value: getattr(value, '__name__', ''))
def test_one_line_says_what_is_wrong_with_views(copy, tmp_path, damage, text):
    damage(copy)
    assert text in error('fit', copy, tmp_path / 'out.ply', *FEW)
    assert not (tmp_path / 'out.ply').exists()


def test_views_of_deleted_pictures_are_left_out_with_a_note(copy, tmp_path):
    count = len(list((copy / 'images').iterdir()))
    (copy / 'images' / '03.png').unlink()
    said = run('fit', copy, tmp_path / 'out.ply', *FEW).stderr
    assert f'note: {copy}: 1 of {count} images is missing' in said and '03.png; their views are left out' in said
    assert (tmp_path / 'out.ply').exists()


def test_one_view_is_fitted_with_a_note(copy, tmp_path):
    frames = json.loads((copy / 'transforms.json').read_text())['frames']
    scene(copy, frames=frames[:1])
    assert 'note: there is one view' in run('fit', copy, tmp_path / 'out.ply', *FEW).stderr
    assert (tmp_path / 'out.ply').exists()


@pytest.mark.parametrize('arguments, text', [
    (('missing', 'out.ply'), 'missing'),
    (('{dataset}', 'out.txt'), 'out.txt'),
    (('{dataset}', 'nowhere/out.ply'), 'no folder'),
    (('{dataset}', 'out.ply', '--report', '/nowhere/r.json'), "no folder '/nowhere'"),
    (('{dataset}', 'out.ply', '--resume'), 'out.ply.checkpoint.safetensors'),
    (('{dataset}', 'out.ply', '--strategy', 'best'), 'adaptive'),
    (('{dataset}', 'out.ply', '--anchors', 100), '--model field'),
    (('{dataset}', 'out.ply', '--model', 'field', '--gaussians', 100), '--model explicit'),
    (('{dataset}', 'out.ply', '--model', 'field', '--start', 100), '--model explicit'),
    (('{dataset}', 'out.ply', '--gaussians', 10, '--start', 11), 'start_splats is 11'),
    (('{dataset}', 'out.ply', '--iterations', 0), '--iterations is 0'),
    (('{dataset}', 'out.ply', '--strategy', 'learned_density'), 'explicit splats do not have'),
    (('{dataset}', 'out.ply', '--model', 'field', '--strategy', 'adaptive'), 'there is learned_density'),
    (('{dataset}', 'out.ply', '--model', 'field', '--strategy', 'learned_density', '--no-density-gradient'), 'both'),
    (('{dataset}', 'out.ply', '--memory', 0.001), 'max_bytes is 1048'),
    (('{dataset}', 'out.ply', '--sh-degree', 5), '--sh-degree is 5; 0 to 4 is allowed'),
    (('{dataset}', 'out.ply', '--shell', 'on'), '--model field'),
    (('{dataset}', 'out.ply', '--no-jitter'), '--model field'),
    (('{dataset}', 'out.ply', '--iterations', 'many'), '--iterations is many; 1 to 10000000 is allowed'),
    (('{dataset}', 'out.ply', '--max-bytes', '1TiB'), '--max-bytes is 1TiB'),
    (('{dataset}', 'out.ply', '--ssim-share', 2), '--ssim-share is 2; 0 to 1 is allowed'),
    (('{dataset}', 'out.ply', '--downscale', 0), 'downscale'),
])
def test_one_line_says_what_is_wrong(dataset, tmp_path, arguments, text):
    given = [str(a).replace('{dataset}', str(dataset)) for a in arguments]
    given[1] = str(tmp_path / given[1])
    assert text in error('fit', *given)
    assert list(tmp_path.iterdir()) == []
