"""Generated splats by the tool: a latent whose weights lie in a folder of their own."""
import os
import subprocess
import sys
from pathlib import Path

import pytest
from test_tool import TOOL, figures

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import pipeline_weights  # noqa: E402


@pytest.fixture
def asset(tmp_path):
    (tmp_path / 'weights').mkdir()
    pipeline_weights.split(tmp_path / 'weights')
    pipeline_weights.write_latent(tmp_path / 'thing.stipple.safetensors', tmp_path / 'weights/decoder.safetensors')
    return tmp_path / 'thing.stipple.safetensors'


def run(*arguments, weights=None, status=0):
    environment = {name: value for name, value in os.environ.items() if name != 'STIPPLE_WEIGHTS'}
    if weights is not None:
        environment['STIPPLE_WEIGHTS'] = str(weights)
    result = subprocess.run([TOOL, *map(str, arguments)], capture_output=True, text=True, timeout=120, env=environment)
    assert result.returncode == status, (arguments, result.stdout, result.stderr)
    return result


def test_a_latent_decodes_to_any_budget(asset, tmp_path):
    for anchors in (32, 100):
        run('decode', asset, tmp_path / f'{anchors}.ply', '--anchors', anchors, weights=tmp_path / 'weights')
        assert figures('info', tmp_path / f'{anchors}.ply')['count'] == 32 * anchors
    told = run('info', asset, weights=tmp_path / 'weights').stdout
    assert 'generated splats' in told and '1024' in told and '8192' in told


def test_without_a_budget_it_is_one_that_the_networks_learned_with(asset, tmp_path):
    run('decode', asset, tmp_path / 'usual.ply', weights=tmp_path / 'weights')
    assert figures('info', tmp_path / 'usual.ply')['count'] == 32 * 2048


def test_the_order_and_the_seed_change_what_is_drawn(asset, tmp_path):
    def decoded(name, *options):
        run('decode', asset, tmp_path / name, '--anchors', 64, *options, weights=tmp_path / 'weights')
        return (tmp_path / name).read_bytes()
    first = decoded('a.ply')
    assert decoded('b.ply') == first
    assert decoded('c.ply', '--order', 'progressive') != first
    assert decoded('d.ply', '--seed', 1) != first
    assert decoded('e.ply', '--gaussians-per-anchor', 32) == first


def test_a_saved_latent_stays_small_and_decodes_to_the_same_splats(asset, tmp_path):
    again = tmp_path / 'again.stipple.safetensors'
    run('decode', asset, again, weights=tmp_path / 'weights')
    assert again.stat().st_size < 8192
    for name, source in (('a.ply', asset), ('b.ply', again)):
        run('decode', source, tmp_path / name, '--anchors', 40, weights=tmp_path / 'weights')
    assert (tmp_path / 'a.ply').read_bytes() == (tmp_path / 'b.ply').read_bytes()


def test_missing_weights_are_named_in_one_sentence(asset, tmp_path):
    def refused(weights):
        result = run('decode', asset, tmp_path / 'no.ply', '--anchors', 64, weights=weights, status=1)
        assert not (tmp_path / 'no.ply').exists()
        lines = result.stderr.strip().splitlines()
        assert lines[-1].startswith('stipple: '), lines
        return lines[-1]
    message = refused(None)
    assert 'decoder.safetensors' in message and 'no folder of weights is set' in message
    (tmp_path / 'empty').mkdir()
    message = refused(tmp_path / 'empty')
    assert 'decoder.safetensors' in message and str(tmp_path / 'empty') in message and 'does not have' in message
    assert str(tmp_path / 'nowhere') in refused(tmp_path / 'nowhere')


def test_a_budget_out_of_range_is_refused(asset, tmp_path):
    for anchors in (31, 31251):
        result = run('decode', asset, tmp_path / 'no.ply', '--anchors', anchors, weights=tmp_path / 'weights', status=1)
        assert f'{anchors} anchors; 32 to 31250 is allowed' in result.stderr
