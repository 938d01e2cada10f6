"""Streamed scenes: levels that are cuts of one merge tree."""
import json
import subprocess

import conversion_table as conversions
import numpy as np
import pytest
from conversion_table import tool

SIDE = 12
COUNTS = [1728, 432, 108]


def error(*arguments):
    """The single line on stderr of a call that must fail."""
    result = subprocess.run([conversions.program(), *map(str, arguments)], capture_output=True, text=True, timeout=120)
    assert result.returncode == 1, (arguments, result.stdout, result.stderr)
    lines = [line for line in result.stderr.splitlines() if line.startswith('stipple: ')]
    assert len(lines) == 1, result.stderr
    return lines[0]


def info(path):
    return json.loads(tool('info', path, '--json'))


def scene_in(folder, source, *options):
    """A scene written to a new folder: its path and its JSON."""
    folder.mkdir()
    path = folder / 'lod-meta.json'
    tool('convert', source, path, *options)
    return path, json.loads(path.read_text())


def ranges(node):
    """(level, range) of all chunks."""
    if 'children' in node:
        return [found for child in node['children'] for found in ranges(child)]
    return [(int(level), found) for level, found in node['lods'].items()]


def files(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob('*') if path.is_file()}


@pytest.fixture(scope='module')
def splats(tmp_path_factory):
    """A folder with a cloud and its tree, and its scene of three levels."""
    folder = tmp_path_factory.mktemp('levels')
    conversions.write_ply(folder / 'cloud.ply', conversions.make_cloud(SIDE), conversions.DEGREE)
    tool('decode', folder / 'cloud.ply', folder / 'tree.stipple.safetensors')
    scene_in(folder / 'scene', folder / 'tree.stipple.safetensors', '--levels', 3)
    return folder


def test_every_level_has_a_quarter_of_the_one_before(splats):
    meta = json.loads((splats / 'scene' / 'lod-meta.json').read_text())
    assert meta['lodLevels'] == 3 and meta['counts'] == COUNTS
    for level, count in enumerate(COUNTS):
        found = [chunk for number, chunk in ranges(meta['tree']) if number == level]
        assert sum(chunk['count'] for chunk in found) == count
        # Clouds of fewer splats than a file takes: a file for each level.
        name, = {meta['filenames'][chunk['file']] for chunk in found}
        assert info(splats / 'scene' / name)['count'] == count


def test_level_0_is_the_cloud_as_sog_holds_it(splats, tmp_path):
    tool('convert', splats / 'scene' / 'lod-meta.json', tmp_path / 'back.ply')
    ordered = conversions.in_first_order(conversions.read_ply(tmp_path / 'back.ply', conversions.DEGREE))
    conversions.write_ply(tmp_path / 'ordered.ply', ordered, conversions.DEGREE)
    figures = json.loads(tool('compare', splats / 'cloud.ply', tmp_path / 'ordered.ply', '--json'))
    assert figures['same_order'] == 1
    # What docs/formats.md says of SOG: half of 1/65535 of the logarithm's range ln(1 + 1.12), times 1 + 1.12 where a
    # position is largest; 1.1 degrees; half of 1/255.
    assert figures['max_position'] <= 3 ** 0.5 * 1.01 * 2 * 0.7515 / 65535 * 0.5 * 2.12
    assert figures['max_rotation'] <= np.radians(1.1)
    assert figures['max_opacity'] <= 0.5 / 255 + 1e-6


def test_coarser_levels_are_cuts_of_the_tree(splats, tmp_path):
    for level, count in enumerate(COUNTS[1:], 1):
        tool('convert', splats / 'scene' / f'{level}_0' / 'meta.json', tmp_path / 'level.ply')
        tool('decode', splats / 'tree.stipple.safetensors', tmp_path / 'cut.ply', '--anchors', count)
        have, wanted = (conversions.read_ply(tmp_path / name, conversions.DEGREE)[:, :3]
                        for name in ('level.ply', 'cut.ply'))
        gaps = np.linalg.norm(have[:, None] - wanted[None], axis=2)
        assert sorted(gaps.argmin(axis=1)) == list(range(count))
        assert gaps.min(axis=1).max() < 1e-4  # SOG's steps, above


def test_splats_and_their_tree_give_the_same_scene(splats, tmp_path):
    scene_in(tmp_path / 'scene', splats / 'cloud.ply', '--levels', 3)
    assert files(tmp_path / 'scene') == files(splats / 'scene')


def test_a_tree_converts_to_the_splats_that_it_was_made_of(splats, tmp_path):
    tool('convert', splats / 'tree.stipple.safetensors', tmp_path / 'tree.ply')
    tool('convert', splats / 'cloud.ply', tmp_path / 'cloud.ply')
    assert (tmp_path / 'tree.ply').read_bytes() == (tmp_path / 'cloud.ply').read_bytes()


def test_levels_are_added_until_one_has_20000_splats(tmp_path):
    for side, counts in ((27, [19683]), (28, [21952, 5488])):
        conversions.write_ply(tmp_path / 'large.ply', conversions.make_cloud(side), conversions.DEGREE)
        _, meta = scene_in(tmp_path / str(side), tmp_path / 'large.ply', '--degree', 0)
        assert meta['counts'] == counts


def test_degree_and_frame_are_those_of_every_level(splats, tmp_path):
    scene_in(tmp_path / 'scene', splats / 'tree.stipple.safetensors', '--levels', 3, '--degree', 1, '--frame', 'RUB')
    for level, count in enumerate(COUNTS):
        told = info(tmp_path / 'scene' / f'{level}_0' / 'meta.json')
        assert (told['count'], told['harmonic_degree'], told['frame']) == (count, 1, 'RUB')
    # RUB counts y and z the other way.
    assert told['bounds_max'][1] < 0.05 and told['bounds_max'][0] > 0.5
    # Without --frame they are turned to SOG's own.
    tool('convert', splats / 'cloud.ply', tmp_path / 'turned.spz')
    assert info(tmp_path / 'turned.spz')['frame'] == 'RUB'
    scene_in(tmp_path / 'again', tmp_path / 'turned.spz', '--levels', 3)
    told = info(tmp_path / 'again' / '2_0' / 'meta.json')
    assert told['bounds_min'][1] > -0.05 and told['bounds_max'][0] > 0.5


def test_refusals_say_what_is_allowed_and_leave_the_scene(splats, tmp_path):
    cloud, scene = splats / 'cloud.ply', splats / 'scene' / 'lod-meta.json'
    before = files(splats / 'scene')
    # 1,728 is 4^5 and more.
    for levels in (0, -1, 7):
        assert f'--levels is {levels}; 1 to 6 is allowed for 1728 splats' in error('convert', cloud, scene,
                                                                                   f'--levels={levels}')
    assert 'cloud.sog' in error('convert', cloud, splats / 'cloud.sog', '--levels', 2)
    assert "'" + str(tmp_path / 'none') + "' is not a folder" in error('convert', cloud,
                                                                       tmp_path / 'none' / 'lod-meta.json')
    assert files(splats / 'scene') == before


def test_one_splat_is_one_level(tmp_path):
    conversions.write_ply(tmp_path / 'one.ply', conversions.make_cloud(1), conversions.DEGREE)
    _, meta = scene_in(tmp_path / 'scene', tmp_path / 'one.ply')
    assert meta['counts'] == [1]
    tool('decode', tmp_path / 'one.ply', tmp_path / 'one.stipple.safetensors')
    tool('convert', tmp_path / 'one.stipple.safetensors', tmp_path / 'scene' / 'lod-meta.json', '--levels', 1)
    assert info(tmp_path / 'scene' / 'lod-meta.json')['count'] == 1
    assert '1 to 1 is allowed for 1 splat' in error('convert', tmp_path / 'one.ply', tmp_path / 'lod-meta.json',
                                                    '--levels', 2)
