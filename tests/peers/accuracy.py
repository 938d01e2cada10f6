"""Renews what docs/results/accuracy.md says of the three scenes of blend-fixtures/, and its plots.

    /usr/bin/python3 tests/peers/accuracy.py [--build build/release] [--work FOLDER] [--only
    suzanne|instances|terrain|volume]

Makes splats of each scene in background Blender, measures its view by `stipple accuracy`, and voxel sizes of the first,
and writes the tables between the marks of the page and the plots into docs/images. Run it on a machine that does
nothing else.
"""
import argparse
import csv
import os
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = ROOT / 'docs' / 'results' / 'accuracy.md'
SCENES = ('suzanne', 'instances', 'terrain')
VOLUME = 'volume'  # of the first scene
VOXELS = 256  # along the longest side, of the finest
ANCHORS, WIDTH, HEIGHT = 200_000, 1280, 720


def export(scene, build, work):
    """Splats and camera of a scene, by the add-on of this working tree."""
    if (work / f'{scene}.ply').exists():
        return
    addons = work / 'user' / 'scripts' / 'addons'
    addons.mkdir(parents=True, exist_ok=True)
    if not (addons / 'stipple').exists():
        (addons / 'stipple').symlink_to(ROOT / 'addon' / 'stipple', target_is_directory=True)
    environment = dict(os.environ, PATH=f"/usr/bin:{os.environ['PATH']}", PYTHONDONTWRITEBYTECODE='1',
                       BLENDER_USER_RESOURCES=str(work / 'user'),
                       STIPPLE_LIBRARY=str((build / 'lib' / 'libstipple.so').resolve()))
    subprocess.run(['blender', '-b', '--factory-startup', '--addons', 'stipple', '--python-exit-code', '1', '--python',
                    ROOT / 'blend-fixtures' / 'export_view.py', '--', ROOT / 'blend-fixtures' / f'{scene}.blend', work,
                    str(ANCHORS), str(WIDTH), str(HEIGHT)], env=environment, check=True, stdout=subprocess.DEVNULL)


def measure(subject, build, work):
    """Rows of the report, as the CSV has them, and the sentence above its table."""
    scene = SCENES[0] if subject == VOLUME else subject
    what = ['--resolution', str(VOXELS)] if subject == VOLUME else ['--camera', work / f'{scene}.json']
    out = subprocess.run([build / 'bin' / 'stipple', 'accuracy', work / f'{scene}.ply', *what, '-o',
                          work / f'{subject}.csv', '-o', ROOT / 'docs' / 'images' / f'accuracy_{subject}.svg',
                          '--seconds', '15'], check=True,
                         capture_output=True, text=True).stdout
    return list(csv.DictReader((work / f'{subject}.csv').open())), out.splitlines()[0]


def milliseconds(row):
    value = float(row['seconds']) * 1e3
    return f'{value:,.0f}' if value >= 100 else f'{value:.3g}'


def table(rows):
    counted = 'voxels' if 'voxels' in rows[0] else 'splats'
    lines = [f'| setting | ms | PSNR, dB | largest error | 99.9 % | {counted} | |', '|---|---|---|---|---|---|---|']
    for row in rows:
        estimated = ' (estimated)' if row['is_estimated'] == '1' else ''
        front = 'best for its time' if row['on_front'] == '1' else ''
        lines.append(f"| {row['setting']} | {milliseconds(row)}{estimated} | {float(row['psnr']):.1f} | "
                     f"{float(row['largest_error']):.2g} | {float(row['error_99_9']):.2g} | {int(row[counted]):,} | "
                     f"{front} |")
    return '\n'.join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--build', type=pathlib.Path, default=ROOT / 'build' / 'release')
    parser.add_argument('--work', type=pathlib.Path)
    parser.add_argument('--only', choices=(*SCENES, VOLUME))
    options = parser.parse_args()
    work = (options.work or pathlib.Path(tempfile.mkdtemp(prefix='stipple-accuracy-'))).resolve()
    work.mkdir(parents=True, exist_ok=True)
    page = PAGE.read_text()
    for subject in (options.only,) if options.only else (*SCENES, VOLUME):
        export(SCENES[0] if subject == VOLUME else subject, options.build, work)
        rows, head = measure(subject, options.build, work)
        made = (f'<!-- {subject} -->\n{head}.\n\n{table(rows)}\n\n'
                f'![{subject}](../images/accuracy_{subject}.svg)\n<!-- end -->')
        page, count = re.subn(rf'<!-- {subject} -->.*?<!-- end -->', lambda _: made, page, flags=re.S)
        if count != 1:
            sys.exit(f'{PAGE} has {count} places for {subject}; 1 is expected')
    PAGE.write_text(page)


main()
