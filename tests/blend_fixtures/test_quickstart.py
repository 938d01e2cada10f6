"""What addon/quickstart.sh runs in Blender leaves what it promises, and the README's examples run as they stand."""
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(os.environ.get('STIPPLE_BUILD_DIR', ROOT / 'build' / 'release'))
BLENDER = os.environ.get('STIPPLE_BLENDER') or 'blender'
README = (ROOT / 'README.md').read_text(encoding='utf-8')
BLENDER_SECONDS = 400  # Cycles renders a volume; a minute on two free cores


@pytest.fixture(scope='module')
def environment(tmp_path_factory):
    """The add-on as its zip installs it, and the tool in the path."""
    folder = tmp_path_factory.mktemp('scripts')
    archive = folder / 'stipple.zip'
    subprocess.run([sys.executable, str(ROOT / 'addon' / 'make_zip.py'), '--libraries', str(BUILD / 'lib'),
                    '--output', str(archive)], check=True)
    subprocess.run([sys.executable, '-m', 'zipfile', '-e', str(archive), str(folder / 'addons')], check=True)
    inherited = {key: value for key, value in os.environ.items() if key != 'STIPPLE_LIBRARY'}
    return {**inherited, 'BLENDER_USER_SCRIPTS': str(folder), 'PATH': f"{BUILD / 'bin'}:/usr/bin:{os.environ['PATH']}"}


@pytest.fixture(scope='module')
def quickstart(environment, tmp_path_factory):
    """(folder, printed text) of a run."""
    out = tmp_path_factory.mktemp('quickstart')
    shutil.copy(ROOT / 'blend-fixtures' / 'suzanne.blend', out)
    result = blender(environment, out, '--python', str(ROOT / 'addon' / 'quickstart.py'), '--', str(out),
                     str(BUILD / 'bin' / 'stipple'))
    return out, result.stdout


def blender(environment, folder, *arguments):
    result = subprocess.run([BLENDER, '-b', '--factory-startup', '--addons', 'stipple', '--python-exit-code', '1',
                             *arguments], cwd=folder, env=environment, text=True, stdout=subprocess.PIPE,
                            stderr=subprocess.STDOUT, timeout=BLENDER_SECONDS)
    assert result.returncode == 0, result.stdout[-4000:]
    return result


def readme_block(language):
    blocks = re.findall(rf'^```{language}\n(.*?)^```', README, re.S | re.M)
    assert len(blocks) == 1
    return blocks[0]


def test_files_are_there_and_hold_what_they_say(quickstart, environment):
    out, _ = quickstart
    kinds = {'mesh.png': 'picture', 'splats_2000.png': 'picture', 'splats_10000.png': 'picture',
             'splats_50000.png': 'picture', 'volume.png': 'picture', 'suzanne.ply': 'splats', 'suzanne.vdb': 'volume',
             'transforms.json': 'data set', 'suzanne.stipple.safetensors': 'surface model'}
    for name, kind in kinds.items():
        info = subprocess.run(['stipple', 'info', str(out / name), '--json'], env=environment, capture_output=True,
                              text=True)
        assert info.returncode == 0, info.stderr
        assert json.loads(info.stdout)['kind'] == kind, name


def test_table_gets_better_with_the_budget(quickstart):
    _, text = quickstart
    rows = re.findall(r'^ *([\d,]+) +([\d,]+) +[\d.]+ +[\d.]+ +([\d.]+)$', text, re.M)
    assert [row[0] for row in rows] == ['2,000', '10,000', '50,000']
    quality = [float(row[2]) for row in rows]
    # Halving the spacing of splats halves what they blur. A wrong camera or colour would keep all near 15 dB.
    assert quality[0] > 17 and quality[1] > quality[0] + 3 and quality[2] > quality[1] + 3


def test_readme_example_for_blender_runs(environment, tmp_path):
    shutil.copy(ROOT / 'blend-fixtures' / 'suzanne.blend', tmp_path)
    (tmp_path / 'example.py').write_text(readme_block('python'), encoding='utf-8')
    blender(environment, tmp_path, str(tmp_path / 'suzanne.blend'), '--python', str(tmp_path / 'example.py'))
    info = subprocess.run(['stipple', 'info', 'suzanne.ply', '--json'], cwd=tmp_path, env=environment,
                          capture_output=True, text=True)
    assert json.loads(info.stdout)['count'] > 0


def test_readme_example_for_the_tool_runs(quickstart, environment):
    out, _ = quickstart
    result = subprocess.run(['bash', '-euc', readme_block('sh')], cwd=out, env=environment, capture_output=True,
                            text=True)
    assert result.returncode == 0, result.stderr
    assert (out / 'many.png').is_file() and (out / 'many.vdb').is_file()
