# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers of EXR files, as OpenImageIO's own tool writes them."""

import shutil
import struct
import subprocess

import numpy as np
import pytest

OIIOTOOL = shutil.which('oiiotool')


@pytest.fixture
def channels_of(context):
    from stipple.binding.image import ImageChannels

    def read(path):
        channels = ImageChannels.load(context, path)
        return {name: channels.read(i) for i, name in enumerate(channels.names())}
    return read


def tool(*arguments):
    if OIIOTOOL is None:
        pytest.skip('oiiotool is not installed')
    subprocess.run([OIIOTOOL, *map(str, arguments)], check=True, capture_output=True)


def ramps(path, *how, size='48x33', names='ViewLayer.Combined.R,ViewLayer.Combined.G,ViewLayer.Depth.Z'):
    count = names.count(',') + 1
    tool('--pattern', 'fill:topleft=' + ','.join(['0'] * count) + ':bottomright=' + ','.join(
        str(k + 1) for k in range(count)) + ':topright=' + ','.join(['0.5'] * count) + ':bottomleft='
        + ','.join(['0.25'] * count), size, count, '--chnames', names, *how, '-o', path)
    return path


@pytest.mark.parametrize('compression', ['none', 'rle', 'zips', 'zip', 'piz', 'pxr24'])
@pytest.mark.parametrize('layout', [[], ['--tile', '16', '16']], ids=['scan-lines', 'tiles'])
def test_every_compression_and_layout_holds_the_same_values(channels_of, tmp_path, compression, layout):
    # 16 bits, which even PXR24 keeps whole.
    plain = channels_of(ramps(tmp_path / 'a.exr', '-d', 'half', '--compression', 'none'))
    found = channels_of(ramps(tmp_path / 'b.exr', '-d', 'half', '--compression', compression, *layout))
    assert set(found) == {'ViewLayer.Combined.R', 'ViewLayer.Combined.G', 'ViewLayer.Depth.Z'}
    for name, values in found.items():
        assert values.shape == (33, 48) and values.dtype == np.float32
        np.testing.assert_array_equal(values, plain[name])
    # Row 0 is the top: the corners are as they were asked for.
    depth = found['ViewLayer.Depth.Z']
    assert (depth[0, 0], depth[0, -1], depth[-1, 0], depth[-1, -1]) == (0, 0.5, 0.25, 3)


def test_halves_and_floats_may_stand_side_by_side(channels_of, tmp_path):
    found = channels_of(ramps(tmp_path / 'a.exr', '-d', 'half', '-d', 'ViewLayer.Depth.Z=float'))
    whole = channels_of(ramps(tmp_path / 'b.exr', '-d', 'float'))
    np.testing.assert_array_equal(found['ViewLayer.Depth.Z'], whole['ViewLayer.Depth.Z'])
    # Eleven bits of a half.
    np.testing.assert_allclose(found['ViewLayer.Combined.R'], whole['ViewLayer.Combined.R'], rtol=2**-11, atol=1e-7)


def test_integers_keep_their_values(channels_of, tmp_path):
    """Nothing scales the number of an object to a share of the largest integer."""
    path = tmp_path / 'a.exr'
    path.write_bytes(plain_exr({'IndexOB.X': np.arange(6, dtype='<u4').reshape(2, 3) * 1000,
                                'Depth.Z': np.linspace(-1, 1e9, 6, dtype='<f4').reshape(2, 3),
                                'Combined.R': np.linspace(0, 2, 6).astype('<f2').reshape(2, 3)}))
    found = channels_of(path)
    np.testing.assert_array_equal(found['IndexOB.X'], [[0, 1000, 2000], [3000, 4000, 5000]])
    np.testing.assert_array_equal(found['Depth.Z'], np.linspace(-1, 1e9, 6, dtype=np.float32).reshape(2, 3))
    np.testing.assert_array_equal(found['Combined.R'],
                                  np.linspace(0, 2, 6).astype(np.float16).astype(np.float32).reshape(2, 3))


def test_parts_lend_their_names_to_channels_without_one(channels_of, tmp_path):
    for name in ('colour', 'depth'):
        ramps(tmp_path / f'{name}.exr', '-d', 'float', names='R,G,B' if name == 'colour' else 'Z')
    tool(tmp_path / 'colour.exr', '--attrib', 'oiio:subimagename', 'View.Combined', tmp_path / 'depth.exr', '--attrib',
         'oiio:subimagename', 'View.Depth', '--siappend', '-o', tmp_path / 'both.exr')
    found = channels_of(tmp_path / 'both.exr')
    assert set(found) == {'View.Combined.R', 'View.Combined.G', 'View.Combined.B', 'View.Depth.Z'}
    np.testing.assert_array_equal(found['View.Depth.Z'], channels_of(tmp_path / 'depth.exr')['Z'])


def test_what_lies_outside_the_data_is_zero(channels_of, tmp_path):
    ramps(tmp_path / 'a.exr', '-d', 'float', names='R,G,B')
    whole = channels_of(tmp_path / 'a.exr')['G']
    tool(tmp_path / 'a.exr', '--cut', '10x7+5+3', '--origin', '+5+3', '--fullsize', '48x33+0+0', '-o',
         tmp_path / 'b.exr')
    part = channels_of(tmp_path / 'b.exr')['G']
    expected = np.zeros_like(whole)
    expected[3:10, 5:15] = whole[3:10, 5:15]
    np.testing.assert_array_equal(part, expected)


def test_files_that_are_no_whole_exr_are_refused(channels_of, context, tmp_path):
    from stipple.binding.context import Context
    from stipple.binding.errors import StippleError
    from stipple.binding.image import ImageChannels
    from stipple.binding.structs import Status

    values = np.zeros((40, 30), '<f4')
    whole = plain_exr({'Depth.Z': values})
    for content in (b'', b'12345678', whole[:30], whole[:-1], whole[:len(whole) // 2]):
        path = tmp_path / 'a.exr'
        path.write_bytes(content)
        with pytest.raises(StippleError, match='a.exr') as raised:
            channels_of(path)
        assert raised.value.status == Status.ERROR_FORMAT and '\n' not in str(raised.value)
    (tmp_path / 'a.exr').write_bytes(whole)
    small = Context(context.library, 1, values.nbytes - 1)
    with pytest.raises(StippleError, match=f'{values.nbytes} bytes in all') as raised:
        ImageChannels.load(small, tmp_path / 'a.exr')
    assert raised.value.status == Status.ERROR_MEMORY_LIMIT
    channels = ImageChannels.load(context, tmp_path / 'a.exr')
    with pytest.raises(StippleError, match='index is 1; the file has 1 channels'):
        channels.read(1)


def plain_exr(planes):
    """The bytes of an uncompressed file of scan lines. In: {name: [H,W] of '<u4', '<f2' or '<f4'}."""
    kinds = {'<u4': 0, '<f2': 1, '<f4': 2}
    names = sorted(planes)
    height, width = planes[names[0]].shape
    entries = b''.join(name.encode() + b'\0' + struct.pack('<iB3xii', kinds[planes[name].dtype.str], 0, 1, 1)
                       for name in names) + b'\0'
    window = struct.pack('<4i', 0, 0, width - 1, height - 1)
    header = b''
    for name, kind, value in (('channels', 'chlist', entries), ('compression', 'compression', b'\0'),
                              ('dataWindow', 'box2i', window), ('displayWindow', 'box2i', window),
                              ('lineOrder', 'lineOrder', b'\0'), ('pixelAspectRatio', 'float', struct.pack('<f', 1)),
                              ('screenWindowCenter', 'v2f', struct.pack('<2f', 0, 0)),
                              ('screenWindowWidth', 'float', struct.pack('<f', 1))):
        header += name.encode() + b'\0' + kind.encode() + b'\0' + struct.pack('<i', len(value)) + value
    head = struct.pack('<II', 20000630, 2) + header + b'\0'
    rows = [b''.join(planes[name][y].tobytes() for name in names) for y in range(height)]
    at, table, data = len(head) + 8 * height, b'', b''
    for y, row in enumerate(rows):
        table += struct.pack('<Q', at + len(data))
        data += struct.pack('<ii', y, len(row)) + row
    return head + table + data
