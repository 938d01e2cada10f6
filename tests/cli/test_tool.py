"""The command-line tool, from mesh to picture, and its one-line errors."""
import json
import math
import os
import struct
import subprocess
from array import array
from pathlib import Path

import pytest

TOOL = Path(os.environ['STIPPLE_BUILD_DIR']) / 'bin' / 'stipple'

CUBE_TRIANGLES = [0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                  2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5]


def run(*arguments, status=0):
    result = subprocess.run([TOOL, *map(str, arguments)], capture_output=True, text=True, timeout=120)
    assert result.returncode == status, (arguments, result.stdout, result.stderr)
    return result


def error(*arguments, status=1):
    """The single line of error of a call that must fail; a slow machine shows stages of a job before it."""
    lines = run(*arguments, status=status).stderr.strip().splitlines()
    assert [line.startswith('stipple: ') for line in lines] == [False] * (len(lines) - 1) + [True], lines
    return lines[-1]


def figures(*arguments):
    return json.loads(run(*arguments, '--json').stdout)


def write_cube_glb(path):
    """A red unit cube, as the smallest GLB there is."""
    positions = b''.join(struct.pack('<3f', *[0.5 if i >> axis & 1 else -0.5 for axis in range(3)])
                         for i in range(8))
    indices = struct.pack('<36H', *CUBE_TRIANGLES)
    document = json.dumps({
        'asset': {'version': '2.0'}, 'scene': 0, 'scenes': [{'nodes': [0]}], 'nodes': [{'mesh': 0}],
        'materials': [{'pbrMetallicRoughness': {'baseColorFactor': [1.0, 0.0, 0.0, 1.0]}}],
        'meshes': [{'primitives': [{'attributes': {'POSITION': 0}, 'indices': 1, 'material': 0}]}],
        'buffers': [{'byteLength': len(positions) + len(indices)}],
        'bufferViews': [{'buffer': 0, 'byteOffset': 0, 'byteLength': len(positions)},
                        {'buffer': 0, 'byteOffset': len(positions), 'byteLength': len(indices)}],
        'accessors': [{'bufferView': 0, 'componentType': 5126, 'count': 8, 'type': 'VEC3',
                       'min': [-0.5] * 3, 'max': [0.5] * 3},
                      {'bufferView': 1, 'componentType': 5123, 'count': 36, 'type': 'SCALAR'}],
    }).encode()
    document += b' ' * (-len(document) % 4)
    binary = positions + indices
    binary += b'\0' * (-len(binary) % 4)
    chunks = (struct.pack('<II', len(document), 0x4E4F534A) + document
              + struct.pack('<II', len(binary), 0x004E4942) + binary)
    path.write_bytes(struct.pack('<III', 0x46546C67, 2, 12 + len(chunks)) + chunks)


def write_camera(path, distance=3.0):
    """A camera on the z axis that looks down at the origin."""
    path.write_text(json.dumps({
        'camera_model': 'PINHOLE', 'w': 96, 'h': 64, 'fl_x': 90.0, 'fl_y': 90.0, 'cx': 48.0, 'cy': 32.0,
        'frames': [{'file_path': 'a.png', 'transform_matrix': [
            [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, distance], [0, 0, 0, 1]]}]}))


def write_shifted(source, path, x):
    """The splats of a PLY file, whose properties are floats and begin with the place, moved along x."""
    header, end, data = source.read_bytes().partition(b'end_header\n')
    assert header.count(b'property') == header.count(b'property float')
    values = array('f', data)
    for row in range(0, len(values), header.count(b'property')):
        values[row] += x
    path.write_bytes(header + end + values.tobytes())


@pytest.fixture(scope='module')
def scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp('tool')
    write_cube_glb(folder / 'cube.glb')
    write_camera(folder / 'transforms.json')
    run('decode', folder / 'cube.glb', folder / 'cube.ply', '--anchors', 5000)
    return folder


@pytest.fixture(scope='module')
def four_each(scene):
    """Another cloud of the cube: four splats around each anchor."""
    run('decode', scene / 'cube.glb', scene / 'k4.ply', '--anchors', 250, '--gaussians-per-anchor', 4,
        '--order', 'progressive', '--seed', 3)
    return scene / 'k4.ply'


def test_info_describes_a_data_set(tmp_path, scene):
    (tmp_path / 'images').mkdir()
    run('render', scene / 'cube.ply', '--camera', scene / 'transforms.json', '-o', tmp_path / 'images' / 'a.png')
    sparse = tmp_path / 'sparse' / '0'
    sparse.mkdir(parents=True)
    (sparse / 'cameras.txt').write_text('1 OPENCV 96 64 90 90 48 32 -0.1 0.02 0 0\n2 PINHOLE 96 64 90 90 48 32\n')
    (sparse / 'images.txt').write_text('1 1 0 0 0 0 0 3 1 a.png\n\n2 1 0 0 0 0 0 3 2 a.png\n\n')
    (sparse / 'points3D.txt').write_text('1 0 0 0 255 0 0 0.5 1 0\n')
    for path in (tmp_path, sparse, sparse / 'images.txt'):
        info = figures('info', path)
        assert (info['kind'], info['count'], info['points'], info['distorted']) == ('data set', 2, 1, 1)
        assert info['camera_models'] == 'OPENCV (1), PINHOLE (1)'
        assert info['sizes'] == '96 x 64'
    (tmp_path / 'images' / 'a.png').unlink()
    assert "'a.png' is missing" in error('info', tmp_path)


def test_info_describes_each_kind(scene):
    assert figures('info', scene / 'cube.glb')['triangles'] == 12
    splats = figures('info', scene / 'cube.ply')
    assert splats['count'] == 5000 and splats['colour_space'] == 'srgb_rec709_display'
    assert all(abs(value + 0.5) < 0.01 for value in splats['bounds_min'])
    cameras = figures('info', scene / 'transforms.json')
    assert (cameras['kind'], cameras['count']) == ('cameras', 1)
    assert 'a.png' in cameras['pictures']


def test_decode_gives_the_budget_times_k(four_each):
    assert figures('info', four_each)['count'] == 1000


ASSETS = Path(__file__).resolve().parents[1] / 'data' / 'assets'


def test_a_field_decodes_to_nested_budgets_whatever_the_order(scene):
    stored = ASSETS / 'whole_field_1.0.stipple.safetensors'
    run('decode', stored, scene / 'few.ply', '--anchors', 300)
    assert figures('info', scene / 'few.ply')['count'] == 1200
    run('decode', stored, scene / 'same.ply', '--anchors', 300, '--order', 'progressive')
    assert figures('compare', scene / 'few.ply', scene / 'same.ply')['max_position'] == 0


def test_a_field_whose_widths_do_not_fit_is_refused(scene):
    # Arrays alone: 16 Gaussians of 15 + 3 * 8 numbers are 624.
    message = error('decode', ASSETS / 'field_1.0.stipple.safetensors', scene / 'no.ply')
    assert "width of the network's output of the field is 64; 624 is needed" in message


def test_a_saved_model_decodes_to_the_same_splats(scene):
    run('decode', scene / 'cube.glb', scene / 'cube.stipple.safetensors')
    assert figures('info', scene / 'cube.stipple.safetensors')['kind'] == 'surface model'
    run('decode', scene / 'cube.stipple.safetensors', scene / 'again.ply', '--anchors', 5000)
    # Nothing moves in it.
    run('decode', scene / 'cube.stipple.safetensors', scene / 'later.ply', '--anchors', 5000, '--time', 2.5)
    assert (scene / 'later.ply').read_bytes() == (scene / 'again.ply').read_bytes()
    assert 'options->time' in error('decode', scene / 'cube.stipple.safetensors', scene / 'no.ply', '--time', 'nan')
    result = figures('compare', scene / 'cube.ply', scene / 'again.ply')
    assert result['same_order'] == 1 and result['max_position'] == 0


def test_splats_come_down_to_any_share_of_themselves(scene):
    run('decode', scene / 'cube.ply', scene / 'tree.stipple.safetensors')
    assert figures('info', scene / 'tree.stipple.safetensors')['kind'] == 'hierarchy of splats'
    run('decode', scene / 'tree.stipple.safetensors', scene / 'fifth.ply', '--ratio', 0.2)
    assert figures('info', scene / 'fifth.ply')['count'] == 1000
    run('decode', scene / 'tree.stipple.safetensors', scene / 'all.ply', '--anchors', 5000)
    result = figures('compare', scene / 'cube.ply', scene / 'all.ply')
    assert result['same_order'] == 1 and result['max_position'] == 0 and result['max_sh'] == 0
    run('decode', scene / 'tree.stipple.safetensors', scene / 'usual.ply')
    assert figures('info', scene / 'usual.ply')['count'] == 5000
    run('decode', scene / 'tree.stipple.safetensors', scene / 'refined.ply', '--anchors', 100, '--refine', 2)
    assert figures('info', scene / 'refined.ply')['count'] == 100
    cut, timed = scene / 'cut.ply', scene / 'timed.ply'
    run('decode', scene / 'tree.stipple.safetensors', cut, '--anchors', 100)
    run('decode', scene / 'tree.stipple.safetensors', timed, '--anchors', 100, '--refine-seconds', 3)
    assert figures('info', timed)['count'] == 100 and timed.read_bytes() != cut.read_bytes()
    assert '--refine-seconds is 0' in error('decode', scene / 'tree.stipple.safetensors', timed, '--refine-seconds', 0)
    for ratio in (1.5, 0, -0.1, 'nan'):
        assert '0 and up to 1' in error('decode', scene / 'cube.ply', scene / 'never.ply', '--ratio', ratio)
    assert '5000' in error('decode', scene / 'cube.ply', scene / 'never.ply', '--anchors', 5001)
    assert not (scene / 'never.ply').exists()


def test_convert_names_decode_for_the_surface_of_a_mesh(scene):
    run('decode', scene / 'cube.glb', scene / 'surface.stipple.safetensors')
    assert 'stipple decode' in error('convert', scene / 'surface.stipple.safetensors', scene / 'lod-meta.json')
    assert not (scene / 'lod-meta.json').exists()


def test_convert_to_text_and_back_loses_only_rounding(scene):
    run('convert', scene / 'cube.ply', scene / 'text.ply', '--ascii')
    result = figures('compare', scene / 'cube.ply', scene / 'text.ply')
    # exp and log in single precision: a few units in the last place.
    assert result['max_position'] == 0 and result['max_scale_ratio'] < 1e-5 and result['max_sh'] < 1e-6


def test_render_shows_a_red_cube_where_the_camera_looks(scene):
    run('render', scene / 'cube.ply', '--camera', scene / 'transforms.json', '-o', scene / 'a.png')
    run('render', scene / 'cube.ply', '--camera', scene / 'transforms.json', '-o', scene / 'a.exr')
    info = figures('info', scene / 'a.png')
    assert (info['width'], info['height'], info['channels']) == (96, 64, 4)
    same = figures('compare', scene / 'a.png', scene / 'a.exr')
    # The PNG has 8 bits: half a step, premultiplied, is 1/510; colour and alpha both round.
    assert same['max_error'] < 1.1 / 255
    run('render', scene / 'cube.ply', '--camera', scene / 'transforms.json', '-o', scene / 'double.exr',
        '--accuracy', 'double')
    assert figures('compare', scene / 'a.exr', scene / 'double.exr')['psnr'] > 70
    for accuracy in ('rays', 'reference'):
        run('render', scene / 'cube.ply', '--camera', scene / 'transforms.json', '-o', scene / 'exact.exr',
            '--accuracy', accuracy)
        # Splats of a few pixels: the affine projection is nearly right, the order of crossing ones is not.
        assert 30 < figures('compare', scene / 'a.exr', scene / 'exact.exr')['psnr'] < 70
    write_camera(scene / 'moved.json', distance=4.0)
    run('render', scene / 'cube.ply', '--camera', scene / 'moved.json', '-o', scene / 'moved.png')
    assert figures('compare', scene / 'a.png', scene / 'moved.png')['psnr'] < 25


def test_render_takes_sizes_and_several_files(scene, four_each):
    run('render', scene / 'cube.ply', four_each, '--camera', scene / 'transforms.json',
        '--width', 48, '-o', scene / 'small.png', '--background', 1, 1, 1)
    info = figures('info', scene / 'small.png')
    assert (info['width'], info['height']) == (48, 32)


def test_render_draws_files_apart(scene, four_each):
    both = scene / 'cube.ply', four_each, '--camera', scene / 'transforms.json'
    run('render', *both, '-o', scene / 'together.exr')
    run('render', *both, '-o', scene / 'apart.exr', '--objects', 'apart')
    # Two clouds of one surface, of one colour: the order shows a little, and only the same order draws the same bits.
    assert figures('compare', scene / 'together.exr', scene / 'apart.exr')['max_error'] > 1e-5
    message = error('render', *both, '-o', scene / 'never.exr', '--objects', 'apart', '--accuracy', 'rays')
    assert 'only the order of their centres is allowed' in message and not (scene / 'never.exr').exists()
    alone = scene / 'cube.ply', '--camera', scene / 'transforms.json', '--accuracy', 'rays'
    run('render', *alone, '-o', scene / 'alone.exr', '--objects', 'apart')


def test_render_understands_what_its_flags_were_called(scene):
    for name, index, low_pass in (('former', '--index', '--lowpass'), ('present', '--object-index', '--low-pass')):
        run('render', scene / 'cube.ply', '--camera', scene / 'transforms.json', '-o', scene / f'{name}.exr',
            index, scene / f'{name}_index.exr', low_pass, 'none')
    for end in ('.exr', '_index.exr'):
        assert figures('compare', scene / f'former{end}', scene / f'present{end}')['max_error'] == 0
    shown = run('render', '--help').stdout.replace(', --', ',--')  # newer releases of CLI11 put a space between
    assert all(names in shown for names in ('--object-index,--index', '--low-pass,--lowpass'))


def test_formats_are_listed_for_programs_with_the_former_key_too(scene):
    formats = json.loads(run('formats', '--json').stdout)
    assert all(form['endings'] == form['extensions'] for form in formats)
    assert {'.ply', '.spz'} <= {extension for form in formats for extension in form['extensions'].split()}


def test_render_looks_through_lenses_and_all_around(scene):
    view = ('--camera', scene / 'transforms.json')
    run('render', scene / 'cube.ply', *view, '-o', scene / 'sharp.exr')
    # Cube from 2.5 to 3.5 m; in focus it stays, out of focus it does not.
    run('render', scene / 'cube.ply', *view, '-o', scene / 'focus.exr', '--aperture', 0.02, '--focus-distance', 3,
        '--blades', 6)
    run('render', scene / 'cube.ply', *view, '-o', scene / 'blurred.exr', '--aperture', 0.3, '--focus-distance', 1,
        '--blur-samples', 16, '--depth', scene / 'z.exr', '--normal', scene / 'n.exr', '--object-index',
        scene / 'i.exr')
    near, far = (figures('compare', scene / 'sharp.exr', scene / name)['psnr'] for name in ('focus.exr', 'blurred.exr'))
    assert near > far + 5 and far < 30
    assert [figures('info', scene / name)['channels'] for name in ('z.exr', 'n.exr', 'i.exr')] == [1, 3, 1]
    for model in ('equirectangular', 'fisheye-equidistant', 'fisheye-equisolid'):
        run('render', scene / 'cube.ply', *view, '--camera-model', model, '--accuracy', 'rays', '--width', 64,
            '--height', 32, '-o', scene / 'all.exr')
    assert figures('info', scene / 'all.exr')['width'] == 64
    write_camera(scene / 'two.json')
    document = json.loads((scene / 'two.json').read_text())
    document['frames'].append({'file_path': 'b.png', 'transform_matrix': [
        [1, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, 3.0], [0, 0, 0, 1]]})
    (scene / 'two.json').write_text(json.dumps(document))
    run('render', scene / 'cube.ply', '--camera', scene / 'two.json', '--moves-to', 1, '-o', scene / 'moving.exr')
    assert figures('compare', scene / 'sharp.exr', scene / 'moving.exr')['psnr'] < 30
    # Splats that are elsewhere when the shutter closes; and the same ones, which are not.
    for name, x in (('there', 0), ('elsewhere', 0.5)):
        write_shifted(scene / 'cube.ply', scene / f'{name}.ply', x)
        run('render', scene / 'cube.ply', *view, '--changes-to', scene / f'{name}.ply', '--blur-samples', 64, '-o',
            scene / f'{name}.exr')
    run('render', scene / 'cube.ply', *view, '--blur-samples', 64, '-o', scene / 'still.exr')
    there, elsewhere = (figures('compare', scene / 'still.exr', scene / f'{name}.exr')['psnr']
                        for name in ('there', 'elsewhere'))
    assert elsewhere < 30 < there


def test_render_refuses_what_no_lens_and_no_camera_is(scene):
    def refused(*arguments):
        message = error('render', scene / 'cube.ply', '--camera', scene / 'transforms.json', '-o', scene / 'never.exr',
                        *arguments)
        assert not (scene / 'never.exr').exists()
        return message

    assert 'drawn along rays only' in refused('--camera-model', 'equirectangular')
    assert '400 degrees; 0 to 360 is allowed' in refused('--camera-model', 'fisheye-equidistant', '--accuracy', 'rays',
                                                         '--field-of-view', 400)
    assert '--focus-distance' in refused('--aperture', 0.1)
    assert '1 to 65536' in refused('--blur-samples', 0)
    assert '2 files; 1 are rendered' in refused('--changes-to', scene / 'cube.ply', scene / 'cube.ply')
    assert 'blades is 2' in refused('--aperture', 0.1, '--focus-distance', 1, '--blades', 2)
    assert '.exr is expected' in refused('--depth', scene / 'z.png')


def test_a_log_says_each_stage_once_in_every_tenth(scene):
    said = run('render', scene / 'cube.ply', '--camera', scene / 'transforms.json', '-o', scene / 'blurred.exr',
               '--aperture', 0.3, '--focus-distance', 1, '--accuracy', 'rays', '--blur-samples', 400).stderr.splitlines()
    tenths = [(int(line.split('%')[0]) // 10, line.split('%')[1].strip()) for line in said]
    assert len(tenths) > 2, 'it was over before anything is said; take more samples'
    assert len(set(tenths)) == len(tenths), said


def test_voxelize_writes_a_volume_with_the_bounds_of_the_splats(scene):
    run('voxelize', scene / 'cube.ply', scene / 'cube.vdb', '--resolution', 48)
    info = figures('info', scene / 'cube.vdb')
    assert info['active_voxels'] > 48 * 48 * 5
    assert info['bounds_min'][0] < -0.5 and math.isfinite(info['max_density'])


@pytest.mark.parametrize('budget', [0, -5, 2 ** 28 + 1])
def test_refuses_budgets_outside_the_range(scene, budget):
    message = error('decode', scene / 'cube.glb', scene / 'never.ply', f'--anchors={budget}')
    assert str(budget) in message and '268435456' in message
    assert not (scene / 'never.ply').exists()


def test_errors_are_one_line_and_lose_nothing(scene, tmp_path):
    assert 'missing.ply' in error('info', tmp_path / 'missing.ply')
    assert 'cube.xyz' in error('convert', scene / 'cube.ply', tmp_path / 'cube.xyz')
    error('convert', scene / 'cube.ply', tmp_path / 'no' / 'folder' / 'a.ply')
    kept = tmp_path / 'kept.ply'
    kept.write_bytes((scene / 'cube.ply').read_bytes())
    (tmp_path / 'broken.ply').write_bytes((scene / 'cube.ply').read_bytes()[:2000])
    error('convert', tmp_path / 'broken.ply', kept)
    assert kept.read_bytes() == (scene / 'cube.ply').read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ['broken.ply', 'kept.ply']
    assert 'view 7' in error('render', scene / 'cube.ply', '--camera', scene / 'transforms.json',
                             '--view', 7, '-o', tmp_path / 'a.png')
    error('compare', scene / 'cube.ply', scene / 'transforms.json')
    error('render', scene / 'cube.ply', status=2)


def test_a_lying_header_is_refused_before_memory_is_taken(tmp_path):
    header = 'ply\nformat binary_little_endian 1.0\nelement vertex 1000000000000\n'
    header += ''.join(f'property float {name}\n' for name in (
        'x', 'y', 'z', 'f_dc_0', 'f_dc_1', 'f_dc_2', 'opacity', 'scale_0', 'scale_1', 'scale_2',
        'rot_0', 'rot_1', 'rot_2', 'rot_3')) + 'end_header\n'
    (tmp_path / 'liar.ply').write_bytes(header.encode() + bytes(56))
    assert '1000000000000' in error('info', tmp_path / 'liar.ply')


def test_mesh_is_closed_and_as_large_as_the_cube(scene):
    made = figures('mesh', scene / 'cube.ply', scene / 'cube_mesh.glb', '--resolution', 40, '--largest')
    assert made['open_edges'] == 0 and made['pieces'] == 1
    # The surface lies up to two voxels outside the cube of side 1.
    assert 1.0 < made['volume'] < (1 + 4 * made['voxel_size']) ** 3
    assert figures('info', scene / 'cube_mesh.glb')['triangles'] == made['triangles']
    run('voxelize', scene / 'cube.ply', scene / 'for_mesh.vdb', '--resolution', 40)
    assert figures('mesh', scene / 'for_mesh.vdb', scene / 'cube_mesh.ply',
                   '--largest')['triangles'] == made['triangles']
    assert (scene / 'cube_mesh.ply').read_bytes().startswith(b'ply\n')
    assert 'opacity is 1.5' in error('mesh', scene / 'for_mesh.vdb', scene / 'no.ply', '--threshold', 1.5)
    assert '.ply and .glb' in error('mesh', scene / 'for_mesh.vdb', scene / 'no.obj')
