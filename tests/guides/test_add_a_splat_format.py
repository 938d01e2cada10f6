"""docs/guides/add_a_splat_format.md, followed literally: the tool writes the format, tells it by its content and reads
it back."""
import json

import conversion_table as conversions
from guide import Guide


def test_the_guide_adds_a_format(tmp_path):
    guide = Guide('add_a_splat_format', tmp_path / 'tree').follow()
    guide.build_library()
    assert guide.count('native') == 3

    conversions.write_ply(guide.folder / 'cloud.ply', conversions.make_cloud(6), conversions.DEGREE)
    outputs = guide.run_commands()
    assert 'rows of text' in outputs['stipple formats']
    row, = (form for form in json.loads(guide.run('formats', '--json')) if form['name'] == 'rows')
    assert row['can_read'] and row['can_write'] and row['max_sh_degree'] == 0 and row['keeps'] == []
    # Text: within the quarter that stipple.h promises.
    size = (guide.folder / 'cloud.rows').stat().st_size / 6 ** 3
    assert abs(row['bytes_per_splat'] - size) < 0.25 * size

    guide.run('convert', 'cloud.ply', 'plain.ply', '--degree', 0)
    figures = json.loads(guide.run('compare', 'plain.ply', 'back.ply', '--json'))
    assert figures['same_order'] == 1 and figures['count_a'] == 6 ** 3
    assert max(figures[f'max_{what}'] for what in ('position', 'rotation', 'scale_ratio', 'opacity', 'sh')) < 1e-6

    # By its content, whatever it is called; and one sentence for what is broken.
    (guide.folder / 'cloud.rows').rename(guide.folder / 'renamed.ply')
    assert json.loads(guide.run('info', 'renamed.ply', '--json'))['count'] == 6 ** 3
    (guide.folder / 'short.rows').write_text('splat rows\n1 2 3\n')
    assert 'short.rows, line 2: 14 numbers are expected' in guide.run('info', 'short.rows', status=1)
    extensions = (guide.folder / 'addon/stipple/scene/source/formats.py').read_text()
    assert "'.rows'" in extensions.split('DROPPED_EXTENSIONS', 1)[1].split(')', 1)[0]
