# SPDX-License-Identifier: GPL-3.0-or-later
"""A release's zip in this machine's Blender: it is installed, works with what lies inside it, and a changed byte is an
error of an operator. The same in Blender 4.3 and 5.2 is told in docs/packages.md."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

WORK = Path(__file__).with_name('in_blender.py')
LEGACY = ('import bpy\nbpy.ops.preferences.addon_install(filepath={!r})\n'
          "bpy.ops.preferences.addon_enable(module='stipple')\nbpy.ops.wm.save_userpref()\n")


@pytest.fixture(scope='module')
def blender(tmp_path_factory):
    """run(arguments...): a Blender with a user folder of its own and without a library of the build."""
    program = shutil.which(os.environ.get('STIPPLE_BLENDER') or 'blender')
    if program is None:
        pytest.skip('Blender is not installed')
    user = tmp_path_factory.mktemp('user')
    environment = {name: value for name, value in os.environ.items() if name != 'STIPPLE_LIBRARY'}
    environment |= {'BLENDER_USER_RESOURCES': str(user), 'PATH': f"/usr/bin:{os.environ['PATH']}"}

    def run(*arguments):
        result = subprocess.run([program, '--background', *map(str, arguments)], env=environment, timeout=250,
                                capture_output=True, text=True)
        assert result.returncode == 0, result.stdout + result.stderr
        return result.stdout + result.stderr
    run.user = user
    return run


@pytest.fixture(scope='module')
def installed(blender, release_zip, tmp_path_factory):
    """The folder that Blender installed the zip to."""
    version = tuple(int(part) for part in re.search(r'Blender (\d+)\.(\d+)', blender('--version')).groups())
    if version >= (4, 2):
        blender('--command', 'extension', 'validate', release_zip)
        blender('--command', 'extension', 'install-file', '--repo', 'user_default', '--enable', release_zip)
    else:
        script = tmp_path_factory.mktemp('script') / 'install.py'
        script.write_text(LEGACY.format(str(release_zip)))
        blender('--python-exit-code', '1', '--python', script)
    return next(blender.user.rglob('stipple/lib/libstipple.so')).parent.parent


def test_the_zip_works_with_what_lies_inside_it(blender, installed, tmp_path):
    output = blender('--python-exit-code', '1', '--python', WORK, '--', tmp_path)
    assert 'Traceback' not in output
    assert f'{installed}/lib/libstipple.so' in next(row for row in output.splitlines() if row.startswith('WORKED'))


def test_a_changed_byte_is_refused_and_blender_lives_on(blender, installed, tmp_path):
    file = installed / 'lib' / 'libstipple.so'
    whole = file.read_bytes()
    broken = bytearray(whole)
    broken[len(broken) // 2] ^= 1
    file.write_bytes(broken)
    try:
        output = blender('--python-exit-code', '1', '--python', WORK, '--', tmp_path, 'damaged')
    finally:
        file.write_bytes(whole)
    assert 'REFUSED' in output and 'Traceback' not in output
