"""Splat files that the tool writes, read by programs of others."""
import json
import os
import re
import struct
import subprocess
import sys
from pathlib import Path

import numpy
import pytest
from node_packages import gltf_issues, splat_transform, usd_layer

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import usd_schema  # noqa: E402

TOOL = Path(os.environ['STIPPLE_BUILD_DIR']) / 'bin' / 'stipple'
COUNT = 3000


def run(*arguments):
    result = subprocess.run([TOOL, *map(str, arguments)], capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, (arguments, result.stdout, result.stderr)
    return result.stdout


def read_ply(path):
    """Columns of a binary PLY of float32 properties."""
    data = path.read_bytes()
    end = data.index(b'end_header\n') + len(b'end_header\n')
    header = data[:end].decode()
    names = re.findall(r'^property float (\w+)$', header, re.M)
    count = int(re.search(r'^element vertex (\d+)$', header, re.M).group(1))
    rows = numpy.frombuffer(data, '<f4', count * len(names), end).reshape(count, len(names))
    return dict(zip(names, rows.T))


@pytest.fixture(scope='module')
def ply(tmp_path_factory):
    """A cloud of degree 3 with all kinds of numbers."""
    path = tmp_path_factory.mktemp('splats') / 'cloud.ply'
    random = numpy.random.default_rng(1)
    names = ['x', 'y', 'z', 'nx', 'ny', 'nz', *(f'f_dc_{i}' for i in range(3)), *(f'f_rest_{i}' for i in range(45)),
             'opacity', *(f'scale_{i}' for i in range(3)), *(f'rot_{i}' for i in range(4))]
    rows = random.normal(size=(COUNT, len(names))).astype('<f4')
    rows[:, names.index('scale_0'):names.index('rot_0')] -= 4
    rows[:, 9:54] *= 0.1
    header = f'ply\nformat binary_little_endian 1.0\nelement vertex {COUNT}\n'
    header += ''.join(f'property float {name}\n' for name in names) + 'end_header\n'
    path.write_bytes(header.encode() + rows.tobytes())
    return path


@pytest.mark.parametrize('name', ['cloud.sog', 'folder/meta.json'])
def test_splat_transform_reads_our_sog_as_we_do(ply, tmp_path, name):
    sog = tmp_path / name
    sog.parent.mkdir(exist_ok=True)
    run('convert', ply, sog)
    splat_transform('-w', sog, tmp_path / 'theirs.ply')
    run('convert', sog, tmp_path / 'ours.ply')
    ours, theirs = read_ply(tmp_path / 'ours.ply'), read_ply(tmp_path / 'theirs.ply')
    assert len(theirs['x']) == COUNT
    for column in theirs:
        # They clamp opacities to 1e-6..1 - 1e-6 before the logit.
        known = ours[column].clip(-13.8, 13.8) if column == 'opacity' else ours[column]
        # float32's rounding of exponentials and logarithms.
        numpy.testing.assert_allclose(theirs[column], known, rtol=2e-6, atol=2e-6, err_msg=column)


def test_splat_transform_reads_our_streamed_sog_as_we_do(ply, tmp_path):
    run('convert', ply, tmp_path / 'lod-meta.json')
    splat_transform('-w', tmp_path / 'lod-meta.json', tmp_path / 'theirs.ply')
    run('convert', tmp_path / 'lod-meta.json', tmp_path / 'ours.ply')
    ours, theirs = read_ply(tmp_path / 'ours.ply'), read_ply(tmp_path / 'theirs.ply')
    assert len(theirs['x']) == COUNT
    for column in ('x', 'f_dc_0', 'f_rest_44', 'scale_2', 'rot_3'):
        numpy.testing.assert_allclose(theirs[column], ours[column], rtol=2e-6, atol=2e-6, err_msg=column)


def test_splat_transform_reads_every_level_of_our_streamed_sog(ply, tmp_path):
    run('convert', ply, tmp_path / 'lod-meta.json', '--levels', 3)
    for level, count in enumerate((COUNT, COUNT // 4, COUNT // 16)):
        splat_transform('-w', '-L', level, tmp_path / 'lod-meta.json', tmp_path / 'theirs.ply')
        run('convert', tmp_path / f'{level}_0' / 'meta.json', tmp_path / 'ours.ply')
        ours, theirs = read_ply(tmp_path / 'ours.ply'), read_ply(tmp_path / 'theirs.ply')
        assert len(theirs['x']) == count
        for column in ('x', 'f_dc_0', 'f_rest_44', 'scale_2', 'rot_3'):
            numpy.testing.assert_allclose(theirs[column], ours[column], rtol=2e-6, atol=2e-6, err_msg=column)


def test_we_read_the_streamed_sog_of_splat_transform_as_it_does(ply, tmp_path):
    splat_transform('-w', '-g', 'cpu', '-i', '1', ply, '-l', '0', ply, '-l', '1', tmp_path / 'lod' / 'lod-meta.json')
    splat_transform('-w', '-L', '0', tmp_path / 'lod' / 'lod-meta.json', tmp_path / 'theirs.ply')
    run('convert', tmp_path / 'lod' / 'lod-meta.json', tmp_path / 'ours.ply')
    ours, theirs = read_ply(tmp_path / 'ours.ply'), read_ply(tmp_path / 'theirs.ply')
    for column in ('x', 'f_dc_0', 'f_rest_44', 'scale_2', 'rot_3'):
        numpy.testing.assert_allclose(theirs[column], ours[column], rtol=2e-6, atol=2e-6, err_msg=column)


def test_we_read_the_sog_of_splat_transform_as_it_does(ply, tmp_path):
    splat_transform('-w', '-g', 'cpu', '-i', '1', ply, tmp_path / 'theirs.sog')
    splat_transform('-w', tmp_path / 'theirs.sog', tmp_path / 'theirs.ply')
    run('convert', tmp_path / 'theirs.sog', tmp_path / 'ours.ply')
    ours, theirs = read_ply(tmp_path / 'ours.ply'), read_ply(tmp_path / 'theirs.ply')
    for column in theirs:
        known = ours[column].clip(-13.8, 13.8) if column == 'opacity' else ours[column]
        numpy.testing.assert_allclose(theirs[column], known, rtol=2e-6, atol=2e-6, err_msg=column)


def frame_of(name):
    """splat-transform leaves positions as they are in an SPZ file, which is RUB, when it writes a PLY."""
    return ('--frame', 'RUB') if name.endswith('.spz') else ()


@pytest.mark.parametrize('name, version', [('cloud.spz', 3), ('cloud.spz', 4), ('cloud.compressed.ply', 0),
                                           ('cloud.splat', 0)])
def test_splat_transform_reads_our_packed_files_as_we_do(ply, tmp_path, name, version):
    packed = tmp_path / name
    run('convert', ply, packed, '--format-version', version)
    splat_transform('-w', packed, tmp_path / 'theirs.ply')
    run('convert', packed, tmp_path / 'ours.ply', *frame_of(name))
    ours, theirs = read_ply(tmp_path / 'ours.ply'), read_ply(tmp_path / 'theirs.ply')
    assert len(theirs['x']) == COUNT
    for column in theirs:
        if column.startswith('rot_'):
            continue
        # They clamp opacities to 1e-6..1 - 1e-6 before the logit, where bytes say 0 and 1.
        known = ours[column].clip(-13.8, 13.8) if column == 'opacity' else ours[column]
        given = theirs[column].clip(-13.8, 13.8) if column == 'opacity' else theirs[column]
        # float32's rounding of exponentials and logarithms; near opacity 1 the logit multiplies it.
        numpy.testing.assert_allclose(given, known, rtol=1e-5, atol=2e-5, err_msg=column)
    turns = [numpy.stack([rows[f'rot_{i}'] for i in range(4)], axis=1).astype(float) for rows in (ours, theirs)]
    turns = [turn / numpy.linalg.norm(turn, axis=1, keepdims=True) for turn in turns]
    cosines = abs((turns[0] * turns[1]).sum(axis=1)).clip(0, 1)
    # Bytes of .splat count from 128 for the viewer that made the format, from 127.5 for splat-transform: half of
    # 1/128 in each of four numbers, of a vector whose length is within 2 % of 1.
    allowed = 2 * 2 * 0.5 / 127.5 * 1.02 if name.endswith('.splat') else 2e-3
    assert 2 * numpy.arccos(cosines).max() <= allowed


@pytest.mark.parametrize('name', ['cloud.spz', 'cloud.compressed.ply'])
def test_our_packed_files_lose_no_more_than_those_of_splat_transform(ply, tmp_path, name):
    errors = {}
    first = read_ply(ply)
    for who in ('ours', 'theirs'):
        packed = tmp_path / who / name
        packed.parent.mkdir()
        if who == 'ours':
            run('convert', ply, packed)
        else:
            splat_transform('-w', ply, packed)
        run('convert', packed, tmp_path / 'back.ply', *(frame_of(name) if who == 'theirs' else ()))
        back = read_ply(tmp_path / 'back.ply')
        points = numpy.stack([back[axis] for axis in 'xyz'], axis=1)
        order = [((points - point) ** 2).sum(axis=1).argmin()
                 for point in numpy.stack([first[axis] for axis in 'xyz'], axis=1)]
        columns = [name for name in first if not name.startswith(('n', 'rot_', 'opacity'))]
        errors[who] = {column: abs(back[column][order] - first[column]).mean() for column in columns}
    for column, error in errors['ours'].items():
        # Cells of their Morton curve differ from ours, and with them the ranges of the chunks: 3 % of slack.
        assert error <= errors['theirs'][column] * 1.03 + 1e-9, column


@pytest.mark.parametrize('name', ['cloud.glb', 'cloud.gltf'])
def test_the_khronos_validator_finds_no_fault_but_that_it_does_not_know_the_extension(ply, tmp_path, name):
    gltf = tmp_path / name
    run('convert', ply, gltf)
    issues = gltf_issues(gltf)
    # Its list of names is older than KHR_gaussian_splatting, which prescribes these: an error each, and one remark.
    prescribed = ['ROTATION', 'SCALE', 'OPACITY']
    prescribed += [f'SH_DEGREE_{degree}_COEF_{m}' for degree in range(4) for m in range(2 * degree + 1)]
    start = '/meshes/0/primitives/0/attributes/KHR_gaussian_splatting:'
    expected = [(0, 'MESH_PRIMITIVE_INVALID_ATTRIBUTE', start + attribute) for attribute in prescribed]
    expected += [(2, 'UNSUPPORTED_EXTENSION', '/extensionsUsed/0')]
    assert sorted((issue['severity'], issue['code'], issue['pointer']) for issue in issues) == sorted(expected)


def test_the_khronos_validator_finds_planted_faults(ply, tmp_path):
    gltf = tmp_path / 'cloud.glb'
    run('convert', ply, gltf)
    data = gltf.read_bytes()
    length = struct.unpack('<I', data[12:16])[0]
    planted = data[:20] + data[20:20 + length].replace(b'"count":3000', b'"count":9000', 1) + data[20 + length:]
    gltf.write_bytes(planted)
    assert any(issue['code'] != 'MESH_PRIMITIVE_INVALID_ATTRIBUTE' for issue in gltf_issues(gltf)
               if issue['severity'] == 0)


def test_glb_is_splats_or_a_mesh_by_its_content(ply, tmp_path):
    run('convert', ply, tmp_path / 'cloud.glb')
    assert 'splats' in run('info', tmp_path / 'cloud.glb')
    figures = run('compare', ply, tmp_path / 'cloud.glb')
    assert 'max' in figures or 'position' in figures


def usd_array(layer, name):
    """The numbers of an attribute in the text of a layer."""
    text = re.search(rf'\]? {name} = \[(.*?)\]\n', layer, re.S).group(1)
    return numpy.array(re.findall(r'-?[\d.]+(?:e[+-]?\d+)?', text), 'f4')


@pytest.mark.parametrize('extension', ['.usda', '.usdz'])
def test_tinyusdz_reads_our_usd_as_it_is(ply, tmp_path, extension):
    run('convert', ply, tmp_path / f'cloud{extension}')
    layer = usd_layer(tmp_path / f'cloud{extension}')
    assert 'def ParticleField3DGaussianSplat "Splats"' in layer and 'upAxis = "Y"' in layer
    assert 'metersPerUnit = 1\n' in layer and 'defaultPrim = "Splats"' in layer
    assert 'uniform int radiance:sphericalHarmonicsDegree = 3' in layer
    run('convert', ply, tmp_path / 'ours.ply', '--frame', 'RUB')
    ours = read_ply(tmp_path / 'ours.ply')

    def columns(*names):
        return numpy.stack([ours[name] for name in names], axis=1)
    expected = {
        'positions': columns('x', 'y', 'z'), 'orientations': columns(*(f'rot_{i}' for i in range(4))),
        'scales': numpy.exp(columns(*(f'scale_{i}' for i in range(3)))), 'opacities': 1 / (1 + numpy.exp(-ours['opacity'])),
        # A PLY has channel by channel, the schema coefficient by coefficient.
        'radiance:sphericalHarmonicsCoefficients': numpy.concatenate(
            [columns(*(f'f_dc_{i}' for i in range(3)))[:, None],
             columns(*(f'f_rest_{i}' for i in range(45))).reshape(-1, 3, 15).transpose(0, 2, 1)], axis=1)}
    for name, values in expected.items():
        numpy.testing.assert_allclose(usd_array(layer, name), values.ravel(), rtol=3e-6, atol=3e-6, err_msg=name)
    low, high = usd_array(layer, 'extent').reshape(2, 3)
    assert (low < expected['positions'].min(0)).all() and (high > expected['positions'].max(0)).all()


def test_tinyusdz_reads_our_halves(ply, tmp_path):
    run('convert', ply, tmp_path / 'single.usda')
    run('convert', ply, tmp_path / 'half.usda', '--half')
    single, half = (usd_layer(tmp_path / f'{name}.usda') for name in ('single', 'half'))
    for kind, name in (('quath', 'orientations'), ('half3', 'scales'), ('half', 'opacities'),
                       ('half3', 'radiance:sphericalHarmonicsCoefficients')):
        assert f'{kind}[] {name}h = [' in half
        numpy.testing.assert_allclose(usd_array(half, f'{name}h'), usd_array(single, name), rtol=2 ** -10, atol=1e-7)
    numpy.testing.assert_array_equal(usd_array(half, 'positions'), usd_array(single, 'positions'))


def test_openusd_reads_our_usd_as_it_is(ply, tmp_path):
    usd = pytest.importorskip('pxr.Usd', reason='OpenUSD is not installed')
    run('convert', ply, tmp_path / 'cloud.usda')
    run('convert', ply, tmp_path / 'ours.ply', '--frame', 'RUB')
    prim = usd.Stage.Open(str(tmp_path / 'cloud.usda')).GetDefaultPrim()
    assert prim.GetTypeName() == usd_schema.PRIM
    ours = read_ply(tmp_path / 'ours.ply')
    numpy.testing.assert_array_equal(numpy.array(prim.GetAttribute('positions').Get()),
                                     numpy.stack([ours[name] for name in 'xyz'], axis=1))
    assert len(prim.GetAttribute('radiance:sphericalHarmonicsCoefficients').Get()) == 16 * COUNT


@pytest.mark.parametrize('options', [(), ('--half',), ('--frame', 'RFU'), ('--degree', 0), ('--degree', 2)])
@pytest.mark.parametrize('extension', ['.usda', '.usdz'])
def test_our_usd_keeps_the_rules_of_the_schema(ply, tmp_path, extension, options):
    run('convert', ply, tmp_path / f'cloud{extension}', *options)
    assert usd_schema.faults(tmp_path / f'cloud{extension}') == []


@pytest.mark.parametrize('extension', ['.usda', '.usdz'])
def test_our_series_keep_the_rules_of_the_schema(ply, tmp_path, extension):
    run('decode', ply, tmp_path / 'few.ply', '--anchors', 500)
    run('series', tmp_path / 'few.ply', ply, tmp_path / 'few.ply', tmp_path / f'film{extension}', '--frame-rate', 24)
    assert usd_schema.faults(tmp_path / f'film{extension}') == []


@pytest.mark.parametrize('good, bad, fault', [
    ('point3f[] positions', 'float3[] positions', 'positions is of type float3[], not point3f[]'),
    ('point3f[] positions', 'point3f[] places', 'there are no positions'),
    ('uniform int', 'int', 'is not a uniform int'),
    ('Degree = 3', 'Degree = 2', 'has 800 rows, not 450'),
    ('float[] opacities = [\n', 'float[] opacities = [\n1.5,\n', 'opacities has 51 rows, not 50'),
    ('float[] opacities = [\n0.', 'float[] opacities = [\n-0.', 'an opacity lies outside 0 to 1'),
    ('float3[] scales = [\n(', 'float3[] scales = [\n(-', 'a scale is below zero'),
    ('quatf[] orientations = [\n(', 'quatf[] orientations = [\n(9', 'an orientation is no unit quaternion'),
    ('float3[] extent = [(-', 'float3[] extent = [(', 'a position lies outside the extent'),
    ('float3[] extent = [(', 'float3[] extent = [(0, 0, 0), (', 'extent does not have two corners'),
    ('defaultPrim = "Splats"', 'defaultPrim = "Sprats"', 'the default prim'),
    ('upAxis = "Y"', 'upAxis = "X"', 'upAxis is X'),
    ('def ParticleField3DGaussianSplat', 'def Points', 'there is no ParticleField3DGaussianSplat'),
    ('metersPerUnit = 1', 'metersPerUnit = 0', 'metersPerUnit is 0'),
    ('#usda 1.0', '#sdf 1.4.32', 'the first line'),
    ('"Splats"\n{', '"Splats"\n', 'is expected where'),
])
def test_broken_rules_are_found(ply, tmp_path, good, bad, fault):
    run('decode', ply, tmp_path / 'few.ply', '--anchors', 50)
    run('convert', tmp_path / 'few.ply', tmp_path / 'few.usda')
    text = (tmp_path / 'few.usda').read_text()
    assert good in text
    assert any(fault in found for found in usd_schema.faults_of_layer(text.replace(good, bad, 1)))


def test_we_read_the_usd_that_tinyusdz_writes(ply, tmp_path):
    run('convert', ply, tmp_path / 'ours.usda')
    (tmp_path / 'theirs.usda').write_text(usd_layer(tmp_path / 'ours.usda'))
    seen = json.loads(run('compare', tmp_path / 'ours.usda', tmp_path / 'theirs.usda', '--json'))
    assert seen['same_order'] == 1
    # It prints 6 digits or more.
    for name in ('position', 'rotation', 'opacity', 'sh'):
        assert seen[f'max_{name}'] < 1e-5, seen


def test_tinyusdz_reads_every_frame_of_our_series(ply, tmp_path):
    run('decode', ply, tmp_path / 'few.ply', '--anchors', 500)
    run('convert', tmp_path / 'few.ply', tmp_path / 'few.usda')
    seen = json.loads(run('series', tmp_path / 'few.ply', ply, tmp_path / 'film.usdz', '--frame-rate', 29.97, '--first',
                          7, '--json'))
    assert seen == {'frames': 2, 'splats': COUNT + 500}
    layer = usd_layer(tmp_path / 'film.usdz')
    assert 'timeCodesPerSecond = 29.97\n' in layer and 'startTimeCode = 7\n' in layer
    text = re.search(r'point3f\[\] positions.timeSamples = \{(.*?)\}', layer, re.S).group(1)
    frames = dict(re.findall(r'(\d+): \[(.*?)\]', text, re.S))
    assert {frame: rows.count('(') for frame, rows in frames.items()} == {'7': 500, '8': COUNT}
    numbers = numpy.array(re.findall(r'-?[\d.]+(?:e[+-]?\d+)?', frames['7']), 'f4')
    expected = usd_array(usd_layer(tmp_path / 'few.usda'), 'positions')
    numpy.testing.assert_array_equal(numbers, expected)
