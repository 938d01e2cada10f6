# SPDX-License-Identifier: GPL-3.0-or-later
"""The program that compares networks with golden files finds what is wrong, where it is wrong."""
import json
import os
import struct
import subprocess
from pathlib import Path

import pytest

PROGRAM = Path(os.environ['STIPPLE_BUILD_DIR']) / 'tests' / 'network_golden'
GOLDENS = Path(__file__).resolve().parents[1] / 'data' / 'networks'


class Golden:
    """A golden file whose numbers can be changed."""

    def __init__(self, name):
        data = (GOLDENS / name).read_bytes()
        self._begin = 8 + struct.unpack('<Q', data[:8])[0]
        self.header = json.loads(data[8:self._begin])
        self._numbers = bytearray(data[self._begin:])

    def add_to(self, tensor, index, value):
        at = self.header[tensor]['data_offsets'][0] + 4 * index
        assert self.header[tensor]['dtype'] == 'F32'
        number = struct.unpack('<f', self._numbers[at:at + 4])[0] + value
        self._numbers[at:at + 4] = struct.pack('<f', number)

    def flip_byte(self, tensor, index):
        self._numbers[self.header[tensor]['data_offsets'][0] + index] ^= 1

    def without(self, prefix):
        """Tensors that are left out by name; their numbers stay in the file."""
        kept = {name: about for name, about in self.header.items() if not name.startswith(prefix)}
        self.header = kept

    def write(self, path):
        header = json.dumps(self.header).encode()
        path.write_bytes(struct.pack('<Q', len(header)) + header + self._numbers)
        return path


def judge(*paths):
    done = subprocess.run([PROGRAM, *paths], capture_output=True, text=True, timeout=120)
    return done.returncode, done.stdout


def failures(output):
    return [line.split()[1] for line in output.splitlines() if line.startswith('FAIL')]


@pytest.fixture
def dino():
    return Golden('deg_dino_a.safetensors')


def test_a_number_beyond_its_tolerance_is_found_in_its_stage(dino, tmp_path):
    dino.add_to('expect.layer1.attn', 77, 1e-4)
    code, output = judge(dino.write(tmp_path / 'changed.safetensors'))
    assert code == 1
    assert failures(output) == ['layer1.attn']
    assert ' at 77 ' in output


def test_a_number_within_its_tolerance_passes(dino, tmp_path):
    dino.add_to('expect.layer1.attn', 77, 5e-6)
    assert judge(dino.write(tmp_path / 'changed.safetensors'))[0] == 0


def test_numbers_that_are_not_finite_fail(dino, tmp_path):
    dino.add_to('expect.norm', 3, float('nan'))
    code, output = judge(dino.write(tmp_path / 'changed.safetensors'))
    assert (code, failures(output)) == (1, ['norm'])


def test_a_weight_that_differs_is_found_from_its_layer_on(tmp_path):
    vae = Golden('deg_vae_a.safetensors')
    vae.add_to('weights.encoder.down_blocks.1.resnets.1.conv2.weight', 5, 0.05)
    code, output = judge(vae.write(tmp_path / 'changed.safetensors'))
    assert code == 1
    assert failures(output)[0] == 'down1.res1'
    assert 'feature2' in failures(output)


def test_a_single_bit_of_a_prepared_image_is_found(tmp_path):
    pipeline = Golden('deg_pipeline_a.safetensors')
    pipeline.flip_byte('expect.prep.cropped', 4000)
    code, output = judge(pipeline.write(tmp_path / 'changed.safetensors'))
    assert (code, failures(output)) == (1, ['prep.cropped'])
    assert 'the first at 4000' in output


def test_a_tensor_that_is_missing_fails_with_its_name(dino, tmp_path):
    dino.without('weights.layer.1.mlp.down_proj.weight')
    code, output = judge(dino.write(tmp_path / 'changed.safetensors'))
    assert code == 1
    assert 'layer.1.mlp.down_proj.weight' in output


def test_a_file_without_a_stage_fails(dino, tmp_path):
    dino.without('weights.')
    code, output = judge(dino.write(tmp_path / 'changed.safetensors'))
    assert code == 1
    assert 'no stage that is known here' in output


def test_one_file_of_several_that_fails_fails_all(dino, tmp_path):
    dino.add_to('expect.feature1', 0, 1.0)
    code, output = judge(dino.write(tmp_path / 'changed.safetensors'), GOLDENS / 'deg_vae_a.safetensors')
    assert code == 1
    assert 'mid.attn' in output


def test_what_is_no_such_file_fails_with_a_sentence(tmp_path):
    (tmp_path / 'text.safetensors').write_text('not a file of weights')
    for path in (tmp_path / 'text.safetensors', tmp_path / 'missing.safetensors'):
        code, output = judge(path)
        assert code == 1 and path.name in output


def measured(*arguments):
    """Exit status, {file: {stage: root of the mean square of errors over that of numbers}}."""
    done = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, timeout=120)
    found = {}
    for line in done.stdout.splitlines():
        if line.endswith('.safetensors'):
            stages = found.setdefault(Path(line).name, {})
        elif 'root of mean square' in line:
            stages[' '.join(line.split('largest')[0].split()[1:])] = float(line.split('root of mean square ')[1].split()[0])
    return done.returncode, found


# Rounding to float16 moves a weight by at most 2^-11 of it, and by 2^-11 / sqrt(3) of it, at the most, in the root of the
# mean square. Sums of many such products are off by the same share, since errors have any sign. What layers add to each
# other grows with the root of their number: the small networks have at most 40 matrices one behind the other, four steps
# of the sampler add up to twice that, and guidance 3 multiplies errors by sqrt(3^2 + 2^2) at the most.
FLOAT16_BOUND = 2**-11 / 3**0.5 * 40**0.5 * 2 * 13**0.5


def test_weights_of_16_bits_are_off_by_no_more_than_their_rounding_explains():
    goldens = sorted(GOLDENS.glob('*.safetensors'))
    code, found = measured('--weights', 'float16', *goldens)
    assert code == 0 and len(found) == len(goldens)
    for name, stages in found.items():
        assert max(stages.values()) < FLOAT16_BOUND, (name, stages)
    for name, stage in (('deg_vae_a', 'tokens'), ('deg_flow_a', 'velocity.latent'), ('deg_decoder_a', 'features')):
        assert found[f'{name}.safetensors'][stage] > 1e-5  # they are rounded, as float32 would not show
    # Eight times as coarse, so that the errors are about eight times as large.
    _, coarse = measured('--weights', 'bfloat16', *goldens)
    for name, stage in (('deg_vae_a', 'tokens'), ('deg_flow_a', 'velocity.latent'), ('deg_decoder_a', 'features')):
        ratio = coarse[f'{name}.safetensors'][stage] / found[f'{name}.safetensors'][stage]
        assert 4 < ratio < 20, (name, ratio)


def test_products_of_bfloat16_are_told_from_those_of_float32():
    golden = GOLDENS / 'deg_flow_a.safetensors'
    code, found = measured('--precision', 'float32', golden)
    assert code == 0 and found[golden.name]['velocity.latent'] < 1e-5
    code, found = measured('--precision', 'bfloat16', golden)
    if code == 2:
        pytest.skip('no products of bfloat16 on this machine')
    assert code == 0 and 1e-4 < found[golden.name]['velocity.latent'] < 3e-2


def test_numbers_that_are_unknown_are_refused_with_those_that_are_allowed():
    done = subprocess.run([PROGRAM, '--weights', 'float8', GOLDENS / 'deg_vae_a.safetensors'], capture_output=True, text=True,
                          timeout=120)
    assert done.returncode == 2 and "'float8'" in done.stderr and 'float16 or bfloat16' in done.stderr
