# SPDX-License-Identifier: GPL-3.0-or-later
"""`stipple generate` from an image to splats, with the small networks of a golden."""

import json
import os
import signal
import struct
import subprocess
import sys
import time
import zlib
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import pipeline_weights  # noqa: E402

TOOL = Path(os.environ['STIPPLE_BUILD_DIR']) / 'bin' / 'stipple'
NETWORKS = Path(__file__).resolve().parents[2] / 'addon' / 'stipple' / 'networks'
SIZES = ('--canvas', pipeline_weights.CANVAS, '--tokens', pipeline_weights.TOKENS)
SMALL = (*SIZES, '--steps', pipeline_weights.STEPS)


def run(*arguments, status=0):
    result = subprocess.run([TOOL, 'generate', *map(str, arguments)], capture_output=True, text=True, timeout=120)
    assert result.returncode == status, (arguments, result.stdout, result.stderr)
    return result


def error(*arguments):
    return run(*arguments, status=1).stderr.strip().splitlines()[-1]


def write_png(path, width, height, channels, rows):
    def chunk(kind, data):
        return struct.pack('>I', len(data)) + kind + data + struct.pack('>I', zlib.crc32(kind + data))
    stride = width * channels
    raw = b''.join(b'\0' + rows[y * stride:(y + 1) * stride] for y in range(height))
    kind = {1: 0, 3: 2, 4: 6}[channels]
    Path(path).write_bytes(b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', struct.pack('>IIBBBBB', width, height, 8, kind, 0, 0, 0))
                           + chunk(b'IDAT', zlib.compress(raw)) + chunk(b'IEND', b''))


@pytest.fixture(scope='module')
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp('generate')
    weights = folder / 'weights'
    weights.mkdir()
    pipeline_weights.split(weights)
    width, height, rgba = pipeline_weights.image()
    write_png(folder / 'image.png', width, height, 4, rgba)
    write_png(folder / 'opaque.png', width, height, 3, b''.join(rgba[i:i + 3] for i in range(0, len(rgba), 4)))
    write_png(folder / 'mask.png', width, height, 1, rgba[3::4])
    return folder


def generate(files, image, out, *arguments, **keywords):
    return run(files / image, files / out, '--weights', files / 'weights', *SMALL, *arguments, **keywords)


def test_an_image_becomes_a_model_that_decodes_to_any_budget(files):
    generate(files, 'image.png', 'model.stipple.safetensors')
    for anchors in (32, 40):
        subprocess.run([TOOL, '--weights', files / 'weights', 'decode', files / 'model.stipple.safetensors',
                        files / 'out.ply', '--anchors', str(anchors)], check=True, timeout=60)
        assert f'element vertex {32 * anchors}\n'.encode() in (files / 'out.ply').read_bytes()[:400]


def test_an_image_becomes_splats(files):
    figures = json.loads(generate(files, 'image.png', 'a.ply', '--anchors', 44, '--json').stdout)
    assert figures['gaussians'] == 44 * 32
    assert 0 < figures['estimated_image_seconds'] < figures['estimated_seconds']
    assert figures['operations'] > 1e6


def test_the_same_seed_gives_the_same_file_and_another_does_not(files):
    for name, seed in (('one.ply', 5), ('same.ply', 5), ('other.ply', 6)):
        generate(files, 'image.png', name, '--anchors', 40, '--seed', seed)
    one, same, other = ((files / name).read_bytes() for name in ('one.ply', 'same.ply', 'other.ply'))
    assert one == same and one != other


def test_threads_do_not_change_the_result(files):
    for threads in (1, 2):
        subprocess.run([TOOL, '--threads', str(threads), 'generate', files / 'image.png', files / f't{threads}.ply',
                        '--weights', files / 'weights', *map(str, SMALL), '--anchors', '40'], check=True, timeout=120)
    assert (files / 't1.ply').read_bytes() == (files / 't2.ply').read_bytes()


def test_a_mask_stands_in_for_alpha_and_without_either_the_message_says_what_to_do(files):
    generate(files, 'opaque.png', 'masked.ply', '--anchors', 40, '--mask', files / 'mask.png')
    line = error(files / 'opaque.png', files / 'none.ply', '--weights', files / 'weights', *SMALL)
    assert 'mask' in line and 'transparent' in line
    assert not (files / 'none.ply').exists()


def test_check_says_whether_files_are_published_and_what_passes_by(files):
    figures = json.loads(generate(files, 'image.png', 'c.ply', '--anchors', 40, '--check', '--json').stdout)
    assert figures['TripoSplat decoder.state'] == 'another size than the published file'
    assert len(figures['TripoSplat decoder.sha256']) == 64
    assert figures['structure.layer1.out.count'] > 0
    assert figures['step3.tokens.deviation'] > 0
    assert abs(figures['latent.mean']) < 10
    table = generate(files, 'image.png', 'c.ply', '--anchors', 40, '--check').stdout
    assert 'structure.features' in table and 'SHA-256' in table


def test_several_seeds_are_those_of_single_runs_and_encode_the_image_once(files):
    figures = json.loads(generate(files, 'image.png', 'of.ply', '--anchors', 40, '--seed', 5, '--seeds', 2, '--timings',
                                  '--json').stdout)
    assert figures['seed5.structure.features.operations'] > 1e6 and figures['seed5.colour.moments.operations'] > 1e6
    assert figures['seed6.structure.features.operations'] == figures['seed6.colour.moments.operations'] == 0
    for seed in (5, 6):
        generate(files, 'image.png', 'alone.ply', '--anchors', 40, '--seed', seed)
        assert (files / f'of_{seed}.ply').read_bytes() == (files / 'alone.ply').read_bytes()
    assert not (files / 'of.ply').exists()


def test_of_several_seeds_the_one_that_looks_most_like_the_image_is_kept(files):
    figures = json.loads(generate(files, 'image.png', 'kept.ply', '--anchors', 40, '--seed', 5, '--seeds', 4,
                                  '--keep-best', '--checkpoint', files / 'kept.state', '--json').stdout)
    likeness = {seed: figures[f'seed{seed}.likeness_db'] for seed in range(5, 9)}
    assert len(set(likeness.values())) == 4 and min(likeness.values()) > 0
    assert figures['best_seed'] == max(likeness, key=likeness.get)
    generate(files, 'image.png', 'alone.ply', '--anchors', 40, '--seed', figures['best_seed'])
    assert (files / 'kept.ply').read_bytes() == (files / 'alone.ply').read_bytes()
    assert not list(files.glob('kept_*')) and not list(files.glob('*.state'))


def test_colours_are_led_to_those_of_the_image(tmp_path):
    side = 128
    inside = [((x - 64) / 30) ** 2 + ((y - 64) / 50) ** 2 < 1 for y in range(side) for x in range(side)]
    write_png(tmp_path / 'purple.png', side, side, 4, b''.join(b'\xa0\x20\xc0' + (b'\xff' if shows else b'\0')
                                                              for shows in inside))
    common = (tmp_path / 'purple.png', tmp_path / 'made.stipple.safetensors', '--weights', NETWORKS, '--json')
    figures = json.loads(run(*common, '--seeds', 2, '--keep-best', '--match-colours').stdout)
    best = figures['best_seed']
    assert figures['best.likeness_db'] > figures[f'seed{best}.likeness_db'] + 1
    kept = (tmp_path / 'made.stipple.safetensors').read_bytes()
    assert b'matched_colours' in kept
    alone = json.loads(run(*common, '--seed', best, '--match-colours', '--timings').stdout)
    assert alone['likeness_db'] == figures['best.likeness_db'] and alone['latent.matched.operations'] > 1e9
    assert (tmp_path / 'made.stipple.safetensors').read_bytes() == kept
    plain = json.loads(run(*common, '--seed', best, '--estimate').stdout)
    matched = json.loads(run(*common, '--seed', best, '--match-colours', '--estimate').stdout)
    assert matched['operations'] > 2 * plain['operations'] and matched['estimated_bytes'] > plain['estimated_bytes']


def test_published_networks_match_no_colours(files):
    for more in ((), ('--estimate',)):
        message = error(files / 'image.png', files / 'm.ply', '--weights', files / 'weights', *SMALL, '--match-colours',
                        *more)
        assert 'stipple train' in message and 'colours' in message, message
    assert not (files / 'm.ply').exists()


def test_timings_add_up_to_the_whole(files):
    figures = json.loads(generate(files, 'image.png', 't.ply', '--anchors', 40, '--timings', '--json').stdout)
    steps = [figures[f'step{step}.tokens.operations'] for step in (1, 2, 3)] + [figures['latent.operations']]
    assert len(set(steps)) == 1 and steps[0] > 1e6
    counted = sum(value for name, value in figures.items() if name.endswith('.operations'))
    assert abs(counted / figures['operations'] - 1) < 1e-9
    stages = sum(value for name, value in figures.items() if name.endswith('.seconds'))
    assert 0 < figures['decoding.seconds'] < stages < figures['seconds']
    table = generate(files, 'image.png', 't.ply', '--anchors', 40, '--timings').stdout
    assert 'GFLOP/s' in table and 'decoding' in table


def test_estimate_alone_writes_nothing(files):
    figures = json.loads(run(files / 'image.png', '--weights', files / 'weights', *SMALL, '--estimate', '--json').stdout)
    assert figures['weight_bytes'] == sum(f.stat().st_size for f in (files / 'weights').iterdir())


def test_errors_are_one_line_and_say_what_to_do(files, tmp_path):
    assert 'huggingface.co' in error(files / 'image.png', tmp_path / 'a.ply', '--weights', tmp_path, *SMALL)
    assert 'no_such' in error(files / 'image.png', tmp_path / 'a.ply', '--weights', files / 'no_such', *SMALL)
    assert '.ply' in error(files / 'image.png', tmp_path / 'a.txt', '--weights', files / 'weights', *SMALL)
    assert 'steps' in error(files / 'image.png', tmp_path / 'a.ply', '--weights', files / 'weights', *SIZES, '--steps', 2000)
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_was_interrupted_goes_on_to_the_same_splats(files):
    """Many steps, so that the signal comes while it samples."""
    state = files / 'state.stipple.safetensors'
    many = ('--steps', 300, '--anchors', 40)
    run(files / 'image.png', files / 'whole.ply', '--weights', files / 'weights', *SIZES, *many)
    arguments = [TOOL, 'generate', files / 'image.png', files / 'resumed.ply', '--weights', files / 'weights', *SIZES,
                 *many, '--checkpoint', state]
    process = subprocess.Popen(list(map(str, arguments)), stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    until = time.monotonic() + 60
    while not state.exists() and time.monotonic() < until:
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    assert process.wait(60) == 128 + signal.SIGINT
    assert state.exists() and not (files / 'resumed.ply').exists()
    subprocess.run(list(map(str, arguments)), check=True, timeout=120, stdout=subprocess.DEVNULL)
    assert (files / 'resumed.ply').read_bytes() == (files / 'whole.ply').read_bytes()
    assert not state.exists()
