"""A mesh that takes the shape of another, or of splats, and keeps its triangles."""
import json
import math
import struct

import numpy as np
import pytest
from node_packages import gltf_issues
from test_tool import error, figures, run


def sphere(splits):
    """(positions [V,3], triangles [T,3]) of a unit sphere: an octahedron, split."""
    points = [np.float64(p) for p in ([1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1])]
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    for _ in range(splits):
        middles, finer = {}, []

        def middle(a, b):
            key = min(a, b), max(a, b)
            if key not in middles:
                middles[key] = len(points)
                at = points[a] + points[b]
                points.append(at / np.linalg.norm(at))
            return middles[key]

        for a, b, c in faces:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            finer += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = finer
    return np.array(points), np.array(faces)


def write_glb(path, positions, triangles):
    """Positions are Z up, as the tool has them; the file is Y up."""
    places = np.stack([positions[:, 0], positions[:, 2], -positions[:, 1]], axis=1).astype('<f4')
    data = places.tobytes() + np.asarray(triangles, '<u4').tobytes()
    head = {'asset': {'version': '2.0'}, 'scene': 0, 'scenes': [{'nodes': [0]}], 'nodes': [{'mesh': 0}],
            'meshes': [{'primitives': [{'attributes': {'POSITION': 0}, 'indices': 1}]}],
            'buffers': [{'byteLength': len(data)}],
            'bufferViews': [{'buffer': 0, 'byteOffset': 0, 'byteLength': places.nbytes},
                            {'buffer': 0, 'byteOffset': places.nbytes, 'byteLength': len(data) - places.nbytes}],
            'accessors': [{'bufferView': 0, 'componentType': 5126, 'count': len(places), 'type': 'VEC3',
                           'min': places.min(axis=0).tolist(), 'max': places.max(axis=0).tolist()},
                          {'bufferView': 1, 'componentType': 5125, 'count': 3 * len(triangles), 'type': 'SCALAR'}]}
    text = json.dumps(head).encode()
    text += b' ' * (-len(text) % 4)
    path.write_bytes(struct.pack('<4sII', b'glTF', 2, 28 + len(text) + len(data)) +
                     struct.pack('<I4s', len(text), b'JSON') + text + struct.pack('<I4s', len(data), b'BIN\0') + data)


def read_ply(path):
    """(positions [V,3], triangles [T,3]) of a mesh that the tool wrote."""
    head, _, body = path.read_bytes().partition(b'end_header\n')
    vertices, faces = (int(line.split()[-1]) for line in head.splitlines() if line.startswith(b'element'))
    positions = np.frombuffer(body, '<f4', 3 * vertices).reshape(-1, 3)
    rows = np.frombuffer(body[positions.nbytes:], np.dtype([('count', 'u1'), ('corners', '<u4', 3)]), faces)
    return positions, rows['corners']


@pytest.fixture
def shapes(tmp_path):
    """(template, target) in files: a sphere, and an egg with half-axes of 1.2, 0.8 and 0.6."""
    write_glb(tmp_path / 'sphere.glb', *sphere(3))
    positions, triangles = sphere(4)
    write_glb(tmp_path / 'egg.glb', positions * [1.2, 0.8, 0.6], triangles)
    return tmp_path / 'sphere.glb', tmp_path / 'egg.glb'


QUICK = ('--steps', 100, '--points', 3000)


def test_a_sphere_becomes_an_egg_and_keeps_its_triangles(shapes, tmp_path):
    seen = figures('adapt', *shapes, tmp_path / 'out.ply', *QUICK)
    positions, triangles = read_ply(tmp_path / 'out.ply')
    np.testing.assert_array_equal(triangles, sphere(3)[1])
    assert (seen['vertices'], seen['triangles'], seen['places']) == (258, 512, 258)
    assert seen['distance_before'] > 0.1
    assert seen['distance_after'] < 0.02
    assert seen['normals_after'] < 0.5 * seen['normals_before']
    # Steps of 0.05 swing about the end.
    np.testing.assert_allclose(np.linalg.norm(positions / [1.2, 0.8, 0.6], axis=1), 1, atol=0.1)
    run('adapt', *shapes, tmp_path / 'out.glb', *QUICK)
    run('adapt', tmp_path / 'out.glb', shapes[1], tmp_path / 'again.ply', '--steps', 1)


def test_the_number_of_threads_changes_nothing(shapes, tmp_path):
    for threads in (1, 3):
        run('--threads', threads, 'adapt', *shapes, tmp_path / f'{threads}.ply', '--steps', 20, '--points', 2000)
    assert (tmp_path / '1.ply').read_bytes() == (tmp_path / '3.ply').read_bytes()


def test_splats_are_a_target(shapes, tmp_path):
    run('decode', shapes[1], tmp_path / 'egg.ply', '--anchors', 3000)
    seen = figures('adapt', shapes[0], tmp_path / 'egg.ply', tmp_path / 'out.ply', *QUICK)
    positions, _ = read_ply(tmp_path / 'out.ply')
    assert seen['distance_after'] < 0.04
    np.testing.assert_allclose(np.linalg.norm(positions / [1.2, 0.8, 0.6], axis=1), 1, atol=0.15)


def test_an_egg_elsewhere_is_found(shapes, tmp_path):
    positions, triangles = sphere(4)
    write_glb(tmp_path / 'far.glb', positions * [12, 8, 6] + [100, 0, 0], triangles)
    seen = figures('adapt', shapes[0], tmp_path / 'far.glb', tmp_path / 'out.ply', '--align', 'size', *QUICK)
    assert seen['distance_after'] < 0.2


def test_a_landmark_pulls_its_vertex(shapes, tmp_path):
    run('adapt', *shapes, tmp_path / 'out.ply', *QUICK, '--landmark', '0:0,0.8,0', '--landmark-weight', 10)
    # The points of the target go on pulling it the other way, to where it was: 1.2 m along X.
    np.testing.assert_allclose(read_ply(tmp_path / 'out.ply')[0][0], [0, 0.8, 0], atol=0.2)


def test_bad_input_gets_one_sentence(shapes, tmp_path):
    sphere_glb, egg = shapes
    out = tmp_path / 'out.ply'
    write_glb(tmp_path / 'one.glb', *(part[:3] for part in (sphere(0)[0][[0, 2, 4]], np.array([[0, 1, 2]]))))
    assert 'has 1 triangles with three corners' in error('adapt', tmp_path / 'one.glb', egg, out)
    positions, triangles = sphere(1)
    positions[3] = np.nan
    write_glb(tmp_path / 'nan.glb', np.nan_to_num(positions, nan=0), triangles)
    data = (tmp_path / 'nan.glb').read_bytes()
    (tmp_path / 'nan.glb').write_bytes(data[:-triangles.size * 4 - 4] + struct.pack('<f', np.nan) +
                                       data[-triangles.size * 4:])
    assert 'finite' in error('adapt', tmp_path / 'nan.glb', egg, out)
    assert 'finite' in error('adapt', sphere_glb, tmp_path / 'nan.glb', out)
    assert 'which has 258 vertices' in error('adapt', sphere_glb, egg, out, '--landmark', '258:0,0,0')
    assert 'VERTEX:X,Y,Z is expected' in error('adapt', sphere_glb, egg, out, '--landmark', '3:nowhere')
    assert '--steps' in error('adapt', sphere_glb, egg, out, '--steps', 0)
    assert 'off, uniform, adaptive' in error('adapt', sphere_glb, egg, out, '--density', 'much')
    assert 'strength of the density is -1' in error('adapt', sphere_glb, egg, out, '--strength', -1)
    assert '.glb or .ply' in error('adapt', sphere_glb, egg, tmp_path / 'out.obj')
    assert 'neither a mesh nor points, splats or images' in error('adapt', sphere_glb, tmp_path / 'a.vdb', out)
    assert not out.exists()


# ---- what a file of the template keeps ------------------------------------------------------------

def read_glb(path):
    """(JSON, binary part) of a GLB."""
    data = path.read_bytes()
    length = struct.unpack_from('<I', data, 12)[0]
    return json.loads(data[20:20 + length]), data[28 + length:]


def rows(head, binary, index):
    """An accessor of floats or bytes."""
    accessor = head['accessors'][index]
    view = head['bufferViews'][accessor['bufferView']]
    kind = {5126: '<f4', 5121: 'u1', 5125: '<u4'}[accessor['componentType']]
    width = {'SCALAR': 1, 'VEC2': 2, 'VEC3': 3, 'VEC4': 4, 'MAT4': 16}[accessor['type']]
    return np.frombuffer(binary, kind, accessor['count'] * width, view.get('byteOffset', 0)).reshape(-1, width)


def dressed(path):
    """Gives a file of write_glb() normals, UVs, a skin with weights, a morph target, a material, and what nobody
    knows."""
    head, binary = read_glb(path)
    binary = binary[:head['buffers'][0]['byteLength']]
    places = rows(head, binary, 0)
    count = len(places)
    random = np.random.default_rng(3)

    def add(values, kind, component):
        nonlocal binary
        binary += b'\0' * (-len(binary) % 4)
        head['bufferViews'].append({'buffer': 0, 'byteOffset': len(binary), 'byteLength': values.nbytes})
        binary += values.tobytes()
        head['accessors'].append({'bufferView': len(head['bufferViews']) - 1, 'componentType': component,
                                  'count': len(values), 'type': kind})
        return len(head['accessors']) - 1

    primitive = head['meshes'][0]['primitives'][0]
    shares = random.random(count)
    weights = np.stack([shares, 1 - shares, 0 * shares, 0 * shares], axis=1).astype('<f4')
    primitive['attributes'] |= {
        'NORMAL': add(places, 'VEC3', 5126), 'TANGENT': add(np.tile(np.float32([1, 0, 0, 1]), (count, 1)), 'VEC4', 5126),
        'TEXCOORD_0': add(random.random((count, 2)).astype('<f4'), 'VEC2', 5126),
        'JOINTS_0': add(np.tile(np.uint8([0, 1, 0, 0]), (count, 1)), 'VEC4', 5121),
        'WEIGHTS_0': add(weights, 'VEC4', 5126),
        '_MINE': add(random.random((count, 1)).astype('<f4'), 'SCALAR', 5126)}
    difference = add(random.random((count, 3)).astype('<f4'), 'VEC3', 5126)
    values = rows(head, binary, difference)
    head['accessors'][difference] |= {'min': values.min(axis=0).tolist(), 'max': values.max(axis=0).tolist()}
    primitive |= {'material': 0, 'targets': [{'POSITION': difference}]}
    head['materials'] = [{'name': 'Skin', 'pbrMetallicRoughness': {'roughnessFactor': 0.3}}]
    head['meshes'][0] |= {'weights': [0.5], 'extras': {'targetNames': ['Smile']}}
    matrices = add(np.tile(np.eye(4, dtype='<f4').reshape(1, 16), (2, 1)), 'MAT4', 5126)
    head['nodes'][0]['skin'] = 0
    head['nodes'] += [{'name': 'Bone', 'children': [2]}, {'name': 'Tip', 'translation': [0, 1, 0]}]
    head['scenes'][0]['nodes'].append(1)
    head['skins'] = [{'joints': [1, 2], 'inverseBindMatrices': matrices}]
    head['extensionsUsed'] = ['MY_extension']
    head['extensions'] = {'MY_extension': {'number': 0.1, 'list': [1, 'two']}}
    head['buffers'][0]['byteLength'] = len(binary)
    text = json.dumps(head).encode()
    text += b' ' * (-len(text) % 4)
    binary += b'\0' * (-len(binary) % 4)
    path.write_bytes(struct.pack('<4sII', b'glTF', 2, 28 + len(text) + len(binary)) +
                     struct.pack('<I4s', len(text), b'JSON') + text + struct.pack('<I4s', len(binary), b'BIN\0') +
                     binary)


def test_a_glb_keeps_all_that_the_template_has(shapes, tmp_path):
    dressed(shapes[0])
    run('adapt', *shapes, tmp_path / 'out.glb', *QUICK)
    run('adapt', *shapes, tmp_path / 'out.ply', *QUICK)
    before, old = read_glb(shapes[0])
    after, new = read_glb(tmp_path / 'out.glb')
    was, now = (head['meshes'][0]['primitives'][0].pop('attributes') for head in (before, after))
    for name in ('TEXCOORD_0', 'JOINTS_0', 'WEIGHTS_0', '_MINE'):
        np.testing.assert_array_equal(rows(after, new, now[name]), rows(before, old, was[name]))
    assert set(now) == set(was) - {'TANGENT'}
    for key in set(before) - {'buffers', 'bufferViews', 'accessors'}:
        assert after[key] == before[key], key
    places = rows(after, new, now['POSITION'])
    positions, _ = read_ply(tmp_path / 'out.ply')
    np.testing.assert_allclose(np.stack([places[:, 0], -places[:, 2], places[:, 1]], axis=1), positions, atol=1e-6)
    accessor = after['accessors'][now['POSITION']]
    np.testing.assert_array_equal(accessor['min'], places.min(axis=0))
    np.testing.assert_array_equal(accessor['max'], places.max(axis=0))
    normals = rows(after, new, now['NORMAL'])
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)
    # Those of an egg with half-axes of 1.2, 0.6 (up) and 0.8; each is the mean around a vertex.
    wanted = places / np.square([1.2, 0.6, 0.8])
    wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
    assert (normals * wanted).sum(axis=1).mean() > 0.98
    difference = after['meshes'][0]['primitives'][0]['targets'][0]['POSITION']
    np.testing.assert_array_equal(rows(after, new, difference), rows(before, old, difference))


def test_a_glb_of_an_adapted_mesh_is_valid(shapes, tmp_path):
    dressed(shapes[0])
    run('adapt', *shapes, tmp_path / 'out.glb', '--steps', 10, '--points', 500)
    wrong = [issue for issue in gltf_issues(tmp_path / 'out.glb') if issue['severity'] == 0]
    assert not wrong, wrong[:3]


def test_points_of_a_scan_are_a_target(shapes, tmp_path):
    points, _ = sphere(5)
    normals = points / [1.2, 0.8, 0.6]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    values = np.hstack([points * [1.2, 0.8, 0.6], normals]).astype('<f4')
    names = ('x', 'y', 'z', 'nx', 'ny', 'nz')
    for count, has_normals in ((6, True), (3, False)):
        head = f'ply\nformat binary_little_endian 1.0\nelement vertex {len(values)}\n'
        head += ''.join(f'property float {name}\n' for name in names[:count]) + 'end_header\n'
        (tmp_path / 'scan.ply').write_bytes(head.encode() + np.ascontiguousarray(values[:, :count]).tobytes())
        seen = figures('adapt', shapes[0], tmp_path / 'scan.ply', tmp_path / 'out.ply', *QUICK)
        assert seen['distance_after'] < 0.05 and ('normals_after' in seen) == has_normals
        positions, _ = read_ply(tmp_path / 'out.ply')
        np.testing.assert_allclose(np.linalg.norm(positions / [1.2, 0.8, 0.6], axis=1), 1, atol=0.15)
    (tmp_path / 'scan.ply').write_bytes(b'ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\n'
                                        b'property float z\nend_header\n')
    assert '0 points' in error('adapt', shapes[0], tmp_path / 'scan.ply', tmp_path / 'out.ply')


def test_a_mesh_that_is_shown_twice_has_no_one_shape(shapes, tmp_path):
    head, binary = read_glb(shapes[0])
    head['nodes'].append({'mesh': 0, 'translation': [3, 0, 0]})
    head['scenes'][0]['nodes'].append(1)
    text = json.dumps(head).encode()
    text += b' ' * (-len(text) % 4)
    shapes[0].write_bytes(struct.pack('<4sII', b'glTF', 2, 28 + len(text) + len(binary)) +
                          struct.pack('<I4s', len(text), b'JSON') + text +
                          struct.pack('<I4s', len(binary), b'BIN\0') + binary)
    assert 'shows mesh 0 several times' in error('adapt', *shapes, tmp_path / 'out.glb', '--steps', 1)
    run('adapt', *shapes, tmp_path / 'out.ply', '--steps', 1)


@pytest.mark.parametrize('drawing', ['triangles', 'splats'])
def test_a_mesh_takes_the_shape_that_images_show(shapes, tmp_path, drawing):
    """Images of splats of the egg: what the tool itself draws is enough."""
    template, target = shapes
    run('decode', target, tmp_path / 'egg.ply', '--anchors', 8000)
    frames = []
    for i in range(8):
        turn, up = math.tau * i / 8, 0.6 if i % 2 else -0.6
        back = np.array([math.cos(turn), math.sin(turn), up])
        back /= np.linalg.norm(back)
        right = np.array([-math.sin(turn), math.cos(turn), 0.0])
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = np.stack([right, np.cross(back, right), back], axis=1), 4 * back
        frames.append({'file_path': f'{i}.png', 'transform_matrix': matrix.tolist()})
    (tmp_path / 'transforms.json').write_text(json.dumps(
        {'w': 64, 'h': 64, 'fl_x': 80, 'fl_y': 80, 'cx': 32, 'cy': 32, 'frames': frames}))
    for i in range(8):
        run('render', tmp_path / 'egg.ply', '--camera', tmp_path / 'transforms.json', '--view', i, '-o',
            tmp_path / f'{i}.png')
    told = figures('adapt', template, tmp_path / 'transforms.json', tmp_path / 'out.ply', '--align', 'size',
                   '--steps', 150, '--draw', drawing)
    assert float(told['difference_after']) < 0.2 * float(told['difference_before'])
    positions, triangles = read_ply(tmp_path / 'out.ply')
    assert len(triangles) == len(sphere(3)[1])
    # A pixel is 0.05 where the egg is; the sphere of its size is up to 0.37 away from it.
    scaled = np.linalg.norm(positions / [1.2, 0.8, 0.6], axis=1)
    assert np.abs(scaled - 1).mean() < 0.05
    assert "--draw is 'points'; triangles, splats are allowed" in error(
        'adapt', template, tmp_path / 'transforms.json', tmp_path / 'no.ply', '--draw', 'points')
    assert 'landmarks are for targets' in error(
        'adapt', template, tmp_path / 'transforms.json', tmp_path / 'no.ply', '--landmark', '3:0,0,1')
