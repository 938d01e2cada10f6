"""Writes the asset files of this folder, one per version and kind, without any code of Stipple: what was
written once must be readable for good. Run it in this folder to add those of a new version; never change
the old ones. tests/native/io/golden_assets_test.cpp knows their numbers by the same formulas.
"""
import json
import math

import numpy


def write(path, metadata, tensors):
    """A safetensors file; tensors: name -> (type, array)."""
    header, data = {'__metadata__': metadata}, b''
    for name, (dtype, array) in tensors.items():
        raw = array.tobytes()
        header[name] = {'dtype': dtype, 'shape': list(array.shape), 'data_offsets': [len(data), len(data) + len(raw)]}
        data += raw
    text = json.dumps(header).encode()
    text += b' ' * (-len(text) % 8)
    with open(path, 'wb') as file:
        file.write(len(text).to_bytes(8, 'little') + text + data)


def numbers(rows, width, first):
    """(first + 3 row + column) / 64: exact in float32, and different in every place of a row."""
    row, column = numpy.mgrid[0:rows, 0:width]
    return ((first + 3 * row + column) / 64).astype('<f4')


def f32(array):
    return 'F32', array


def u64(values):
    return 'U64', numpy.array(values, '<u8')


# Halves, quarters and eighths of the mass; eight times minus infinity but for two children below the root.
LEVELS = [([0], [[1 / 2, 0, 0, 0, 0, 1 / 4, 0, 1 / 4]]),
          ([0, 5, 7], [[1 / 8] * 8, [1, 0, 0, 0, 0, 0, 0, 0], [0, 0, 0, 1 / 2, 1 / 2, 0, 0, 0]])]


def logarithms(rows):
    return numpy.array([[math.log(p) if p > 0 else -math.inf for p in row] for row in rows], '<f4')


def surface():
    samples = 5
    tensors = {'surface.positions': f32(numbers(samples, 3, 1)),
               'surface.normals': f32(numpy.zeros((samples, 3), '<f4')), 'surface.colours': f32(numbers(samples, 3, 2)),
               'surface.opacities': f32(numbers(samples, 1, 10)[:, 0]),
               'surface.areas': f32(numbers(samples, 1, 20)[:, 0]),
               'surface.weights': f32(numbers(samples, 1, 30)[:, 0]),
               'future.labels': ('I16', numpy.array([[1, -2], [300, 4]], '<i2'))}
    tensors['surface.normals'][1][:, 2] = 1
    for level, (cells, rows) in enumerate(LEVELS):
        tensors[f'octree.cells.{level}'] = u64(cells)
        tensors[f'octree.log_p.{level}'] = f32(logarithms(rows))
    write('surface_1.0.stipple.safetensors',
          {'stipple_version': '1.0', 'kind': 'surface', 'colour_space': 'lin_rec709_display',
           'frame': 'right-handed, z up, metres', 'root_cube': '[-1.5, 0.25, 2.0, 4.0]', 'levels': '2',
           'settings': '{"detail": 0.5}', 'provenance': 'written by hand'}, tensors)


def hierarchy():
    leaves, degree = 4, 1
    tensors = {'tree.parents': ('U32', numpy.array([2**32 - 1, 0, 0, 1, 1, 2, 2], '<u4')),
               'tree.errors': f32(numpy.array([0.75, 0.5, 0.25], '<f4')),
               'future.labels': ('I16', numpy.array([[1, -2], [300, 4]], '<i2'))}
    for stem, rows, first in (('leaves', leaves, 1), ('nodes', leaves - 1, 101)):
        rotations = numpy.zeros((rows, 4), '<f4')
        rotations[:, 1] = 1
        tensors[f'tree.{stem}.positions'] = f32(numbers(rows, 3, first))
        tensors[f'tree.{stem}.rotations'] = f32(rotations)
        tensors[f'tree.{stem}.scales'] = f32(numbers(rows, 3, first + 7))
        tensors[f'tree.{stem}.opacities'] = f32(numbers(rows, 1, 20)[:, 0])
        tensors[f'tree.{stem}.sh'] = f32(numbers(rows, 3 * (degree + 1)**2, first + 13))
    write('hierarchy_1.0.stipple.safetensors',
          {'stipple_version': '1.0', 'kind': 'hierarchy', 'colour_space': 'srgb_rec709_display', 'antialias': 'mip',
           'frame': 'RUB', 'sh_degree': str(degree), 'settings': '{"views": 16}', 'provenance': 'written by hand'},
          tensors)


def field():
    tensors = {'field.features.level3': f32(numbers(8, 8, 1)), 'field.colours.level7': f32(numbers(16, 3, 2)),
               'field.network.layer0.weights': f32(numbers(16, 64, 3)),
               'field.network.layer0.biases': f32(numbers(64, 1, 4)[:, 0]),
               'future.labels': ('I16', numpy.array([[1, -2], [300, 4]], '<i2'))}
    for level, (cells, rows) in enumerate(LEVELS):
        tensors[f'octree.cells.{level}'] = u64(cells)
        tensors[f'octree.log_p.{level}'] = f32(logarithms(rows))
    write('field_1.0.stipple.safetensors',
          {'stipple_version': '1.0', 'kind': 'field', 'colour_space': 'srgb_rec709_display', 'antialias': 'classic',
           'frame': 'right-handed, z up, metres', 'root_cube': '[-1.5, 0.25, 2.0, 4.0]', 'levels': '2',
           'field_level': '7', 'K': '16', 'sh_degree': '2', 'least_anchors': '100', 'most_anchors': '5000',
           'jitter': 'none', 'settings': '{"iterations": 700}', 'provenance': 'written by hand'}, tensors)


def whole_field():
    """Other than field(), whose arrays belong to no layout, one that decodes: all widths fit K, degree and levels."""
    small = numpy.float32(1 / 64)
    tensors = {'field.features.level3': f32(numbers(8, 8, 1)), 'field.details.level5': f32(numbers(16, 8, 2) * small),
               'field.network.layer0.weights': f32(numbers(32, 64, 3) * small),
               'field.network.layer0.biases': f32(numbers(64, 1, 4)[:, 0] * small)}
    for level, (cells, rows) in enumerate(LEVELS):
        tensors[f'octree.cells.{level}'] = u64(cells)
        tensors[f'octree.log_p.{level}'] = f32(logarithms(rows))
    write('whole_field_1.0.stipple.safetensors',
          {'stipple_version': '1.0', 'kind': 'field', 'colour_space': 'srgb_rec709_display', 'antialias': 'mip',
           'frame': 'right-handed, z up, metres', 'root_cube': '[-1.5, 0.25, 2.0, 4.0]', 'levels': '2',
           'field_level': '5', 'K': '4', 'sh_degree': '0', 'least_anchors': '100', 'most_anchors': '5000',
           'jitter': 'leaf', 'draws': 'nested', 'seed': '77', 'settings': '{"iterations": 700}',
           'provenance': 'written by hand'}, tensors)


def latent():
    tensors = {'latent.tokens': f32(numbers(6, 4, 1)), 'latent.camera': f32(numbers(5, 1, 2)[:, 0]),
               'future.labels': ('I16', numpy.array([[1, -2], [300, 4]], '<i2'))}
    write('latent_1.0.stipple.safetensors',
          {'stipple_version': '1.0', 'kind': 'latent', 'frame': 'right-handed, z up, unit cube',
           'weights_file': 'decoder.safetensors', 'weights_bytes': '576148442', 'weights_sha256': '0123456789abcdef' * 4,
           'settings': '{"seed": 42}', 'provenance': 'written by hand'}, tensors)


def moving(stem, count, degree, first):
    rotations = numpy.zeros((count, 4), '<f4')
    rotations[:, 1] = 1
    tensors = {f'{stem}.positions': f32(numbers(count, 3, first)), f'{stem}.rotations': f32(rotations),
               f'{stem}.scales': f32(numbers(count, 3, first + 7)),
               f'{stem}.opacities': f32(numbers(count, 1, 20)[:, 0]),
               f'{stem}.sh': f32(numbers(count, 3 * (degree + 1)**2, first + 13)),
               f'{stem}.phases': f32(numbers(count, 4, first + 2)), f'{stem}.spins': f32(numbers(count, 4, first + 3)),
               f'{stem}.lifespans': f32(numbers(count, 2, 5)), f'{stem}.centres': f32(numbers(count, 1, 6)[:, 0])}
    if stem == 'motion':
        tensors['future.labels'] = 'I16', numpy.array([[1, -2], [300, 4]], '<i2')
    for harmonic in range(1, 5):
        tensors[f'{stem}.cosines.{harmonic}'] = f32(numbers(count, 3, first + 29 + harmonic))
        tensors[f'{stem}.sines.{harmonic}'] = f32(numbers(count, 3, first + 39 + harmonic))
    return tensors


def motion(name, *more):
    tensors = {}
    for part in more:
        tensors.update(part)
    write(f'{name}_1.0.stipple.safetensors',
          {'stipple_version': '1.0', 'kind': 'motion', 'colour_space': 'srgb_rec709_display', 'antialias': 'mip',
           'frame': 'RUB', 'sh_degree': '1',
           'clip': '{"begin": 0.5, "frames": 9, "frames_per_second": 4, "window_frames": 50, "window_share": 0.75}',
           'settings': '{"seed": 42, "time": {"begin": 0.5, "end": 2.5}}', 'provenance': 'written by hand'}, tensors)


def anchors_of(count, gaussians, first=1):
    return {'scaffold.positions': f32(numbers(count, 3, first)), 'scaffold.features': f32(numbers(count, 32, 2)),
            'scaffold.log_scales': f32(numbers(count, 6, 3)),
            'scaffold.offsets': f32(numbers(count, 3 * gaussians, 4))}


def networks_of_anchors(gaussians, degree):
    tensors = {}
    for number, (name, outputs) in enumerate((('opacity', gaussians), ('covariance', 7 * gaussians),
                                              ('colour', 3 * (degree + 1)**2 * gaussians))):
        for layer, (inputs, width) in enumerate(((32, 32), (32, outputs))):
            tensors[f'scaffold.{name}.layer{layer}.weights'] = f32(numbers(inputs, width, number - 48))
            tensors[f'scaffold.{name}.layer{layer}.biases'] = f32(numbers(width, 1, layer)[:, 0])
    return tensors


def scaffold():
    gaussians, degree = 2, 1
    tensors = anchors_of(3, gaussians)
    tensors['future.labels'] = 'I16', numpy.array([[1, -2], [300, 4]], '<i2')
    tensors.update(networks_of_anchors(gaussians, degree))
    write('scaffold_1.0.stipple.safetensors',
          {'stipple_version': '1.0', 'kind': 'scaffold', 'colour_space': 'srgb_rec709_display', 'antialias': 'mip',
           'frame': 'right-handed, z up, metres', 'K': str(gaussians), 'sh_degree': str(degree),
           'settings': '{"seed": 42}', 'provenance': 'written by hand'}, tensors)


def relay():
    """Two key frames of a clip of nine frames: the first deforms, the other stands still and has a learned budget."""
    gaussians, degree, counts = 2, 1, [3, 2]
    texels, moments, channels, multipliers = 2, 4, 2, [1, 2]
    tensors = {'relay.anchor_counts': u64(counts),
               'relay.bounds': ('F64', numpy.array([[-1.5, 0.25, 0], [2, 3, 4]], '<f8')),
               'future.labels': ('I16', numpy.array([[1, -2], [300, 4]], '<i2'))}
    for key, count in enumerate(counts):
        known = anchors_of(count, gaussians, 1 + 10 * key) | networks_of_anchors(gaussians, degree)
        tensors.update({f'key.{key}.{name}': tensor for name, tensor in known.items()})
        tensors[f'key.{key}.blend'] = f32(numbers(count, 4, 5 + key))
    tensors['key.0.planes'] = 'U32', numpy.array([texels, moments, channels, *multipliers], '<u4')
    tensors['key.0.box'] = 'F64', numpy.array([-2, -1, 0, 2, 3, 4, 0.5], '<f8')
    plane = 0
    for scale in multipliers:
        for first, second in ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)):
            width, height = (moments if axis == 3 else texels * scale for axis in (first, second))
            values = numbers(height * width, channels, plane).reshape(height, width, channels)
            tensors[f'key.0.planes.{plane}'] = f32(values)
            plane += 1
    widths = [channels * len(multipliers), 64, 64, 3 + 6 + 32 + 3 * gaussians]
    for layer, (inputs, width) in enumerate(zip(widths, widths[1:])):
        tensors[f'key.0.heads.layer{layer}.weights'] = f32(numbers(inputs, width, layer - 96))
        tensors[f'key.0.heads.layer{layer}.biases'] = f32(numbers(width, 1, layer)[:, 0])
    tensors['key.1.coarsening'] = 'F64', numpy.array([0.5], '<f8')
    write('relay_1.0.stipple.safetensors',
          {'stipple_version': '1.0', 'kind': 'relay', 'colour_space': 'srgb_rec709_display', 'antialias': 'mip',
           'frame': 'right-handed, z up, metres', 'K': str(gaussians), 'sh_degree': str(degree),
           'clip': '{"begin": 0.5, "frames": 9, "frames_per_second": 4, "spacing": 4, "blend": 3}',
           'settings': '{"seed": 42}', 'provenance': 'written by hand'}, tensors)


if __name__ == '__main__':
    surface()
    hierarchy()
    field()
    whole_field()
    latent()
    motion('motion', moving('motion', 3, 1, 1))
    motion('motion_tree', moving('motion', 3, 1, 1), moving('tree.nodes', 2, 1, 101),
           {'tree.parents': ('U32', numpy.array([2**32 - 1, 0, 0, 1, 1], '<u4')),
            'tree.errors': f32(numpy.array([0.75, 0.5], '<f4'))})
    scaffold()
    relay()
