# SPDX-License-Identifier: GPL-3.0-or-later
"""The zip: installs in a fresh Blender as a legacy add-on and, from 4.2 on, as an extension, and works there
with the libraries inside it. It is made of the build that is tested, or is the release's that STIPPLE_ZIP names."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import bpy
import pytest

ROOT = Path(__file__).resolve().parents[2]

CHECK = '''
import bpy, sys
bpy.ops.mesh.primitive_cube_add()
assert bpy.ops.stipple.splats_from_mesh(anchors=300) == {'FINISHED'}
module = next(m for m in bpy.context.preferences.addons.keys() if m.rpartition('.')[2] == 'stipple')
package = sys.modules[module]
print('INSTALLED', module, package.scene.source.splat_data.count(bpy.context.object.data),
      package.binding.library.find().parent.name, flush=True)
'''


@pytest.fixture
def archive(tmp_path):
    if 'STIPPLE_ZIP' in os.environ:
        return Path(os.environ['STIPPLE_ZIP'])
    sys.path.insert(0, str(ROOT / 'addon'))
    import make_zip
    sys.path.remove(str(ROOT / 'addon'))
    make_zip.make(Path(os.environ['STIPPLE_LIBRARY']).parent, tmp_path / 'stipple.zip')
    return tmp_path / 'stipple.zip'


def run_blender(tmp_path, *arguments):
    environment = {k: v for k, v in os.environ.items() if k != 'STIPPLE_LIBRARY'}
    environment['BLENDER_USER_RESOURCES'] = str(tmp_path / 'user')
    result = subprocess.run([bpy.app.binary_path, '--background', *arguments], env=environment, timeout=120,
                            capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    assert 'Traceback' not in result.stdout + result.stderr, result.stdout + result.stderr
    return result.stdout


def test_zip_has_one_top_folder_and_the_libraries(archive):
    names = zipfile.ZipFile(archive).namelist()
    assert {n.split('/')[0] for n in names} == {'stipple'}
    assert {'stipple/__init__.py', 'stipple/blender_manifest.toml', 'stipple/LICENSE'} <= set(names)
    libraries = {Path(n).stem for n in names if n.startswith('stipple/lib/lib')}
    # One file holds all in a release; else that for networks is there where oneDNN is.
    assert libraries == {f.stem for f in Path(os.environ['STIPPLE_LIBRARY']).parent.glob('libstipple*.so')}
    assert 'STIPPLE_ZIP' in os.environ or {'libstipple_media', 'libstipple_packing'} <= libraries
    assert not [n for n in names if '__pycache__' in n or n.endswith('.pyc')]


def test_legacy_install(archive, tmp_path):
    (tmp_path / 'user').mkdir()
    (tmp_path / 'install.py').write_text(
        f"import bpy\nbpy.ops.preferences.addon_install(filepath={str(archive)!r})\n"
        "bpy.ops.preferences.addon_enable(module='stipple')\nbpy.ops.wm.save_userpref()\n")
    (tmp_path / 'check.py').write_text(CHECK)
    run_blender(tmp_path, '--python-exit-code', '1', '--python', str(tmp_path / 'install.py'))
    output = run_blender(tmp_path, '--python-exit-code', '1', '--python', str(tmp_path / 'check.py'))
    assert 'INSTALLED stipple 300 lib' in output


@pytest.mark.skipif(bpy.app.version < (4, 2, 0), reason='extensions exist from Blender 4.2 on')
def test_extension_install(archive, tmp_path):
    (tmp_path / 'user').mkdir()
    (tmp_path / 'check.py').write_text(CHECK)
    run_blender(tmp_path, '--command', 'extension', 'validate', str(archive))
    run_blender(tmp_path, '--command', 'extension', 'install-file', '--repo', 'user_default', '--enable', str(archive))
    output = run_blender(tmp_path, '--python-exit-code', '1', '--python', str(tmp_path / 'check.py'))
    assert 'INSTALLED bl_ext.user_default.stipple 300 lib' in output
