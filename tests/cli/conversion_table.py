"""What each splat format loses: the table of docs/formats.md, from conversions.

    STIPPLE_BUILD_DIR=build/release python3 tests/cli/conversion_table.py    writes it into the page
"""
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

BEGIN, END = '<!-- conversions: begin -->', '<!-- conversions: end -->'
SIDE = 12          # splats along each side of the cloud
SPACING = 0.1      # metres; far more than any format moves a splat, so that positions tell them apart
DEGREE = 3


def program():
    return Path(os.environ['STIPPLE_BUILD_DIR']) / 'bin' / 'stipple'


def tool(*arguments):
    result = subprocess.run([program(), *map(str, arguments)], capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, (arguments, result.stderr)
    return result.stdout


def header(count, degree):
    names = ['x', 'y', 'z', 'nx', 'ny', 'nz'] + [f'f_dc_{i}' for i in range(3)]
    names += [f'f_rest_{i}' for i in range(3 * ((degree + 1) ** 2 - 1))]
    names += ['opacity'] + [f'scale_{i}' for i in range(3)] + [f'rot_{i}' for i in range(4)]
    lines = ['ply', 'format binary_little_endian 1.0', f'element vertex {count}']
    return '\n'.join(lines + [f'property float {name}' for name in names] + ['end_header\n']), len(names)


def write_ply(path, rows, degree):
    text, width = header(len(rows), degree)
    assert rows.shape[1] == width
    path.write_bytes(text.encode() + rows.astype('<f4').tobytes())


def read_ply(path, degree):
    data = path.read_bytes()
    _, width = header(0, degree)
    start = data.index(b'end_header\n') + len(b'end_header\n')
    return np.frombuffer(data[start:], '<f4').reshape(-1, width)


def make_cloud(side=SIDE):
    """Splats of a plausible scene, one near each point of a grid. Rows of a 3DGS PLY."""
    random = np.random.default_rng(7)
    count = side ** 3
    cells = np.indices((side,) * 3).reshape(3, -1).T
    positions = (cells + random.uniform(-0.2, 0.2, (count, 3))) * SPACING
    colours = random.uniform(0.02, 0.98, (count, 3))
    harmonics = np.clip(random.normal(0, 0.15, (count, 3 * ((DEGREE + 1) ** 2 - 1))), -0.95, 0.95)
    opacities = random.uniform(0.02, 0.99, (count, 1))
    scales = np.log(0.02) + random.normal(0, 0.7, (count, 3))
    rotations = random.normal(0, 1, (count, 4))
    rotations /= np.linalg.norm(rotations, axis=1, keepdims=True)
    return np.hstack([positions, np.zeros((count, 3)), (colours - 0.5) / 0.28209479177387814, harmonics,
                      np.log(opacities / (1 - opacities)), scales, rotations])


def in_first_order(rows):
    """Rows by the point of the grid that each lies near, which is their order in make_cloud."""
    cells = np.rint(rows[:, :3] / SPACING).astype(int)
    order = np.lexsort(cells.T[::-1])
    side = round(len(rows) ** (1 / 3))
    assert (cells[order] == np.indices((side,) * 3).reshape(3, -1).T).all()
    return rows[order]


def written_formats():
    """(title, extension, degree, options) of every way to write splats."""
    ways = []
    for form in json.loads(tool('formats', '--json')):
        if not form['can_write']:
            continue
        extension = form['extensions'].split()[0]
        degree = min(DEGREE, form['max_sh_degree'])
        versions = (3, 4) if form['name'] == 'spz' else (0,)
        for version in versions:
            title = form['title'] + (f' {version}' if version else '')
            ways.append((title, extension, degree, ['--format-version', version] if version else []))
    return ways


def loss(folder, title, extension, degree, options):
    """The figures of one format as a dict."""
    source, back = folder / 'source.ply', folder / 'back.ply'
    # A folder of its own: some formats are several files.
    packed = Path(tempfile.mkdtemp(dir=folder)) / (f'cloud{extension}' if extension.startswith('.') else extension)
    write_ply(source, make_cloud(), DEGREE)
    tool('convert', source, packed, *options)
    tool('convert', packed, back)
    tool('convert', source, folder / 'expected.ply', '--degree', degree)
    write_ply(folder / 'ordered.ply', in_first_order(read_ply(back, degree)), degree)
    figures = json.loads(tool('compare', folder / 'expected.ply', folder / 'ordered.ply', '--json'))
    assert figures['same_order'] == 1
    size = sum(file.stat().st_size for file in packed.parent.rglob('*') if file.is_file())
    return {'title': title, 'degree': degree, 'bytes': size / SIDE ** 3, **figures}


def number(value):
    if value < 1e-9:  # rounding of double numbers
        return '0'
    return f'{value:.2g}' if value >= 1e-4 else f'{value:.0e}'.replace('e-0', 'e-')


def row(figures):
    cells = [figures['title'], f"{figures['bytes']:.3g}", str(figures['degree'])]
    for name, factor in (('position', 1000), ('rotation', 180 / np.pi), ('scale_ratio', 100), ('opacity', 1),
                         ('sh', 1)):
        cells.append(' / '.join(number(figures[f'{kind}_{name}'] * factor) for kind in ('max', 'mean')))
    return '| ' + ' | '.join(cells) + ' |'


def table():
    lines = ['| written as | bytes per splat | degree | position, mm | rotation, ° | scale, % | opacity | harmonics |',
             '|---|---|---|---|---|---|---|---|']
    with tempfile.TemporaryDirectory() as folder:
        lines += [row(loss(Path(folder), *way)) for way in written_formats()]
    return lines


def documented(page):
    text = page.read_text(encoding='utf-8')
    return text[text.index(BEGIN) + len(BEGIN):text.index(END)].strip().splitlines()


if __name__ == '__main__':
    page = Path(__file__).resolve().parents[2] / 'docs' / 'formats.md'
    text = page.read_text(encoding='utf-8')
    before, after = text[:text.index(BEGIN) + len(BEGIN)], text[text.index(END):]
    page.write_text(before + '\n' + '\n'.join(table()) + '\n' + after, encoding='utf-8')
    sys.stdout.write('\n'.join(documented(page)) + '\n')
