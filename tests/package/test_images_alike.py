# SPDX-License-Identifier: GPL-3.0-or-later
"""Images through OpenImageIO, as an ordinary build reads them, and through the decoders of a release: the same."""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from stipple.binding import library
from stipple.binding.context import Context
from stipple.binding.image import Image, ImageChannels
from stipple.binding.structs import Transfer

ROOT = Path(__file__).resolve().parents[2]
# OpenImageIO converts integers to float32 by a product, which a rounding may tell from ours.
EXACT = 1e-6
# OpenImageIO 2.4 multiplies the colours of a WebP image by alpha at 8 bits, ours stay straight.
EIGHT_BITS = 2.5 / 255

oiiotool = shutil.which('oiiotool')
RAMPS = ('--pattern', 'fill:topleft=0.1,0.9,0.3:topright=0.8,0.2,0.6:bottomleft=0.4,0.5,0.9:bottomright=1,1,0.05')
CASES = {
    'rgb.png': (*RAMPS, '61x47', '3', '-d', 'uint8'),
    'rgb16.png': (*RAMPS, '61x47', '3', '-d', 'uint16'),
    'grey.png': (*RAMPS, '61x47', '3', '--ch', 'R', '-d', 'uint8'),
    'rgb.jpg': (*RAMPS, '61x47', '3', '-d', 'uint8', '--quality', '88'),
    'grey.jpg': (*RAMPS, '61x47', '3', '--ch', 'R', '-d', 'uint8'),
    'rgb.webp': (*RAMPS, '61x47', '3', '-d', 'uint8'),
    'half.exr': (*RAMPS, '61x47', '3', '-d', 'half', '--compression', 'piz'),
    'float.exr': (*RAMPS, '61x47', '3', '-d', 'float', '--compression', 'zip'),
    'lossy.exr': (*RAMPS, '61x47', '3', '-d', 'half', '--compression', 'dwaa'),
    'window.exr': (*RAMPS, '61x47', '3', '-d', 'half', '--origin', '+5+7', '--fullsize', '80x70+0+0'),
    'outside.exr': (*RAMPS, '61x47', '3', '-d', 'float', '--origin', '-9-4', '--fullsize', '40x30+0+0'),
    'tiled.exr': (*RAMPS, '61x47', '3', '-d', 'half', '--tile', '16', '16'),
    'alpha.exr': (*RAMPS, '61x47', '3', '--ch', 'R,G,B,A=0.5', '-d', 'float'),
    'depth.exr': (*RAMPS, '61x47', '3', '--chnames', 'ViewLayer.Combined.R,ViewLayer.Combined.G,ViewLayer.Depth.Z'),
}


@pytest.fixture(scope='module')
def contexts(release):
    ordinary = Path(os.environ.get('STIPPLE_LIBRARY') or ROOT / 'build' / 'release' / 'lib' / 'libstipple.so')
    if not ordinary.is_file() or not ordinary.with_name('libstipple_media.so').is_file():
        pytest.skip(f'{ordinary} is not built with its media library')
    return [Context(library.load(path), threads=2) for path in (ordinary, release / 'lib' / 'libstipple.so')]


@pytest.fixture(scope='module')
def made(tmp_path_factory):
    if oiiotool is None:
        pytest.skip('oiiotool is not installed')
    folder = tmp_path_factory.mktemp('images')
    for name, how in CASES.items():
        pattern, size, channels, *rest = how[1:]
        subprocess.run([oiiotool, '--pattern', pattern, size, channels, *rest, '-o', folder / name], check=True,
                       stdout=subprocess.DEVNULL)
    return folder


def both(contexts, path):
    images = [Image.load(context, path) for context in contexts]
    facts = [{name: getattr(image.info(), name) for name, _ in image.info()._fields_ if name != 'struct_size'}
             for image in images]
    return facts, [image.read() for image in images]


@pytest.mark.parametrize('name', CASES)
def test_both_read_the_same(contexts, made, name):
    facts, pixels = both(contexts, made / name)
    assert facts[0] == facts[1]
    assert pixels[0].size > 100 and np.ptp(pixels[0]) > 0.1
    np.testing.assert_allclose(pixels[0], pixels[1], atol=EXACT)


@pytest.mark.parametrize('name', [name for name in CASES if name.endswith('.exr')])
def test_both_read_the_same_channels(contexts, made, name):
    first, second = (ImageChannels.load(context, made / name) for context in contexts)
    assert sorted(first.names()) == sorted(second.names())
    for index, channel in enumerate(first.names()):
        np.testing.assert_array_equal(first.read(index), second.read(second.names().index(channel)), channel)


def pictures():
    numbers = np.random.default_rng(5)
    alpha = numbers.random((23, 31, 1)).astype(np.float32)
    colour = numbers.random((23, 31, 3)).astype(np.float32)
    return {'grey': colour[..., :1], 'rgb': colour, 'rgba': np.concatenate([colour * alpha, alpha], -1)}


@pytest.mark.parametrize('kind', ['grey', 'rgb', 'rgba'])
@pytest.mark.parametrize('form', ['png', 'exr'])
def test_what_one_writes_the_other_reads(contexts, tmp_path, kind, form):
    transfer = Transfer.LINEAR if form == 'exr' else Transfer.SRGB
    for index, context in enumerate(contexts):
        Image.create(context, pictures()[kind], transfer).save(tmp_path / f'{index}.{form}')
    read = [both(contexts, tmp_path / f'{index}.{form}') for index in range(2)]
    assert read[0][0] == read[1][0] and read[0][0][0] == read[0][0][1]
    for pixels in (read[0][1][1], read[1][1][0], read[1][1][1]):
        np.testing.assert_allclose(read[0][1][0], pixels, atol=EXACT)


def test_alpha_of_webp_is_kept_straight(contexts, made, tmp_path):
    source = tmp_path / 'a.png'
    Image.create(contexts[0], pictures()['rgba'], Transfer.SRGB).save(source)
    subprocess.run([oiiotool, source, '--compression', 'lossless', '-o', tmp_path / 'a.webp'], check=True,
                   stdout=subprocess.DEVNULL)
    _, pixels = both(contexts, tmp_path / 'a.webp')
    np.testing.assert_allclose(pixels[0], pixels[1], atol=EIGHT_BITS)


@pytest.mark.parametrize('name', ['rgb.png', 'rgb16.png', 'rgb.jpg', 'rgb.webp', 'half.exr', 'float.exr'])
def test_cut_off_files_are_refused_by_both(contexts, made, tmp_path, name):
    data = (made / name).read_bytes()
    for kept in (3, 20, len(data) // 3, len(data) - len(data) // 10):
        (tmp_path / name).write_bytes(data[:kept])
        for context in contexts:
            with pytest.raises(Exception, match=name):
                Image.load(context, tmp_path / name).read()


def test_another_format_is_named_in_one_sentence(contexts, tmp_path):
    (tmp_path / 'a.tif').write_bytes(b'II*\0' + bytes(100))
    with pytest.raises(Exception, match='a.tif is not an image that can be read: this build reads PNG, JPEG, WebP and'):
        Image.load(contexts[1], tmp_path / 'a.tif')
