# SPDX-License-Identifier: GPL-3.0-or-later
"""LPIPS of `stipple compare`, beside the same network in NumPy's doubles."""

import json
import struct
import zlib

import numpy as np
import pytest

from test_tool import error, figures

# Of each stage the side of its pool, and of each convolution number, inputs, outputs, kernel, stride, padding: the
# published networks, written down a second time.
ALEXNET = ((0, [(0, 3, 64, 11, 4, 2)]), (3, [(3, 64, 192, 5, 1, 2)]), (3, [(6, 192, 384, 3, 1, 1)]),
           (0, [(8, 384, 256, 3, 1, 1)]), (0, [(10, 256, 256, 3, 1, 1)]))
VGG16 = ((0, [(0, 3, 64, 3, 1, 1), (2, 64, 64, 3, 1, 1)]), (2, [(5, 64, 128, 3, 1, 1), (7, 128, 128, 3, 1, 1)]),
         (2, [(10, 128, 256, 3, 1, 1), (12, 256, 256, 3, 1, 1), (14, 256, 256, 3, 1, 1)]),
         (2, [(17, 256, 512, 3, 1, 1), (19, 512, 512, 3, 1, 1), (21, 512, 512, 3, 1, 1)]),
         (2, [(24, 512, 512, 3, 1, 1), (26, 512, 512, 3, 1, 1), (28, 512, 512, 3, 1, 1)]))
SHIFT, SCALE = np.array([-0.030, -0.088, -0.188]), np.array([0.458, 0.448, 0.450])


def random_weights(plan, seed=1):
    """{name: array}: of a size at which features neither vanish nor explode; weights of channels are not negative."""
    random = np.random.default_rng(seed)
    weights = {}
    for stage, (_, layers) in enumerate(plan):
        for number, inputs, outputs, kernel, _, _ in layers:
            name = f'net.slice{stage + 1}.{number}'
            deviation = np.sqrt(2.0 / (inputs * kernel * kernel))
            weights[f'{name}.weight'] = random.normal(0, deviation, (outputs, inputs, kernel, kernel))
            weights[f'{name}.bias'] = random.normal(0, 0.1, outputs)
        weights[f'lin{stage}.model.1.weight'] = random.uniform(0, 1, (1, layers[-1][2], 1, 1))
    return {name: values.astype(np.float32) for name, values in weights.items()}


def write_safetensors(path, tensors):
    header, offset = {}, 0
    for name, values in tensors.items():
        header[name] = {'dtype': 'F32', 'shape': values.shape, 'data_offsets': [offset, offset + values.nbytes]}
        offset += values.nbytes
    text = json.dumps(header).encode()
    with path.open('wb') as file:
        file.write(struct.pack('<Q', len(text)) + text)
        for values in tensors.values():
            file.write(values.tobytes())


def windows(image, kernel, stride):
    """[C,H',W',k,k] of an image [C,H,W]."""
    return np.lib.stride_tricks.sliding_window_view(image, (kernel, kernel), axis=(1, 2))[:, ::stride, ::stride]


def reference(plan, weights, images):
    """LPIPS of two images [H,W,3] of display values."""
    maps = [((2 * image.astype(np.float64) - 1 - SHIFT) / SCALE).transpose(2, 0, 1) for image in images]
    total = 0.0
    for stage, (pool, layers) in enumerate(plan):
        for which, image in enumerate(maps):
            if pool:
                image = windows(image, pool, 2).max(axis=(3, 4))
            for number, _, _, kernel, stride, padding in layers:
                name = f'net.slice{stage + 1}.{number}'
                padded = np.pad(image, ((0, 0), (padding, padding), (padding, padding)))
                image = np.tensordot(weights[f'{name}.weight'].astype(np.float64), windows(padded, kernel, stride),
                                     axes=((1, 2, 3), (0, 3, 4)))
                image = np.maximum(image + weights[f'{name}.bias'].astype(np.float64)[:, None, None], 0)
            maps[which] = image
        unit = [image / (np.sqrt((image ** 2).sum(axis=0)) + 1e-10) for image in maps]
        of_channels = weights[f'lin{stage}.model.1.weight'].astype(np.float64).reshape(-1, 1, 1)
        total += (of_channels * (unit[0] - unit[1]) ** 2).sum(axis=0).mean()
    return total


@pytest.fixture(scope='module')
def alex(tmp_path_factory):
    path = tmp_path_factory.mktemp('weights') / 'alex.safetensors'
    write_safetensors(path, random_weights(ALEXNET))
    return path


def pictures(shape=(47, 61)):
    """Bytes [H,W,3] of a picture of waves, and of the same with noise."""
    random = np.random.default_rng(3)
    y, x = np.mgrid[:shape[0], :shape[1]]
    one = 0.5 + 0.4 * np.stack([np.sin(0.2 * x), np.sin(0.17 * y), np.cos(0.1 * (x + y))], 2)
    two = one + random.normal(0, 0.1, one.shape)
    return [np.rint(255 * np.clip(image, 0, 1)).astype(np.uint8) for image in (one, two)]


def write_png(path, pixels):
    """pixels [H,W,1, 3 or 4] bytes."""
    height, width, channels = pixels.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)], 1)

    def chunk(name, data):
        return struct.pack('>I', len(data)) + name + data + struct.pack('>I', zlib.crc32(name + data))
    header = struct.pack('>IIBBBBB', width, height, 8, {1: 0, 3: 2, 4: 6}[channels], 0, 0, 0)
    path.write_bytes(b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', header) + chunk(b'IDAT', zlib.compress(rows.tobytes()))
                     + chunk(b'IEND', b''))
    return path


@pytest.fixture
def pair(tmp_path):
    return [write_png(tmp_path / name, pixels) for name, pixels in zip(('a.png', 'b.png'), pictures())]


def lpips(a, b, weights):
    return figures('compare', a, b, '--lpips', weights)['lpips']


@pytest.mark.parametrize('plan', [ALEXNET, VGG16], ids=['alexnet', 'vgg16'])
def test_gives_what_the_network_gives(tmp_path, pair, plan):
    weights = random_weights(plan)
    write_safetensors(tmp_path / 'w.safetensors', weights)
    seen = figures('compare', *pair, '--lpips', tmp_path / 'w.safetensors')
    expected = reference(plan, weights, [image / 255 for image in pictures()])
    assert expected > 0.01
    # Sums of up to 4,608 products in float32, 13 layers deep.
    assert seen['lpips'] == pytest.approx(expected, rel=2e-5)
    assert seen['psnr'] < 30 and 'ssim' in seen


def test_scaling_of_the_file_counts(tmp_path, pair, alex):
    weights = random_weights(ALEXNET)
    usual = lpips(*pair, alex)
    for name, values in (('scaling_layer.shift', SHIFT), ('scaling_layer.scale', SCALE)):
        weights[name] = values.astype(np.float32).reshape(1, 3, 1, 1)
    write_safetensors(tmp_path / 'same.safetensors', weights)
    assert lpips(*pair, tmp_path / 'same.safetensors') == usual
    weights['scaling_layer.scale'] = 2 * weights['scaling_layer.scale']
    write_safetensors(tmp_path / 'other.safetensors', weights)
    assert lpips(*pair, tmp_path / 'other.safetensors') != pytest.approx(usual, rel=1e-3)


def test_equal_and_grey_images(tmp_path, pair, alex):
    a, b = pair
    assert lpips(a, a, alex) == 0.0
    assert lpips(a, b, alex) == lpips(b, a, alex) > 0
    grey = pictures()[0][..., :1]
    one = write_png(tmp_path / 'one.png', grey)
    assert lpips(one, one, alex) == 0.0


def test_transparent_images_are_over_black(tmp_path, alex):
    clear, black = np.zeros((2, 40, 40, 4), np.uint8)
    clear[..., :3], black[..., 3] = 255, 255
    paths = [write_png(tmp_path / name, pixels) for name, pixels in (('clear.png', clear), ('black.png', black))]
    assert lpips(*paths, alex) == 0.0


def test_features_of_nothing_are_no_division_by_zero(tmp_path, pair):
    write_safetensors(tmp_path / 'zero.safetensors',
                      {name: np.zeros_like(values) for name, values in random_weights(ALEXNET).items()})
    assert lpips(*pair, tmp_path / 'zero.safetensors') == 0.0


def test_errors_are_one_sentence(tmp_path, pair, alex):
    small = write_png(tmp_path / 'small.png', pictures((20, 20))[0])
    assert 'LPIPS needs 31 along each side' in error('compare', small, small, '--lpips', alex)
    assert 'nowhere.safetensors' in error('compare', *pair, '--lpips', tmp_path / 'nowhere.safetensors')
    weights = random_weights(ALEXNET)
    del weights['lin3.model.1.weight']
    write_safetensors(tmp_path / 'less.safetensors', weights)
    assert 'lin3.model.1.weight' in error('compare', *pair, '--lpips', tmp_path / 'less.safetensors')
    weights = random_weights(ALEXNET)
    weights['net.slice4.8.bias'][7] = np.nan
    write_safetensors(tmp_path / 'nan.safetensors', weights)
    assert 'net.slice4.8.bias' in error('compare', *pair, '--lpips', tmp_path / 'nan.safetensors')
    splats = tmp_path / 's.ply'
    splats.write_bytes(b'ply\n')
    assert '--lpips compares images' in error('compare', splats, splats, '--lpips', alex)
